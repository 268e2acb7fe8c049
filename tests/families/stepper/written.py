"""Controllers of every kind that a write may meet, what they have stored, and a supply that goes at a chosen moment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from math import inf
from typing import Any, Final

from motorbus.core.request import Data
from motorbus.families.stepper import Program
from motorbus.families.stepper.simulator import Controller as Simulated
from motorbus.families.stepper.simulator import StepperBus
from motorbus.families.stepper.table import Project, Step, decode_image, with_steps
from tests.families.stepper.bench import Bench

KINDS: Final[list[dict[str, Any]]] = [
    {"select": select, "read_view": view, "flags_scope": scope, "dump_order": order}
    for select, view, scope, order in product(
        ("load", "relabel"), ("working", "stored"), ("project", "device"), ("little", "big")
    )
]
"""What nobody has settled, in every combination."""
PICK: Final = with_steps(
    Project(number=2, microsteps=16, step_angle=90, turn_distance=5000, project_loop=3, stop_mode=1),
    (
        Step(distance=10000, start_frequency=200, acceleration=100, speed=60, output=1, delay=500),
        Step(distance=56814, direction=1, start_frequency=200, acceleration=100, speed=300, start_input=1),
        Step(distance=43775, start_frequency=200, acceleration=100, speed=300, output=8, stop_input=2),
    ),
)
"""Three steps, with EE DD and FF AA among their bytes."""
LONGER: Final = replace(
    with_steps(
        PICK, (*PICK.steps[:3], Step(distance=7, start_frequency=90, acceleration=9, speed=30, delay=70))
    ),
    stop_mode=0,
)


def named(kind: Mapping[str, str]) -> str:
    """A kind, for the name of a test."""
    return "-".join(kind.values())


def stored(simulated: Simulated, number: int) -> Project:
    """What is in this slot, whatever a dump may show; the controller has lost its supply for that."""
    simulated.power_cycle()
    switches, store = simulated.switches, simulated.store
    project = decode_image(store.stored[number], "big" if switches.dump_order == "big" else "little")
    flags: dict[str, Any] = store.flags if switches.flags_scope == "device" else {}
    return replace(project, **flags)


def program(project: Project, **changes: int) -> Program:
    """A program of it, with the delay, distance and so on of its first step changed."""
    return Program(project=project.with_step(1, **changes) if changes else project)


class Supply:
    """The simulated bus, whose controller loses its supply for an instant at this moment (s on the link's clock)."""

    def __init__(self, bus: StepperBus, at: float) -> None:
        self.bus = bus
        self.at = at
        self.usual_rate = None

    @property
    def nodes(self) -> Mapping[int, Simulated]:
        return self.bus.nodes

    def receive(self, data: Data, at: float) -> None:
        self.bus.receive(data, at)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        said: list[tuple[float, Data]] = []
        if self.at <= to:
            said += self.bus.advance(self.at)
            self.bus.nodes[1].power_cycle()
            self.at = inf
        return said + list(self.bus.advance(to))

    def due(self) -> float:
        due = self.bus.due()
        return self.at if due is None else min(self.at, due)

    def tune(self, rate: int) -> None:
        self.bus.tune(rate)


def cut_at(there: Bench, moment: float) -> None:
    """The supply goes, and comes back at once, so many seconds from now."""
    there.link.simulator = Supply(there.simulator, there.link.now() + moment)


def took(there: Bench, act: Callable[[], object]) -> float:
    """Seconds of the link's clock."""
    began = there.link.now()
    act()
    return there.link.now() - began
