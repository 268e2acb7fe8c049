"""A machine that is open: its axes, the buses that they are on, and one clock for all of them.

Everything that a machine does with several axes is a function of this, and knows no family.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from motorbus.bus.face import BusFace
from motorbus.errors import RequestError
from motorbus.motion.axis import AxisVerbs
from motorbus.motion.machine import Machine


class Body:
    """`machine` as its file says; `buses` that are open, and the `axes` on them, by their names.

    The clock of the robot is at 0 when this is made; `origins` says what the clock of each bus showed then (s).
    """

    def __init__(self, machine: Machine, buses: Mapping[str, BusFace], axes: Mapping[str, Any]) -> None:
        self.machine: Final = machine
        self.buses: Final = buses
        self.axes: Final = axes
        self.origins: Final = {name: bus.link.now() for name, bus in buses.items()}

    def chosen(self, names: str | Iterable[str] | None = None) -> dict[str, Any]:
        """The axes that these names of axes, groups and buses stand for, each once; None: all that are open.

        Raises RequestError for a name that the machine does not have, and for an axis that was not opened.
        """
        if names is None:
            return dict(self.axes)
        wanted = (names,) if isinstance(names, str) else tuple(names)
        found = dict.fromkeys(axis for name in wanted for axis in self.machine.axes_of(name))
        for name in found:
            if name not in self.axes:
                raise RequestError(
                    f"the axis {name!r} is not open",
                    expected=f"one of {', '.join(self.axes)}",
                    advice="load the machine with all its axes; nothing was sent",
                )
        return {name: self.axes[name] for name in found}

    def axis(self, name: str) -> Any:
        """The axis of this name. Raises RequestError when the machine has none, or it was not opened."""
        if name in self.axes:
            return self.axes[name]
        found = self.chosen(name)
        raise RequestError(
            f"{name!r} is not an axis: it stands for {', '.join(found)}",
            expected="the name of one axis",
            advice="take one of them, or give the name to a verb of the robot; nothing was sent",
        )

    def by_bus(self, axes: Mapping[str, AxisVerbs]) -> dict[str, list[AxisVerbs]]:
        """These axes by the name of their bus, in the order of the buses."""
        found: dict[str, list[AxisVerbs]] = {name: [] for name in self.buses}
        for axis in axes.values():
            found[axis.spec.bus].append(axis)
        return {name: ones for name, ones in found.items() if ones}
