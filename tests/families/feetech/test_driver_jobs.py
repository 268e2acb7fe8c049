"""A change as plain data: what goes into the journal comes back out, and nothing else is taken for one."""

from __future__ import annotations

import json
from typing import Any

import pytest

from motorbus.core.family import Readdressed
from motorbus.core.operation import INTENT, OUTCOME, Effect, Journal, Report
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.jobs import (
    SET_BAUD,
    SET_ID,
    WRITING,
    WRITTEN,
    Course,
    Job,
    Place,
    elsewhere,
    job_of,
)
from tests.families.feetech.driver_script import image, watch

ID = Job(SET_ID, Place(3, 1_000_000), Place(7, 1_000_000), image(3), (4, 9))
BAUD = Job(SET_BAUD, Place(3, 1_000_000), Place(3, 500_000), image(3))


@pytest.mark.parametrize("job", [ID, BAUD])
def test_it_survives_a_file(job: Job) -> None:
    assert job_of(job.verb, json.loads(json.dumps(job.facts()))) == job


def test_it_knows_the_cell_the_lock_and_what_to_expect() -> None:
    assert (ID.cell, ID.lock, ID.value(ID.new), ID.expected(ID.new)) == (5, 55, 7, image(7))
    assert (BAUD.cell, BAUD.value(BAUD.new), BAUD.expected(BAUD.new)) == (6, 1, image(3, at_6=1))
    assert ID.block(ID.new).data == b"\7"
    assert ID.block(ID.new).effect is Effect.IDENTITY
    assert not ID.block(ID.new).repeatable


def test_it_knows_its_servo_again_wherever_it_is() -> None:
    assert ID.is_it(image(1, at_6=4))
    assert not ID.is_it(image(3, at_13=60))
    assert ID.is_like_it(image(3, at_13=60))
    assert not ID.is_like_it(image(3, at_1=9))


@pytest.mark.parametrize(
    "change",
    [
        {"node": 254},
        {"node": None},
        {"new": 300},
        {"rate": 12},
        {"registers": "00"},
        {"registers": "xyz"},
        {"registers": "09" * 40},
        {"others": 3},
    ],
)
def test_what_is_no_such_change_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(RequestError):
        job_of(SET_BAUD, {**BAUD.facts(), **change})


def test_another_verb_and_missing_facts_are_refused() -> None:
    with pytest.raises(RequestError, match="not the facts of a change"):
        job_of("set_torque", ID.facts())
    with pytest.raises(RequestError):
        job_of(SET_ID, {})


def test_its_course_is_recorded_and_the_facts_once() -> None:
    course = Course(ID)
    played = [
        *watch(course.reach(INTENT)).events,
        *watch(course.reach(WRITING, ID.new)).events,
        *watch(course.end("new")).events,
    ]
    assert played == [
        Readdressed(3, 7),
        Journal(SET_ID, INTENT, ID.facts()),
        Journal(SET_ID, "writing 7", {}),
        Journal(SET_ID, OUTCOME, {"outcome": "new", "node": 3, "new": 7, "new_rate": 1_000_000}),
    ]
    assert course.reached == [INTENT, "writing 7", OUTCOME]


@pytest.mark.parametrize(
    ("reached", "at_new", "at_old"),
    [
        ([INTENT], False, False),
        ([INTENT, f"{WRITING} 7"], True, False),
        ([INTENT, f"{WRITING} 7", f"{WRITTEN} 7"], False, False),
        ([INTENT, f"{WRITING} 7", f"{WRITING} 3"], False, True),
    ],
)
def test_a_value_that_may_have_met_a_closed_lock_is_doubtful(
    reached: list[str], at_new: bool, at_old: bool
) -> None:
    course = Course(ID, reached)
    assert (course.doubtful(ID.new), course.doubtful(ID.old)) == (at_new, at_old)


def test_a_value_as_shipped_may_stand_for_a_torn_one() -> None:
    from_one = ID._replace(old=Place(1, 1_000_000), image=image(1))
    assert Course(from_one, [INTENT, f"{WRITING} 7"]).doubtful(from_one.old)
    assert Course(BAUD, [INTENT, f"{WRITING} 1"]).doubtful(BAUD.old)


def test_other_places_are_all_but_the_two() -> None:
    assert list(elsewhere(ID, [3, 1, 3], [1_000_000, 500_000, 1_000_000])) == [
        Place(1, 1_000_000),
        Place(3, 500_000),
        Place(1, 500_000),
    ]


HLS = Job(
    SET_ID, Place(3, 1_000_000), Place(7, 1_000_000), image(3, at_0=3, at_1=43, at_3=10, at_4=12, at_7=3)
)


def test_a_second_id_that_is_the_old_one_goes_along() -> None:
    assert HLS.table.name == "hls"
    assert HLS.second == 7
    assert HLS._replace(image=HLS.image[:7] + b"\x14" + HLS.image[8:]).second is None
    assert HLS._replace(verb=SET_BAUD, new=Place(3, 500_000)).second is None
    assert ID.second is None


@pytest.mark.parametrize("second", [3, 7, 255])
def test_it_is_known_again_and_seen_whatever_its_second_id_is_by_now(second: int) -> None:
    there = bytes((*HLS.expected(HLS.new)[:7], second, *HLS.image[8:]))
    assert HLS.is_it(there)
    assert HLS.is_at(HLS.new, there)
    assert not HLS.is_at(HLS.old, there)
    assert not HLS.is_at(HLS.new, there[:13] + b"\x3c" + there[14:])


def test_where_nothing_goes_along_every_register_counts() -> None:
    assert ID.is_at(ID.new, image(7))
    assert not ID.is_at(ID.new, image(7, at_7=3))
    assert not ID.is_at(ID.new, b"")
    assert not ID.is_it(image(7, at_7=3))


def test_a_state_counts_as_reached_before_it_is_recorded() -> None:
    """Whoever is interrupted by the recording itself must find that something has begun."""
    course = Course(ID)
    recording = (step for step in course.reach(INTENT) if _records(step))
    assert next(recording)
    assert course.reached == [INTENT]
    next(course.end("old"))
    assert course.reached == [INTENT, OUTCOME]


def test_a_second_id_may_have_been_written() -> None:
    assert not Course(HLS, [INTENT, "writing 7"]).following
    assert Course(HLS, [INTENT, "writing 7", "written 7", "second 7"]).following


def _records(step: object) -> bool:
    return isinstance(step, Report) and isinstance(step.event, Journal)
