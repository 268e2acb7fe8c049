"""The caller of a write is interrupted, at any step: nobody is left in the dark, and the next write mends it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.core.operation import Operation
from motorbus.families.stepper.driver.copying import restore
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.selecting import clear, save
from motorbus.families.stepper.driver.writing import write_project
from motorbus.families.stepper.program.backups import Backup
from motorbus.families.stepper.table import Project
from tests.conformance.world import Cut, Steps
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.written import LONGER, PICK, program, stored

NEW = PICK.with_step(1, delay=1000)
ACTS: dict[str, Callable[[Node], Operation[Any]]] = {
    "write": lambda node: write_project(node, program(NEW)),
    "write unsaved": lambda node: write_project(node, program(NEW), save=False),
    "clear": lambda node: clear(node, 2),
    "restore": lambda node: restore(node, Backup(dumps={2: program(NEW).dump()})),
}
CHANGES = ("FF AA 6E", "FF AA 2E", "FF AA 1E", "FF AA 03")


def cut(there: Bench, act: Operation[Any], at: int, *, before: bool) -> Cut | None:
    """The interruption that came out at the top, None when the operation was over before."""
    steps = Steps(there.bus, cut_at=at, before=before)
    try:
        steps.run(act)
    except Cut as interruption:
        return interruption
    return None


def tried(name: str, at: int, *, before: bool) -> tuple[Cut | None, bool]:
    """The interruption, and whether something was sent by then that changes something; the next write mends it."""
    with bench() as there:
        there.simulated.put(1, LONGER)
        there.simulated.put(2, PICK)
        interruption = cut(there, ACTS[name](there.device), at, before=before)
        changed = any(frame.startswith(CHANGES) for frame in there.sent())
        assert stored(there.simulated, 2) in (PICK, NEW, Project())
        there.device.write_project(program(NEW))
        assert stored(there.simulated, 2) == NEW
        assert stored(there.simulated, 1).steps == LONGER.steps
        return interruption, changed


@pytest.mark.parametrize("before", [True, False])
@pytest.mark.parametrize("name", ACTS)
def test_at_every_step(name: str, before: bool) -> None:
    untold, at = 0, 0
    while (found := tried(name, at, before=before))[0] is not None:
        interruption, changed = found
        notes = " ".join(getattr(interruption, "__notes__", ()))
        if changed:
            untold += not any(words in notes for words in ("half written", "may hold", "were restored"))
        at += 1
    assert at > 3
    assert untold <= 2, "all but the last steps, behind the last reading, say what may be half written"


def test_an_interruption_between_commands_says_how_far_it_came() -> None:
    notes: list[str] = []
    for at in range(40):
        with bench() as there:
            there.simulated.put(2, PICK)
            interruption = cut(there, write_project(there.device, program(LONGER)), at, before=True)
            notes += getattr(interruption, "__notes__", ())
    told = {note[: note.index(" commands")] for note in notes if " commands were" in note}
    assert told == {f"{number} of 6" for number in range(6)}


def test_what_is_saved_by_itself_is_told_too() -> None:
    for at in range(200):
        with bench() as there:
            there.device.write_project(program(PICK), save=False)
            interruption = cut(there, save(there.device, 2), at, before=False)
            assert stored(there.simulated, 2) in (PICK, Project())
            if interruption is None:
                assert stored(there.simulated, 2) == PICK
                return
    pytest.fail("it has no end")
