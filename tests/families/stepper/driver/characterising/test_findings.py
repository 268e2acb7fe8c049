"""What is known, what is doubted, and what of it is left in the end."""

from __future__ import annotations

from motorbus.families.stepper.driver.characterising.findings import UNTRIED, Case, Findings
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.program.profile import KNOWN
from motorbus.families.stepper.table import BLANK, Project, Step, encode_image, with_steps

MADE = with_steps(Project(number=1, microsteps=8, step_angle=180, turn_distance=1600), (Step(distance=1),))


def test_every_question_is_settled_or_says_why_not() -> None:
    profile = Findings().profile()
    assert (dict(profile.settled), set(profile.open)) == ({}, set(KNOWN))
    assert all(profile.open[name] == why for name, why in UNTRIED.items())
    assert profile.open["ramp"] == "the experiments did not get that far"


def test_an_answer_is_kept_with_its_evidence_and_no_reason_stands_beside_it() -> None:
    found = Findings()
    found.leave("ramp", "not yet")
    found.leave("ramp", "a second reason")
    assert found.profile().open["ramp"] == "not yet"
    found.settle("ramp", "time", "five moves")
    found.leave("ramp", "too late")
    profile = found.profile()
    assert (profile.settled["ramp"], profile.evidence["ramp"]) == ("time", "five moves")
    assert "ramp" not in profile.open


def test_one_doubt_takes_away_what_rests_on_silence_also_what_came_before_it() -> None:
    found = Findings()
    found.settle("busy", "silent", "no answer", silent=True)
    found.settle("rounding", "trunc", "a notice")
    assert set(found.profile().settled) == {"busy", "rounding"}
    assert found.firm == {"rounding": "trunc"}
    found.doubt("a notice was lost")
    found.doubt("a notice was lost")
    profile = found.profile()
    assert set(profile.settled) == {"rounding"}
    assert profile.open["busy"].endswith("(no answer), and on this line a notice was lost")
    assert found.doubts == ["a notice was lost"]
    assert set(profile.evidence) == set(profile.settled)


def test_what_was_measured_is_in_the_profile() -> None:
    found = Findings()
    found.measured["clock"] = 1.01
    assert found.profile().measured == {"clock": 1.01}


def stored(*filled: int) -> dict[int, bytes]:
    return {number: encode_image(MADE) if number in filled else BLANK for number in range(1, 5)}


def test_a_project_with_steps_is_the_other_one_where_there_is_one() -> None:
    assert Case(Node(), 4, 1.0, stored(1, 3), 1).other == 1
    assert Case(Node(), 1, 1.0, stored(1, 3), 1).other == 3
    assert Case(Node(), 1, 1.0, stored(1), 1).other == 2


def test_the_motor_is_read_again_when_the_order_of_bytes_is_known() -> None:
    image = {**stored(1), 1: encode_image(MADE, "big")}
    case = Case(Node(order="big"), 4, 1.0, image, 1)
    motor = case.motor
    assert motor.per_turn == 1600
    case.reads("big")
    assert case.motor is motor
    case.reads("little")
    assert case.node.order == "little"
    assert case.motor.microsteps == 0x0800


def test_it_is_seen_only_when_that_is_settled() -> None:
    case = Case(Node(), 4, 1.0, stored(1), 1)
    assert not case.seen
    case.found.settle("read_view", "working", "shown")
    assert case.seen
