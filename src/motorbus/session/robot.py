"""A machine by its file: its buses are opened, its devices asked what they are, and its axes are there to be moved.

    with Robot.load("motorbus.toml") as robot:
        robot.states()
        robot["shoulder"].position()

Loading reads and writes nothing to any device.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from os import PathLike
from typing import Any, Self

from motorbus.bus.pump import Bus
from motorbus.errors import RequestError
from motorbus.motion import group
from motorbus.motion.abreast import Led, together
from motorbus.motion.axis import Axis
from motorbus.motion.body import Body
from motorbus.motion.conductor import Conductor
from motorbus.motion.machine import Machine


class RobotVerbs(Body):
    """What a robot can do, blocking or async."""

    states = together(group.states)


class Robot(RobotVerbs, Led):
    """An open machine, blocking; use it in a `with`. Made by `load` or `of`."""

    def __init__(self, machine: Machine, buses: Mapping[str, Bus], axes: Mapping[str, Axis]) -> None:
        super().__init__(machine, buses, axes)
        self.conductor = Conductor(buses, self.origins)
        self._exits = ExitStack()

    @classmethod
    def load(cls, path: str | PathLike[str], axes: str | Iterable[str] | None = None) -> Self:
        """Open the machine that a file describes, or only what these axes, groups and buses of it need."""
        from motorbus.session import prepare

        return cls.of(Machine.load(path, check_address=lambda address: prepare(address, {})), axes)

    @classmethod
    def of(cls, machine: Machine, axes: str | Iterable[str] | None = None) -> Self:
        """Open a machine, or only what these axes, groups and buses of it need."""
        from motorbus.session import open

        wanted = machine.axes if axes is None else _chosen(machine, axes)
        needed = dict.fromkeys(machine.axes[name].bus for name in wanted)
        with ExitStack() as stack:
            buses = {name: stack.enter_context(open(machine.buses[name].address)) for name in needed}
            robot = cls(machine, buses, {name: _axis(machine, name, buses) for name in wanted})
            robot._exits = stack.pop_all()
        return robot

    def __getitem__(self, name: str) -> Axis:
        axis: Axis = self.chosen(name)[name]
        return axis

    def close(self) -> None:
        """Give the ports back."""
        self._exits.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def _chosen(machine: Machine, names: str | Iterable[str]) -> list[str]:
    wanted = (names,) if isinstance(names, str) else tuple(names)
    return list(dict.fromkeys(axis for name in wanted for axis in machine.axes_of(name)))


def _axis(machine: Machine, name: str, buses: Mapping[str, Bus]) -> Axis:
    spec = machine.axes[name]
    bus = buses[spec.bus]
    device: Any = bus.family.devices.blocking(bus, spec.node)
    model = device.identify().model
    able = bus.family.axis(model)
    if not able:
        raise RequestError(
            f"{name}: {spec.device} is {model}, of which nobody has said what it can do",
            advice="nothing was sent that changes anything",
        )
    return Axis(bus, name, spec, device, able)
