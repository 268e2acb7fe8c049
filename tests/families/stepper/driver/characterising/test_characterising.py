"""A controller is characterised: what is said to be settled is so, however it is made, and nothing is left changed."""

from __future__ import annotations

from collections.abc import Callable, Generator
from random import Random
from typing import Any

import pytest

from motorbus.core.operation import INTENT, OUTCOME, Journal, Operation, Report
from motorbus.errors import Interrupted, LinkLost, RequestError
from motorbus.families.stepper.driver import Experiment, characterise, recover
from motorbus.families.stepper.driver.characterising import NOTE, VERB, likely_order
from motorbus.families.stepper.table import Project, Step, encode_image, with_steps
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.driver.characterising.studies import (
    STORES,
    as_before,
    furnished,
    hidden,
    made_up,
    node,
    wrong,
)

pytestmark = pytest.mark.soak

PARTS = 4
NOTICE = bytes.fromhex("EE DD")
HEAVY = 500
"""Exchanges, about, that one characterisation stands for where rounds are counted."""
READS = ("FF AA 3E", "FF AA 5E", "FF AA 03 0D")
"""How the requests begin that change nothing but to stop what runs."""


def studied(seed: int) -> None:
    chance = Random(seed)
    options = hidden(chance)
    with bench(pace=chance.random() < 0.5, **options) as there:
        furnished(there, chance)
        stored = dict(there.simulated.store.stored)
        here = node(chance.choice(("little", "big")))
        found = there.run(characterise(here, travel=1.0))
        assert not wrong(found, options), f"seed {seed}: {wrong(found, options)}"
        assert len(found.settled) >= 12, f"seed {seed}: {found.open}"
        assert options["ramp"] == found.settled["ramp"]
        assert (options["ramp"] == "time") is ("ramp_tick_ms" in found.settled)
        assert found.measured["turnaround"] == pytest.approx(options["turnaround"], abs=0.004)
        assert not [one for one in there.sent() if one.startswith(STORES)]
        assert as_before(there, stored), f"seed {seed}"


@pytest.mark.parametrize("part", range(PARTS))
def test_whatever_is_settled_is_so_and_nothing_is_left_changed(
    part: int, rounds: Callable[[int], int]
) -> None:
    for seed in range(part, max(PARTS, rounds(300 * HEAVY) // HEAVY), PARTS):
        studied(seed)


FAULTS: list[dict[str, Any]] = [
    {"notice_fault": "lost", "fault_every": 1},
    {"notice_fault": "lost", "fault_every": 2},
    {"notice_fault": "lost", "fault_every": 3},
    {"notice_fault": "lost", "fault_every": 7},
    {"notice_fault": "lost", "fault_every": 17},
    {"notice_fault": "late", "fault_every": 1, "fault_time": 0.3},
    {"notice_fault": "late", "fault_every": 3, "fault_time": 0.5},
    {"notice_fault": "doubled", "fault_every": 1},
    {"notice_fault": "early", "fault_every": 4},
    {"notice_fault": "inside_dump", "fault_every": 2},
    {"reply_fault": "lost", "fault_every": 4},
    {"reply_fault": "lost", "fault_every": 13},
    {"reply_fault": "unheard", "fault_every": 5},
    {"reply_fault": "late", "fault_every": 7, "fault_time": 0.1},
    {"reply_fault": "bit", "fault_every": 6},
    {"reply_fault": "other", "fault_every": 9},
    {"byte_errors": 1e-3},
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: " ".join(map(str, fault.values())))
def test_a_bad_line_leaves_questions_open_and_answers_none_wrong(fault: dict[str, Any]) -> None:
    chance = Random(str(fault))
    options = hidden(chance)
    with bench(**options) as there:
        furnished(there, chance)
        stored = dict(there.simulated.store.stored)
        there.simulated.switch(**fault)
        found = there.run(characterise(node()))
        assert not wrong(found, options)
        there.simulated.switch(notice_fault="none", reply_fault="none", byte_errors=0.0)
        assert as_before(there, stored)


def test_without_notices_nothing_that_takes_time_is_settled() -> None:
    with bench(notice_fault="lost", busy="silent") as there:
        found = there.device.characterise()
        assert set(found.settled) == {"read_view", "dump_order", "flags_scope"}
        assert "no time could be taken on this line" in found.open["ramp"]


def test_one_lost_notice_takes_away_what_rests_on_silence_and_no_more() -> None:
    with bench() as there:
        whole = there.device.characterise()
        last = sum(record.direction == "rx" and record.data == NOTICE for record in there._trace)
    with bench(notice_fault="lost", fault_every=last) as there:
        found = there.device.characterise()
    gone = set(whole.settled) - set(found.settled)
    assert {"notice_on_stop", "motor_stop_ends_project", "notice_on_once"} <= gone
    assert {"rounding", "seg_loop", "proj_loop", "zero_distance", "busy"} <= set(found.settled)
    assert "rests on something that did not come" in found.open["notice_on_stop"]


@pytest.mark.parametrize(
    ("wishes", "says"),
    [
        ({"scratch": 5}, "there is no project 5"),
        ({"scratch": 0}, "there is no project 0"),
        ({"travel": 0.4}, "travel: 0.4 turns"),
        ({"travel": float("nan")}, "travel: nan turns"),
        ({"travel": 1e3}, "travel: 1000.0 turns"),
    ],
)
def test_impossible_numbers_are_refused_and_nothing_is_sent(wishes: dict[str, Any], says: str) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match=says):
            there.device.characterise(**wishes)
        assert there.sent() == []


def test_it_is_refused_while_a_project_may_run_and_while_edits_would_be_lost() -> None:
    with bench() as there:
        there.device.memory.owed = True
        with pytest.raises(RequestError, match="a project that was started may still run"):
            there.device.characterise()
        there.device.memory.owed = False
        there.device.memory.unsaved = Project(number=2)
        with pytest.raises(RequestError, match="project 2 has edits that were not saved"):
            there.device.characterise()
        assert there.sent() == []


def test_a_controller_without_any_project_is_left_alone() -> None:
    with bench(shipped="empty") as there:
        with pytest.raises(RequestError, match="no project has steps"):
            there.device.characterise()
        assert all(one.startswith(READS) for one in there.sent())


def test_a_motor_that_no_project_tells_is_refused() -> None:
    with bench(shipped="empty") as there:
        there.simulated.put(1, with_steps(Project(microsteps=1, step_angle=255, turn_distance=1), (Step(),)))
        there.simulated.put(1, with_steps(Project(number=1, microsteps=65535, step_angle=7), (Step(),)))
        with pytest.raises(RequestError):
            there.device.characterise()
        assert all(one.startswith(READS) for one in there.sent())


def meddled(operation: Operation[Any], name: str, meddle: Callable[[], None]) -> Generator[Any, Any, Any]:
    """The same operation, with something done from outside when the experiment of this name begins."""
    value, error = None, None
    while True:
        try:
            step = operation.send(value) if error is None else operation.throw(error)
        except StopIteration as end:
            return end.value
        if isinstance(step, Report) and isinstance(step.event, Experiment) and step.event.name == name:
            meddle()
        value, error = None, None
        try:
            value = yield step
        except BaseException as raised:
            error = raised


def study(there: Bench, name: str, meddle: Callable[[], None]) -> Any:
    """Characterise; `Alone` is opened here, so that what is inside can be seen."""
    alone: Any = next(characterise(there.device))
    return there.run(meddled(alone.operation, name, meddle))


def test_a_stop_of_somebody_else_ends_it_and_all_is_put_back() -> None:
    with bench() as there:
        stored = dict(there.simulated.store.stored)

        def stop() -> None:
            there.device.memory.wanted += 1

        with pytest.raises(Interrupted) as ended:
            study(there, "started twice", stop)
        assert NOTE not in getattr(ended.value, "__notes__", ())
        assert as_before(there, stored)
        assert [one.state for one in there.events if isinstance(one, Journal)][-1] == OUTCOME


@pytest.mark.parametrize("name", ["loops", "distance 0", "single move", "ramp"])
def test_an_interruption_puts_everything_back(name: str) -> None:
    with bench() as there:
        stored = dict(there.simulated.store.stored)

        def interrupt() -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            study_interrupted(there, name, interrupt)
        assert as_before(there, stored)


def study_interrupted(there: Bench, name: str, interrupt: Callable[[], None]) -> None:
    """Interrupt it from the report of an experiment, as a listener that raises does."""
    told = there.bus.report

    def report(event: object) -> None:
        if told is not None:
            told(event)
        if isinstance(event, Experiment) and event.name == name:
            interrupt()

    there.bus.report = report
    there.device.characterise()


@pytest.mark.parametrize("name", ["loops", "distance 0", "single move", "ramp"])
def test_what_a_crash_leaves_is_put_back_from_the_journal(name: str) -> None:
    chance = Random(name)
    options = {"select": "relabel", "zero_distance": "endless"}
    with bench(**options) as there:
        there.simulated.put(1, made_up(chance, 1))
        stored = dict(there.simulated.store.stored)
        with pytest.raises(LinkLost) as lost:
            study(there, name, lambda: there.link.unplug(there.link.now() + 1.0))
        records = [one for one in there.events if isinstance(one, Journal)]
        assert [one.state for one in records][-1] == INTENT
        assert NOTE in lost.value.__notes__
        there.link.plug()
        there.run(recover(there.device, VERB, records[-1].facts))
        assert as_before(there, stored)


@pytest.mark.parametrize(
    "facts", [{}, {"project": 1, "image": "zz"}, {"node": 1, "what": "", "project": 9, "image": "00" * 220}]
)
def test_facts_of_something_else_are_refused(facts: dict[str, Any]) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="not the facts of a characterisation"):
            there.run(recover(there.device, VERB, facts))
        assert there.sent() == []


def test_an_order_of_bytes_is_believed_unless_the_other_makes_much_smaller_numbers() -> None:
    project = with_steps(
        Project(number=1, microsteps=8, step_angle=180, turn_distance=1600), (Step(distance=300),)
    )
    for real in ("little", "big"):
        image = encode_image(project, real)
        assert likely_order((image,), "little") == likely_order((image,), "big") == real
    assert likely_order((bytes(220),), "little") == "little"
    assert likely_order((bytes(220),), "big") == "big"
