"""A run over time, as data: it is the machine's, and its samples show every change."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import course, picture
from motorbus.families.stepper.table import Project, Step, decode_image
from tests.protocol.stepper.execution.course import project, step
from tests.protocol.stepper.vectors import DUMP_B

B = decode_image(DUMP_B[6:])


def test_an_operator_takes_his_time_at_every_wait() -> None:
    assert course(B, wait=0.0).seconds == pytest.approx(41.613525, abs=1e-6)
    found = course(B, wait=2.0)
    assert found.seconds == pytest.approx(41.613525 + 12, abs=1e-6)
    assert [one.kind for one in found.told].count("waits") == 6
    assert found.told[-1].kind == "completed"


def test_an_edge_is_made_too() -> None:
    assert course(B, Behaviour(start_input="edge"), wait=1.0).seconds == pytest.approx(47.613525, abs=1e-6)


def test_stretches_follow_one_another_without_a_gap() -> None:
    found = course(B, wait=0.5).stretches
    assert found[0].begin == 0
    assert all(one.end == other.begin for one, other in pairwise(found))
    assert {one.step for one in found} == {1, 2, 3}


def test_samples_show_what_the_machine_does() -> None:
    found = course(B, wait=1.0)
    columns = found.samples(500)
    lengths = {len(column) for column in columns.values()}
    assert len(lengths) == 1
    assert lengths.pop() >= 500
    assert columns["time"] == sorted(columns["time"])
    assert columns["time"][0] == 0
    assert columns["time"][-1] == found.seconds
    assert columns["pulses"][-1] == 3 * (12800 - 2 * 72721 + 2 * 56032)
    assert max(columns["hertz"]) == pytest.approx(32000)
    assert min(columns["hertz"]) == pytest.approx(-32000)
    assert set(columns["outputs"]) == {0, 1}
    assert [1] in columns["inputs"]
    assert {"waiting for an input", "moving", "pausing"} == set(columns["phase"])


def test_at_a_change_there_are_two_samples_of_one_moment() -> None:
    columns = course(project(step(delay=1000)), wait=0.0).samples(0)
    assert columns["time"] == [0.0, 1.0, 1.0, 2.0]
    assert columns["hertz"] == [1600, 1600, 0, 0]
    assert columns["phase"] == ["moving", "moving", "pausing", "pausing"]


def test_an_endless_project_is_cut_off_after_some_passes() -> None:
    assert course(project(project_loop=255), passes=3).seconds == pytest.approx(3.0)


def test_a_step_that_never_ends_is_refused() -> None:
    with pytest.raises(RequestError, match="step 1 never ends"):
        course(project(step(distance=0)), Behaviour(zero_distance="endless"))


def test_too_many_phases_are_refused() -> None:
    many = project(Step(delay=1), loop_first=1, loop_last=1, loop_count=254, project_loop=10)
    assert len(course(many).stretches) == 254 * 10
    assert len(course(many, most=2540).stretches) == 2540
    with pytest.raises(RequestError, match="more than 2539 phases"):
        course(many, most=2539)


def test_a_cleared_project_is_over_at_once() -> None:
    found = course(Project())
    assert (found.seconds, found.stretches) == (0.0, ())
    assert found.samples(10)["time"] == []
    assert [one.kind for one in found.told] == ["ended", "completed"]


def test_the_readings_are_those_of_the_machine() -> None:
    how = Behaviour(seg_loop="extra")
    orders = [one.step for one in course(B, how, wait=0.0).told if one.kind == "begins"]
    assert orders == [place.step for place in execution.one_pass(B, how)] * 3


# --- what one draws of it ------------------------------------------------------------------------------------------


def test_a_picture_has_units_people_read() -> None:
    run = course(B, wait=1.0)
    in_turns = picture(run, B)
    assert list(in_turns.curves) == ["position (turns)", "speed (rpm)"]
    assert in_turns.curves["position (turns)"][-1] == pytest.approx(-61734 / 6400)
    assert max(in_turns.curves["speed (rpm)"]) == pytest.approx(300)
    in_mm = picture(run, B, lead=Fraction(5))
    assert in_mm.curves["position (mm)"][-1] == pytest.approx(-61734 / 6400 * 5)


def test_there_is_a_lane_for_all_that_a_step_mentions() -> None:
    said = project(step(output=6, stop_input=5), step(output=8), step(output=3, start_input=2), total_steps=2)
    assert list(picture(course(said), said).lanes) == ["output 2", "input 5"]


def test_lanes_have_the_names_of_the_file_and_others_that_nothing_mentions_are_left_out() -> None:
    run = course(B, wait=1.0)
    assert list(picture(run, B).lanes) == ["output 1", "input 1", "input 2"]
    named = picture(run, B, inputs={"tray": 1, "part": 2}, outputs={"gripper": 1, "lamp": 3})
    assert list(named.lanes) == ["gripper", "lamp", "tray", "part"]
    assert any(named.lanes["gripper"])
    assert not any(named.lanes["part"])
    assert {len(lane) for lane in named.lanes.values()} == {len(named.times)}


def test_spans_are_the_steps_and_their_waits() -> None:
    spans = picture(course(B, wait=1.0), B).spans
    assert [name for _, _, name, _ in spans] == ["1", "wait", "2", "3", "wait", "2", "3"] * 3
    assert [waiting for _, _, _, waiting in spans[:3]] == [False, True, False]
    assert all(one[1] == other[0] for one, other in pairwise(spans))


@pytest.mark.parametrize("wait", [0.0, 0.05])
def test_a_hand_that_is_still_on_the_input_lets_go_before_it_presses_again(wait: float) -> None:
    nothing = project(step(distance=0, start_input=1), project_loop=3)
    found = course(nothing, Behaviour(start_input="edge"), wait=wait)
    assert [one.kind for one in found.told].count("waits") == 3
    assert found.told[-1].kind == "completed"
