"""Dumps tell how they are to be read and what becomes of edits, in every combination of the readings."""

from __future__ import annotations

import pytest

from motorbus.errors import VerificationFailed
from motorbus.families.stepper.driver.characterising import views
from motorbus.families.stepper.driver.characterising.timing import controlled
from motorbus.families.stepper.driver.characterising.trials import controls
from motorbus.families.stepper.table import BLANK, Project, Step, encode_image, with_steps
from tests.families.stepper.bench import Bench, Tampering, bench
from tests.families.stepper.driver.characterising.studies import case_of

EACH_SELECT = pytest.mark.parametrize("select", ["load", "relabel"])
EACH_ORDER = pytest.mark.parametrize("order", ["little", "big"])
EACH_SCOPE = pytest.mark.parametrize("scope", ["project", "device"])


@EACH_SELECT
@EACH_ORDER
@EACH_SCOPE
def test_what_is_shown_tells_view_order_scope_and_selection(select: str, order: str, scope: str) -> None:
    with bench(select=select, dump_order=order, flags_scope=scope) as there:
        case = case_of(there)
        there.run(views.view(case))
        there.run(views.flags(case))
        _, last = controls(case.motor, case.scratch)
        there.run(controlled(case))
        there.run(views.select(case, last.project))
        known = {"read_view": "working", "dump_order": order, "flags_scope": scope, "select": select}
        assert case.found.known == known
        assert not any(there.simulated.store.flags.values())


@EACH_SELECT
@EACH_SCOPE
@pytest.mark.parametrize("pause", [0, 400, 1000])
def test_what_is_not_shown_is_told_by_a_run(select: str, scope: str, pause: int) -> None:
    with bench(select=select, read_view="stored", flags_scope=scope) as there:
        filled(there, pause)
        case = case_of(there)
        there.run(views.view(case))
        there.run(views.flags(case))
        assert case.found.known == {"flags_scope": scope}
        timing = there.run(controlled(case))
        assert timing is not None
        there.run(views.select_unseen(case, timing.offset, timing.clock))
        known = {"flags_scope": scope, "read_view": "stored", "select": select}
        told = {"dump_order": "little"} if select == "load" and pause else {}
        assert case.found.known == known | told


def filled(there: Bench, pause: int) -> None:
    """Let project 4 have a step with this pause (ms)."""
    base = Project(microsteps=8, step_angle=180, turn_distance=1600)
    there.simulated.put(4, with_steps(base, (Step(distance=5, speed=60, delay=pause),)))


def test_a_stored_pause_that_takes_too_long_leaves_the_question_open() -> None:
    with bench(select="load", read_view="stored") as there:
        filled(there, 60_000)
        case = case_of(there)
        there.run(views.view(case))
        timing = there.run(controlled(case))
        assert timing is not None
        there.run(views.select_unseen(case, timing.offset, timing.clock))
        assert "select" not in case.found.known
        assert "neither the pause" in case.found.profile().open["select"]


class Changing(Tampering):
    """Changes a byte of every dump of project 4 after so many of them."""

    def __init__(self, good: int) -> None:
        super().__init__()
        self.good = good

    def change(self, data: bytes, number: int) -> bytes:
        if len(data) != 226 or data[3] != 4:
            return data
        self.good -= 1
        return data if self.good >= 0 else data[:50] + bytes((data[50] ^ 0x5A,)) + data[51:]


def test_a_project_that_reads_neither_way_ends_it() -> None:
    with bench(line=Changing(2), read_view="stored") as there:
        case = case_of(there)
        with pytest.raises(VerificationFailed, match="reads neither as edited nor as before"):
            there.run(views.view(case))


def test_an_image_shows_a_project_whatever_its_flags_and_the_steps_behind_it_are() -> None:
    base = Project(number=4, microsteps=8, step_angle=180, turn_distance=1600)
    made = with_steps(base, (Step(distance=3),))
    other = with_steps(
        Project(number=4, microsteps=8, step_angle=180, turn_distance=1600, stop_mode=1, power_on_home=1),
        (Step(distance=3), Step(distance=9)),
    )
    image = bytearray(encode_image(other))
    assert not views.shows(bytes(image), made, "little")  # it has another number of steps
    image[1] = 1
    assert views.shows(bytes(image), made, "little")
    assert not views.shows(bytes(image), made, "big")
    assert not views.shows(BLANK, made, "little")
