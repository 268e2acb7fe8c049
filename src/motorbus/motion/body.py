"""A machine that is open: its axes, the buses that they are on, and one clock for all of them.

Everything that a machine does with several axes is a function of this, and knows no family.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from motorbus.bus.base import BaseBus
from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.machine import Machine


class Body:
    """`machine` as its file says; `buses` that are open, and the `axes` on them, by their names.

    The clock of the robot is at 0 when this is made; `origins` says what the clock of each bus showed then (s), or
    shows when an earlier one is to go on.
    """

    def __init__(
        self,
        machine: Machine,
        buses: Mapping[str, BaseBus],
        axes: Mapping[str, Any],
        origins: Mapping[str, float] | None = None,
    ) -> None:
        self.machine: Final = machine
        self.buses: Final = buses
        self.axes = axes
        self.origins: Final[Mapping[str, float]] = (
            {name: bus.link.now() for name, bus in buses.items()} if origins is None else origins
        )

    @property
    def now(self) -> float:
        """s since this was made: what the clock of the robot shows, by that clock of its buses which is ahead."""
        return max((bus.link.now() - self.origins[name] for name, bus in self.buses.items()), default=0.0)

    def chosen(self, names: str | Iterable[str] | None = None) -> dict[str, Any]:
        """The axes that these names of axes, groups and buses stand for, each once; None: all that are open.

        Raises RequestError for a name that the machine does not have, and for an axis that was not opened.
        """
        if names is None:
            return dict(self.axes)
        found = dict.fromkeys(axis for name in named(names) for axis in self.machine.axes_of(name))
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
        (name,) = named([name])
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


def named(names: str | Iterable[str]) -> tuple[str, ...]:
    """One name or several. Raises RequestError for none, and for what is no name."""
    found: tuple[object, ...] = (
        tuple(names) if isinstance(names, Iterable) and not isinstance(names, str) else (names,)
    )
    words = tuple(name for name in found if isinstance(name, str))
    if not words or len(words) < len(found):
        wrong = next((name for name in found if not isinstance(name, str)), None)
        raise RequestError(
            f"{shown(wrong)} is not a name" if found else "no axis is named",
            expected="names of axes, groups or buses",
            advice="leave them out for all axes; nothing was sent",
        )
    return words
