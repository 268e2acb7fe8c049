"""How the axes of a command were left that did not end as it should: told when it is done, and as it is then.

What `exit` does may take the torque or drive an axis away, so nothing that was true before it is told.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

from motorbus.errors import MotorbusError
from motorbus.session.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from motorbus.cli.output import Output
    from motorbus.motion.axis import Axis
    from motorbus.motion.leaving import Leaving
    from motorbus.motion.machine import Machine

NEAR: Final = 0.02
"""rad; as near as a device comes to where it is parked."""
NEAR_LINEAR: Final = 0.001
"""m; the same of a linear axis."""


@contextmanager
def opened(
    machine: Machine, axes: Sequence[str], output: Output, *, report: Callable[[object], None]
) -> Iterator[Robot]:
    """A robot whose error says how it was left; what takes its time then is announced on `output`.

    Raises as `Robot.of`.
    """
    ended: BaseException | None = None
    try:
        with Robot.of(machine, axes, report=report) as robot:
            try:
                yield robot
            except BaseException as error:
                ended = error
                robot.when_left = _Told(robot, output)
                raise
    except KeyboardInterrupt as again:  # the second one: it tells what the first would have told
        if ended is not None and again is not ended:
            if isinstance(ended, MotorbusError):
                again.add_note(f"before it: {ended}")
            for note in getattr(ended, "__notes__", ()):
                again.add_note(note)
        raise


class _Told:
    """Adds to an error how each axis was left that had been given torque or moved, in what way, and where it is."""

    def __init__(self, robot: Robot, output: Output) -> None:
        self._robot = robot
        self._concerned = {name: axis.spec.exit for name, axis in robot.axes.items() if axis.engaged}
        if parked := [name for name, how in self._concerned.items() if how == "park"]:
            output.note(f"note: parking {', '.join(parked)}; Ctrl-C stops that too")

    def __call__(self, leaving: Leaving, error: BaseException | None) -> None:
        """See `RobotVerbs.when_left`."""
        if error is not None and (self._concerned or isinstance(error, KeyboardInterrupt)):
            told = [f"{name}: {self._left(name, leaving)}" for name in self._concerned or self._robot.axes]
            error.add_note("; ".join(told))

    def _left(self, name: str, leaving: Leaving) -> str:
        """How it was left, and where: `let go at 15.4 deg`."""
        from motorbus.cli.robot import place

        try:
            at = self._robot.positions([name])[name]
        except (MotorbusError, KeyboardInterrupt):
            return "does not tell where it stands"
        axis = self._robot.axes[name]
        where = f"at {place(self._robot, name, at)}"
        latched = self._robot.buses[axis.spec.bus].latched
        if name not in self._concerned or name in leaving.errors or latched:
            return where
        return f"{self._how(axis, at)} {where}"

    def _how(self, axis: Axis, at: float | None) -> str:
        how = self._concerned[axis.name]
        if how != "park":
            return {"hold": "holds", "torque_off": "let go", "leave": "left as it was, last"}[how]
        near = NEAR_LINEAR if axis.spec.linear else NEAR
        parked = at is not None and abs(at - (axis.spec.park or 0.0)) < near
        return "parked" if parked else "not parked, holds"
