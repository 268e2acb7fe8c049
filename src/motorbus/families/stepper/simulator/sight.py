"""All that a host could learn of a controller at a moment, and what it has on its pins, cheap to make and to compare.

By name: each row of the project that is being edited; `image_1` to `image_4`, the bytes that reading a project brings;
`input_1` to `input_5`, `output_1` to `output_3` and `leds`, 1 when active; `selected`; and `phase`, what it is doing.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple, cast

from motorbus.families.stepper.execution import Phase
from motorbus.families.stepper.simulator.controller import Controller
from motorbus.families.stepper.simulator.memory import Memory, Rows
from motorbus.families.stepper.table import INPUTS, PROJECTS

_PHASES = tuple(Phase)


class Sight(NamedTuple):
    """The four stored images, the one that is edited, the flags of the device, and the state on its pins."""

    memory: Memory
    stored: tuple[bytes, ...]
    working: bytes
    flags: tuple[tuple[str, int], ...]
    selected: int
    inputs: frozenset[int]
    outputs: int
    leds: bool
    phase: Phase


def sight(controller: Controller) -> Sight:
    """What it is like now."""
    store, state = controller.store, controller.state
    return Sight(
        store,
        tuple(store.stored.values()),
        store.working,
        tuple(store.flags.items()),
        store.selected,
        state.inputs,
        state.outputs,
        state.leds,
        state.phase,
    )


def shown(picture: tuple[Hashable, ...], name: str) -> int | bytes:
    """What stands under this name in a picture. Raises RequestError for a row that is not there."""
    seen = cast("Sight", picture)
    of, _, number = name.partition("_")
    if of == "image" and number.isdecimal() and 1 <= int(number) <= PROJECTS:
        return _as_it_was(seen).image(int(number))
    if of == "input" and number.isdecimal() and 1 <= int(number) <= INPUTS:
        return int(int(number) in seen.inputs)
    if of == "output" and number in ("1", "2", "3"):
        return seen.outputs >> int(number) - 1 & 1
    plain = {"leds": int(seen.leds), "selected": seen.selected, "phase": _PHASES.index(seen.phase)}
    return plain[name] if name in plain else Rows(_as_it_was(seen))[name]


def _as_it_was(seen: Sight) -> Memory:
    """Its memory as it was, apart from the one it has now."""
    then = seen.memory.copy()
    then.stored = dict(enumerate(seen.stored, start=1))
    then.working, then.flags, then.selected = seen.working, dict(seen.flags), seen.selected
    return then
