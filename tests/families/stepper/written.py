"""Controllers of every kind that a write may meet, and what they have stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Any, Final

from motorbus.families.stepper import Program
from motorbus.families.stepper.simulator import Controller as Simulated
from motorbus.families.stepper.table import Project, Step, decode_image, with_steps

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
