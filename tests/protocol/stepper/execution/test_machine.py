"""What moves by hand: jog, one move, homing; and what the supply does."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour, Phase
from motorbus.families.stepper.table import Project
from tests.protocol.stepper.execution.course import Course, project, step

SLOW = project(step(start_frequency=100, acceleration=1), stop_mode=0)


@pytest.mark.parametrize("sign", [1, -1])
def test_jog_turns_until_it_is_stopped(sign: int) -> None:
    course = Course()("jog", project(), sign).wait(100.0)
    assert (course.state.phase, course.position) == (Phase.JOG, sign * 160_000)
    assert execution.due(course.state) == inf
    course("stop_motor")
    assert (course.state.phase, course.kinds) == (Phase.IDLE, ["rests"])


def test_jog_slows_down_when_the_stop_mode_says_so() -> None:
    course = Course()("jog", SLOW, 1).wait(10.0)("stop_motor")
    assert course.state.phase is Phase.RAMPDOWN
    assert course.to_the_end().now == pytest.approx(11.5)


def test_the_same_jog_again_changes_nothing() -> None:
    course = Course()("jog", project(), 1).wait(1.0)("jog", project(), 1)
    assert not course.accepted
    assert course.wait(1.0).position == 3200


def test_the_other_jog_turns_round() -> None:
    course = Course()("jog", project(), 1).wait(1.0)("jog", project(), -1)
    assert course.accepted
    assert course.wait(2.0).position == 1600 - 3200
    assert course.told == []


def test_the_other_jog_turns_round_when_it_has_slowed_down() -> None:
    course = Course()("jog", SLOW, 1).wait(10.0)("jog", SLOW, -1)
    there = course.wait(1.5).position
    assert course.state.phase is Phase.JOG
    assert course.wait(1.0).position < there


def test_the_other_jog_may_be_ignored() -> None:
    course = Course(jog_reverse_while_jogging="ignore")("jog", project(), 1).wait(1.0)("jog", project(), -1)
    assert not course.accepted
    assert course.wait(1.0).position == 3200


def test_without_a_speed_there_is_no_jog() -> None:
    """Project 1 has been cleared, and with it the speed of everything by hand."""
    for order in (("jog", Project(), 1), ("run_once", Project()), ("home", Project())):
        course = Course()(*order)
        assert (course.state.phase, course.position) == (Phase.IDLE, 0)
        assert course.accepted


@pytest.mark.parametrize("notice", [False, True])
def test_one_move_is_the_distance_of_step_1_and_nothing_else(notice: bool) -> None:
    made = project(step(direction=1, start_input=1, stop_input=2, output=4, delay=5000))
    course = Course((2,), notice_on_once=notice)("run_once", made).to_the_end()
    assert (course.position, course.now, course.state.outputs) == (-1600, 1.0, 0)
    assert course.kinds == ["rests", *(["completed"] if notice else [])]


def test_one_move_of_no_distance_may_be_without_an_end() -> None:
    assert Course(zero_distance="endless")("run_once", project(step(distance=0))).wait(2.0).position == 3200
    assert Course()("run_once", project(step(distance=0))).wait(2.0).position == 0


def test_homing_turns_in_reverse_until_input_5() -> None:
    course = Course()("home", project()).wait(2.5)
    assert (course.state.phase, course.position) == (Phase.HOMING, -4000)
    course("set_input", 1, True)("set_input", 5, True)
    assert (course.state.phase, course.position, course.state.homed) == (Phase.IDLE, 0, True)
    assert course.kinds == ["homed", "rests"]


def test_homing_never_ends_without_its_switch() -> None:
    course = Course()("home", project()).wait(86_400.0)
    assert course.state.phase is Phase.HOMING
    assert course("stop_motor").state.phase is Phase.IDLE
    assert not course.state.homed


@pytest.mark.parametrize("notice", [False, True])
def test_homing_on_the_switch_does_not_move_and_is_over_at_once(notice: bool) -> None:
    course = Course((5,), notice_on_once=notice)("home", project())
    assert (course.position, course.state.phase, course.state.homed) == (0, Phase.IDLE, False)
    assert course.kinds == ["rests", *(["completed"] if notice else [])]


def test_homing_may_slow_down_at_the_switch() -> None:
    course = Course(home_stop="mode", notice_on_once=True)("home", SLOW).wait(10.0)("set_input", 5, True)
    assert course.state.phase is Phase.RAMPDOWN
    course.to_the_end()
    assert course.kinds == ["homed", "rests", "completed"]
    assert course.position == 0


@pytest.mark.parametrize(("scope", "stops"), [("project", False), ("all", True)])
@pytest.mark.parametrize("order", [("jog", project(), 1), ("home", project()), ("run_once", project())])
def test_stop_project_and_what_moves_by_hand(scope: str, stops: bool, order: tuple[object, ...]) -> None:
    for stop in (("stop_project",), ("set_input", 4, True)):
        course = Course(stop_project_scope=scope)(str(order[0]), *order[1:]).wait(0.5)(*stop)
        assert (course.state.phase is Phase.IDLE) is stops


def test_a_second_stop_while_slowing_down_to_turn_round_is_final() -> None:
    course = Course()("jog", SLOW, 1).wait(10.0)("jog", SLOW, -1).wait(0.5)("stop_motor").to_the_end()
    assert course.state.phase is Phase.IDLE


@pytest.mark.parametrize("order", [("start", project()), ("run_once", project()), ("home", project())])
def test_what_starts_while_it_jogs_is_not_accepted(order: tuple[object, ...]) -> None:
    course = Course()("jog", project(), 1).wait(1.0)(str(order[0]), *order[1:])
    assert not course.accepted
    assert course.state.phase is Phase.JOG


def test_a_jog_while_a_project_runs_is_not_accepted() -> None:
    course = Course()("start", project())("jog", project(), 1)
    assert not course.accepted


# --- outputs, inputs, supply ---------------------------------------------------------------------------------------


def test_outputs_are_switched_by_command_at_any_time() -> None:
    course = Course()("start", project(step(output=1)))("set_output", 3, 1)("set_output", 5, 1)
    assert (course.state.outputs, course.state.leds) == (0b101, True)
    course("set_output", 1, 0)("set_output", 5, 0)
    assert (course.state.outputs, course.state.leds) == (0b100, False)
    assert course.to_the_end().position == 1600


def test_at_power_on_everything_rests() -> None:
    state = execution.power_on(5.0, base=70).state
    assert (state.phase, state.outputs, state.position(9.0), state.homed) == (Phase.IDLE, 0, 70, False)


def test_at_power_on_it_may_home() -> None:
    state = execution.power_on(5.0, home_with=project()).state
    assert state.phase is Phase.HOMING
    assert state.position(6.0) == -1600
    on_switch = execution.power_on(5.0, home_with=project(), inputs=frozenset({5})).state
    assert on_switch.phase is Phase.IDLE


def test_without_supply_nothing_turns_or_starts() -> None:
    course = Course()("start", project(step(output=4))).wait(0.5)("power_off")
    assert (course.state.phase, course.state.outputs, course.position) == (Phase.OFF, 0, 800)
    for order in (("start", project()), ("jog", project(), 1), ("home", project()), ("run_once", project())):
        course(*order)
        assert not course.accepted
    course("stop_motor")("stop_project")("set_input", 3, True, in3_project=project()).wait(10.0)
    assert (course.state.phase, course.position) == (Phase.OFF, 800)
    assert not course.state.busy


def test_a_moment_that_is_past_counts_as_the_latest() -> None:
    state = execution.start(execution.power_on(10.0).state, project(), 10.0).state
    stopped = execution.stop_project(state, 4.0).state
    assert stopped.since == 10.0
    assert stopped.position(10.0) == 0


def test_every_behaviour_has_a_source_and_a_help() -> None:
    for name, field in Behaviour.__dataclass_fields__.items():
        assert field.metadata["source"], name
        assert field.metadata["help"], name
