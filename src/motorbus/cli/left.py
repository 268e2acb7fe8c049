"""How the axes of a command were left that did not end as it should: told when it is done, and as it is then.

What `exit` does may take the torque or drive an axis away, so nothing that was true before it is told.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from motorbus.errors import MotorbusError
from motorbus.session.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.bus.pump import Bus
    from motorbus.cli.output import Output
    from motorbus.motion.axis import Axis
    from motorbus.motion.leaving import Leaving
    from motorbus.motion.machine import Machine

NEAR: Final = 0.02
"""rad; as near as a device comes to where it is parked."""
NEAR_LINEAR: Final = 0.001
"""m; the same of a linear axis."""


class ToldRobot(Robot):
    """A robot whose error says how it was left; what takes its time is announced on `output`."""

    output: Output
    late = 0.0
    _concerned: Mapping[str, str] = {}

    def __init__(self, machine: Machine, buses: Mapping[str, Bus], axes: Mapping[str, Axis]) -> None:
        super().__init__(machine, buses, axes)
        for bus in buses.values():
            bus.turns.latency = max(self.late, bus.turns.latency)

    def _end(self, others: BaseException | None) -> None:
        if others is not None and not self._shut:
            self._concerned = {name: axis.spec.exit for name, axis in self.axes.items() if axis.engaged}
            parked = [name for name, how in self._concerned.items() if how == "park"]
            if parked:
                self.output.note(f"note: parking {', '.join(parked)}; Ctrl-C stops that too")
        try:
            super()._end(others)
        except KeyboardInterrupt as again:  # the second one: it tells what the first would have told
            if others is not None and again is not others:
                if isinstance(others, MotorbusError):
                    again.add_note(f"before it: {others}")
                for note in getattr(others, "__notes__", ()):
                    again.add_note(note)
            raise

    def _ended(self, leaving: Leaving, others: BaseException | None) -> None:
        try:
            super()._ended(leaving, others)
        finally:
            if others is not None and (self._concerned or isinstance(others, KeyboardInterrupt)):
                told = [f"{name}: {self._left(name, leaving)}" for name in self._concerned or self.axes]
                others.add_note("; ".join(told))

    def _left(self, name: str, leaving: Leaving) -> str:
        """How it was left, and where: `let go at 15.4 deg`."""
        from motorbus.cli.robot import place

        try:
            at = self.positions([name])[name]
        except (MotorbusError, KeyboardInterrupt):
            return "does not tell where it stands"
        axis = self.axes[name]
        where = f"at {place(self, name, at)}"
        if name not in self._concerned or name in leaving.errors or self.buses[axis.spec.bus].turns.latched:
            return where
        return f"{self._how(axis, at)} {where}"

    def _how(self, axis: Any, at: float | None) -> str:
        how = self._concerned[axis.name]
        if how != "park":
            return {"hold": "holds", "torque_off": "let go", "leave": "left as it was, last"}[how]
        near = NEAR_LINEAR if axis.spec.linear else NEAR
        parked = at is not None and abs(at - (axis.spec.park or 0.0)) < near
        return "parked" if parked else "not parked, holds"


def left_as_told(output: Output, late: float) -> type[ToldRobot]:
    """`ToldRobot` with what it tells on, and how late (s) its devices may be, from its first question on."""
    return type("ToldRobot", (ToldRobot,), {"output": output, "late": late})
