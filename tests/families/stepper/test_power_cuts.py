"""The supply goes for an instant, at any moment of a write: old or new, or an error, and the next write mends it.

A controller that comes back has its first project selected and knows nothing of edits. What is sent to it then goes
elsewhere, and saving stores another project's numbers. That must never be called a success.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import pytest

from motorbus.core.steps import catch
from motorbus.errors import MotorbusError, OutcomeUnknown, VerificationFailed
from motorbus.families.stepper.driver.selecting import clear, save
from motorbus.families.stepper.driver.writing import Proof, Written, write_project
from motorbus.families.stepper.table import Project
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.written import LONGER, PICK, cut_at, program, stored, took

MEANT = replace(PICK, steps=PICK.steps[:3] + LONGER.steps[3:])
"""PICK over LONGER: the row behind the last step stays."""
OTHER = replace(LONGER, number=1).with_step(1, delay=4711)
KINDS: list[dict[str, Any]] = [
    {"select": select, "read_view": view, "selected_at_boot": boot, "save_cut": cut}
    for select, view, boot, cut in product(
        ("load", "relabel"), ("working", "stored"), (1, 2), ("old", "empty")
    )
]


def moments(length: float, count: int, begin: float = 0.37) -> Iterator[float]:
    """So many of them, spread over a write and a little more; with another `begin` (0 to 1) they are others."""
    return (length * 1.05 * (number + begin) / count for number in range(count))


def lived(kind: dict[str, Any], turnaround: float = 0.002) -> Bench:
    made = Bench(pace=True, turnaround=turnaround, **kind)
    made.simulated.put(1, OTHER)
    made.simulated.put(2, LONGER)
    return made


def length_of(kind: dict[str, Any]) -> float:
    """s that the whole write takes when nothing happens."""
    there = lived(kind)
    return took(there, lambda: there.device.write_project(program(PICK)))


def judged(there: Bench, told: Written | MotorbusError) -> str:
    """What came of it; a success that is none fails the test."""
    held = stored(there.simulated, 2)
    assert stored(there.simulated, 1) == OTHER, "another project has changed"
    if isinstance(told, Written):
        assert told.saved
        assert held == MEANT
        return "written"
    if held in (LONGER, MEANT):
        return "error"
    assert isinstance(told, VerificationFailed | OutcomeUnknown), "what it holds is not said"
    assert held == Project() or isinstance(told, VerificationFailed)
    return "told"


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: "-".join(map(str, kind.values())))
def test_at_every_exchange_of_a_write(kind: dict[str, Any]) -> None:
    seen = set()
    for moment in moments(length_of(kind), 9, KINDS.index(kind) / len(KINDS)):
        there = lived(kind)
        cut_at(there, moment)
        told = there.run(catch(write_project(there.device, program(PICK))))
        seen.add(judged(there, told))
        again = there.device.write_project(program(PICK))
        assert again.saved or again.proof is Proof.UNCHANGED
        assert stored(there.simulated, 2) == MEANT
        there.bus.close()
    assert "written" in seen


@pytest.mark.parametrize("boot", [1, 2])
@pytest.mark.parametrize("view", ["working", "stored"])
def test_while_what_was_left_is_saved(view: str, boot: int) -> None:
    kind = {"read_view": view, "selected_at_boot": boot}
    for moment in moments(3.0 if view == "stored" else 0.85, 12):
        there = lived(kind)
        there.device.write_project(program(PICK), save=False)
        cut_at(there, moment)
        judged(there, there.run(catch(save(there.device, 2))))
        there.bus.close()


@pytest.mark.parametrize("cut", ["old", "empty"])
def test_while_a_project_is_cleared(cut: str) -> None:
    for moment in moments(0.85, 16):
        there = lived({"save_cut": cut})
        cut_at(there, moment)
        told = there.run(catch(clear(there.device, 2)))
        held = stored(there.simulated, 2)
        assert held == Project() or (isinstance(told, MotorbusError) and held == LONGER)
        there.device.clear(2)
        assert stored(there.simulated, 2) == Project()
        there.bus.close()


def test_a_cut_between_the_edits_and_the_save_stores_nothing_else() -> None:
    """With the read-back behind it: edits of 2 are gone, 2 reads as it was, and all of it is written again."""
    with bench(pace=True) as there:
        there.simulated.put(1, OTHER)
        there.simulated.put(2, PICK)
        # two dumps, 6E and one edit take 0.498 + 0.039 s; the dump behind them begins
        cut_at(there, 0.54)
        told = there.device.write_project(program(PICK, delay=1000))
        assert (told.saved, told.commands) == (True, 3 + 78)
        assert stored(there.simulated, 2) == PICK.with_step(1, delay=1000)
        assert stored(there.simulated, 1) == OTHER


def test_a_cut_right_before_the_save_is_told_with_what_is_there_now() -> None:
    with bench(pace=True) as there:
        there.simulated.put(1, OTHER)
        there.simulated.put(2, PICK)
        # as above, and the dump: 0.786 s; the save is on its way
        cut_at(there, 0.79)
        with pytest.raises(VerificationFailed, match="was saved and does not read as it was written") as told:
            there.device.write_project(program(PICK, delay=1000))
        assert "total_steps: 3 -> 4" in told.value.expected
        assert "it lost its supply" in told.value.cause
        assert stored(there.simulated, 2).step(1).delay == 4711
        assert there.device.write_project(program(PICK, delay=1000)).saved
        assert stored(there.simulated, 2).step(1).delay == 1000
