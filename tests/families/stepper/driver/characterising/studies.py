"""Controllers whose readings nobody has told, and what is wrong in what was found out about one."""

from __future__ import annotations

from dataclasses import fields
from math import exp, log
from random import Random
from typing import Any

from motorbus.families.stepper.driver import Node
from motorbus.families.stepper.driver.characterising.findings import Case
from motorbus.families.stepper.execution import Behaviour, Phase
from motorbus.families.stepper.program import Profile
from motorbus.families.stepper.program.profile import MEMORY
from motorbus.families.stepper.table import Order, Project, Step, with_steps
from tests.families.stepper.bench import Bench

STORES = ("FF AA 2E", "FF AA 1E")
"""How the requests begin that store something."""


def hidden(chance: Random) -> dict[str, Any]:
    """Every switch of execution and of memory by chance, and how long it thinks."""
    options: dict[str, Any] = {
        one.name: chance.choice(one.metadata["choices"] or (True, False))
        for one in fields(Behaviour)
        if one.name != "ramp_tick_ms"
    }
    options |= {name: chance.choice(choices) for name, choices in MEMORY.items()}
    return options | {
        "ramp_tick_ms": exp(chance.uniform(log(0.05), log(100.0))),
        "selected_at_boot": chance.randint(1, 4),
        "shipped": chance.choice(("example", "empty")),
        "turnaround": chance.uniform(0.0, 0.02),
        "save_time": chance.uniform(0.0, 0.1),
    }


def made_up(chance: Random, number: int) -> Project:
    """A project that somebody might have stored."""
    base = Project(
        number=number,
        microsteps=chance.choice((1, 4, 8, 16, 32, 256)),
        step_angle=chance.choice((90, 180)),
        turn_distance=chance.choice((1, 1600, 5000)),
        stop_mode=chance.randint(0, 1),
    )
    steps = [
        Step(
            distance=chance.randint(1, 5000),
            speed=chance.randint(1, 300),
            acceleration=chance.randint(1, 100),
            start_frequency=chance.randint(1, 400),
            delay=chance.choice((0, 100, 1000, 2500, 60000)),
        )
        for _ in range(chance.randint(1, 4))
    ]
    return with_steps(base, tuple(steps))


def furnished(there: Bench, chance: Random) -> None:
    """Projects in it: nearly always a first one, and often one where others are lent."""
    number = 1 if chance.random() < 0.9 else 2
    there.simulated.put(number, made_up(chance, number))
    if chance.random() < 0.5:
        there.simulated.put(4, made_up(chance, 4))


def wrong(profile: Profile, options: dict[str, Any]) -> dict[str, object]:
    """What was settled and is not so, with what it is and the evidence; a tick may be 5 % off."""
    found: dict[str, object] = {}
    for name, value in profile.settled.items():
        real = options[name]
        right = abs(float(value) / real - 1) < 0.05 if name == "ramp_tick_ms" else value == real
        if not right:
            found[name] = (value, real, profile.evidence[name])
    if options["ramp"] == "pulse" and "ramp_tick_ms" in profile.settled:
        found["ramp_tick_ms"] = "there is none"
    return found


def as_before(there: Bench, stored: dict[int, bytes]) -> bool:
    """Whether it is at rest, nothing was stored, and what it would run of each project is what it has stored."""
    here = there.simulated
    there.link.advance(5.0)
    rests = here.state.phase is Phase.IDLE
    selected = here.store.selected
    edited = here.store.working[1:], stored[selected][1:]
    if here.switches.flags_scope == "device":  # then what an image says of them means nothing
        edited = without_flags(edited[0]), without_flags(edited[1])
    unset = not any(here.store.flags.values())
    return rests and unset and dict(here.store.stored) == stored and edited[0] == edited[1]


def without_flags(image: bytes) -> bytes:
    """The same image, but for the number, with the three flags at 0."""
    return image[:13] + bytes(3) + image[16:]


def node(order: Order = "little") -> Node:
    """The controller of a line that was opened with this order of bytes."""
    return Node(order=order)


def case_of(there: Bench) -> Case:
    """The case of this controller as it is now, project 4 being lent and project 1 telling of the motor."""
    stored = {number: bytes(there.device.dump(number)[6:]) for number in range(1, 5)}
    return Case(there.device, 4, 1.0, stored, 1)
