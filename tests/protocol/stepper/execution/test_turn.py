"""How a project goes: waits, outputs and motion together, pauses, loops, what ends it, and every reading of that."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest

from motorbus.families.stepper import execution, wire
from motorbus.families.stepper.execution import Behaviour, Phase
from motorbus.families.stepper.table import Project, Step, decode_image, with_steps
from tests.protocol.stepper.execution import exact
from tests.protocol.stepper.execution.course import Course, project, step
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

ORDINARY = ["begins", "moved", "ended", "completed"]


def test_a_step_moves_pauses_and_the_project_has_ended() -> None:
    course = Course()("start", project(step(delay=500))).to_the_end()
    assert course.kinds == ORDINARY
    assert (course.at("begins"), course.at("moved"), course.at("completed")) == ([0.0], [1.0], [1.5])
    assert course.state.phase is Phase.IDLE
    assert course.position == 1600


def test_nothing_depends_on_how_often_somebody_looks() -> None:
    made = project(step(delay=300), step(direction=1, distance=800), project_loop=3)
    once = Course()("start", made).wait(60.0)
    often = Course()("start", made)
    for _ in range(600):
        often.wait(0.1)
    assert often.told == once.told
    assert often.position == once.position == 3 * 800


@pytest.mark.parametrize(
    ("seconds", "position", "hertz"), [(0.0, 0, -1600), (0.25, -400, -1600), (1.0, -1600, 0)]
)
def test_where_it_is_can_be_asked_at_any_moment(seconds: float, position: int, hertz: float) -> None:
    course = Course()("start", project(step(direction=1))).wait(seconds)
    assert course.position == position
    assert course.state.frequency(course.now) == hertz


def test_dump_a_takes_as_long_as_its_move_and_its_pause() -> None:
    course = Course()("start", decode_image(DUMP_A[6:])).to_the_end()
    assert course.at("completed") == [pytest.approx(0.685587 + 1.0, abs=1e-6)]
    assert course.position == -1600


def test_dump_b_takes_three_passes_of_fifteen_steps() -> None:
    made = decode_image(wire.decode_dump(DUMP_B, 2).image)
    course = Course((1,))("start", made).to_the_end()
    assert [one.step for one in course.told if one.kind == "begins"] == [1, 2, 3, 2, 3] * 3
    assert course.at("completed") == [pytest.approx(41.613525, abs=1e-6)]
    assert course.position == 3 * (12800 - 2 * 72721 + 2 * 56032)
    by_pulse = Course((1,), ramp="pulse")("start", made).to_the_end()
    expected = 3 * (2.055190 + 0.5 + 2 * (2.359536 + 1.838004 + 1.0))
    assert by_pulse.at("completed") == [pytest.approx(expected, abs=1e-5)]


def test_dump_b_waits_for_the_operator_six_times() -> None:
    course = Course()("start", decode_image(DUMP_B[6:]))
    for _ in range(6):
        course.wait(30.0)
        assert course.state.phase is Phase.WAIT
        course("set_input", 1, True).wait(0.1)("set_input", 1, False)
    course.to_the_end()
    assert course.kinds.count("waits") == 6
    assert course.kinds[-2:] == ["ended", "completed"]


def random_project(random: Random) -> dict[str, Any]:
    total = random.randint(1, 10)
    first = random.randint(1, total)
    return {
        "microsteps": random.choice((1, 2, 4, 8, 16)),
        "step_angle": random.choice((90, 180, 75, 7)),
        "turn_distance": random.randint(1, 6000),
        "loop": random.choice([(0, 0, 0), (first, random.randint(first, total), random.randint(1, 20))]),
        "project_loop": random.randint(0, 5),
        "steps": [
            {
                "distance": random.randint(0, 400),
                "direction": random.randint(0, 1),
                "start_frequency": random.randint(0, 900),
                "acceleration": random.choice((0, 1, 30, 100)),
                "speed": random.choice((0, 1, 60, 300, 1200)),
                "delay": random.choice((0, 0, 7, 1000)),
            }
            for _ in range(total)
        ],
    }


def made_of(plain: dict[str, Any]) -> Project:
    first, last, count = plain["loop"]
    base = Project(
        number=1, microsteps=plain["microsteps"], step_angle=plain["step_angle"],
        turn_distance=plain["turn_distance"], loop_first=first, loop_last=last, loop_count=count,
        project_loop=plain["project_loop"],
    )  # fmt: skip
    return with_steps(base, tuple(Step(**one) for one in plain["steps"]))


@pytest.mark.parametrize("ramp", ["time", "pulse"])
def test_three_hundred_projects_take_exactly_as_long_as_reckoned_by_hand(ramp: str) -> None:
    random = Random(7)
    done = 0
    while done < 300:
        plain = random_project(random)
        geometry = plain["turn_distance"], plain["microsteps"], plain["step_angle"]
        counts = [exact.pulses_of(one["distance"], *geometry) for one in plain["steps"]]
        if ramp == "pulse" and sum(counts) > 1500:  # the reckoning adds up every pulse
            plain["turn_distance"] = geometry[0] * (1 + sum(counts) // 1500)
        done += 1
        course = Course(ramp=ramp)("start", made_of(plain)).to_the_end()
        assert course.kinds[-1] == "completed"
        wanted = float(exact.time_of(plain, ramp == "pulse"))
        fastest = max(float(exact.running(one["speed"], *geometry[1:])) for one in plain["steps"])
        assert abs(course.now - wanted) <= 1 / max(fastest, 1.0), plain
        assert course.now == pytest.approx(wanted, rel=1e-9, abs=1e-9)


# --- inputs ------------------------------------------------------------------------------------------------------


def test_outputs_come_with_the_motion_and_not_with_the_wait() -> None:
    course = Course()("start", project(step(start_input=1, output=1)))
    assert course.wait(5.0).state.outputs == 0
    course("set_input", 1, True)
    assert (course.state.phase, course.state.outputs) == (Phase.MOVE, 1)


@pytest.mark.parametrize(("sensing", "waits"), [("level", False), ("edge", True)])
def test_an_input_that_is_active_already(sensing: str, waits: bool) -> None:
    course = Course((2,), start_input=sensing)("start", project(step(start_input=2)))
    assert (course.state.phase is Phase.WAIT) is waits
    course.wait(1.0)("set_input", 2, False)("set_input", 2, True)
    assert course.state.phase is (Phase.MOVE if waits else Phase.IDLE)


def test_another_input_does_not_begin_a_step() -> None:
    course = Course()("start", project(step(start_input=2)))("set_input", 1, True)
    assert course.wait(9.0).state.phase is Phase.WAIT


def test_a_stop_input_ends_the_motion_of_its_step_at_once_and_the_pause_follows() -> None:
    course = Course()("start", project(step(stop_input=2, delay=1000), step(direction=1)))
    course.wait(0.5)("set_input", 2, True)
    assert (course.state.phase, course.position) == (Phase.DWELL, 800)
    course.to_the_end()
    assert course.at("moved") == [0.5, 2.5]
    assert course.position == -800


def test_a_stop_input_that_is_active_already_lets_no_pulse_out() -> None:
    course = Course((5,))("start", project(step(stop_input=5, output=1))).to_the_end()
    assert (course.position, course.now, course.state.outputs) == (0, 0.0, 1)
    assert course.kinds == ORDINARY


def test_a_stop_input_may_heed_the_stop_mode() -> None:
    ramped = step(stop_input=1, start_frequency=100, acceleration=1, distance=16000, delay=1000)
    course = Course(stop_input="mode")("start", project(ramped, stop_mode=0)).wait(5.0)("set_input", 1, True)
    assert course.state.phase is Phase.RAMPDOWN
    course.to_the_end()
    assert course.at("moved") == [pytest.approx(5.0 + 1.5)]
    assert course.at("completed") == [pytest.approx(5.0 + 1.5 + 1.0)]


@pytest.mark.parametrize("notice", [False, True])
def test_a_stop_input_may_end_the_project(notice: bool) -> None:
    course = Course(stop_input_scope="project", notice_on_stop=notice)(
        "start", project(step(stop_input=1), step())
    )
    course.wait(0.25)("set_input", 1, True)
    assert course.state.phase is Phase.IDLE
    assert course.kinds == ["begins", "stopped", *(["completed"] if notice else [])]
    assert course.position == 400


def test_input_3_starts_and_input_4_stops() -> None:
    course = Course()("set_input", 3, True, in3_project=project()).wait(0.5)("set_input", 4, True)
    assert course.kinds == ["begins", "stopped"]
    assert course.position == 800
    again = Course()("set_input", 3, True)
    assert again.told == []  # nothing is selected


@pytest.mark.parametrize("notice", [False, True])
def test_whether_a_project_that_input_3_started_tells_its_end(notice: bool) -> None:
    course = Course(notice_on_in3=notice)("set_input", 3, True, in3_project=project()).to_the_end()
    assert course.kinds == ["begins", "moved", "ended", *(["completed"] if notice else [])]


# --- loops and ends ------------------------------------------------------------------------------------------------


def test_an_endless_project_never_tells_its_end() -> None:
    course = Course()("start", project(step(delay=0), project_loop=255)).wait(3600.5)
    assert set(course.kinds) == {"begins", "moved"}
    assert course.position == 3600 * 1600 + 800
    course("stop_project")
    assert course.kinds[-1] == "stopped"


def test_an_endless_project_in_which_nothing_takes_time_does_not_hang() -> None:
    course = Course()("start", project(Step(), Step(output=1), project_loop=255)).wait(0.01)
    assert course.kinds.count("begins") == pytest.approx(20, abs=4)
    assert course.state.busy


def test_many_steps_that_take_no_time_do_not_nest() -> None:
    made = project(Step(), Step(), loop_first=1, loop_last=2, loop_count=254, project_loop=5)
    course = Course()("start", made)
    assert course.kinds.count("begins") == 2 * 254 * 5
    assert course.kinds[-1] == "completed"
    assert course.now == 0


@pytest.mark.parametrize("notice", [True, False])
def test_a_cleared_project_ends_when_it_begins(notice: bool) -> None:
    course = Course(clear_notice=notice)("start", Project())
    assert course.kinds == ["ended", *(["completed"] if notice else [])]
    assert course.state.phase is Phase.IDLE


def test_distance_zero_moves_nothing_and_does_all_the_rest() -> None:
    course = Course()("start", project(step(distance=0, output=4, delay=250))).to_the_end()
    assert (course.now, course.position, course.state.outputs) == (0.25, 0, 7)


def test_distance_zero_may_be_without_an_end() -> None:
    course = Course(zero_distance="endless")("start", project(step(distance=0))).wait(100.0)
    assert course.position == 160_000
    assert course("stop_project").state.phase is Phase.IDLE


@pytest.mark.parametrize(("reading", "outputs"), [("keep", 0b111), ("off", 0)])
def test_what_output_action_zero_does(reading: str, outputs: int) -> None:
    course = Course(output_zero=reading)("set_output", 4, 1)("start", project(step(output=0)))
    assert course.state.outputs == outputs


@pytest.mark.parametrize(("reading", "outputs"), [("hold", 0b010), ("off", 0)])
def test_what_becomes_of_outputs_at_the_end(reading: str, outputs: int) -> None:
    course = Course(outputs_on_stop=reading)("start", project(step(output=2))).to_the_end()
    assert course.state.outputs == outputs
    stopped = Course(outputs_on_stop=reading)("start", project(step(output=2)))("stop_project")
    assert stopped.state.outputs == outputs


def test_another_reading_of_the_counts_runs_once_more() -> None:
    made = project(step(), step(), loop_first=2, loop_last=2, loop_count=2, project_loop=2)
    assert Course()("start", made).to_the_end().position == 2 * 3 * 1600
    assert Course(seg_loop="extra", proj_loop="extra")("start", made).to_the_end().position == 3 * 4 * 1600


@pytest.mark.parametrize(("rounding", "position"), [("trunc", 100), ("nearest", 200), ("carry", 150)])
def test_pulses_that_are_not_whole_over_many_passes(rounding: str, position: int) -> None:
    made = project(Step(distance=3, speed=60, start_frequency=9999), turn_distance=3200, project_loop=100)
    assert Course(rounding=rounding)("start", made).to_the_end().position == position


# --- stops -----------------------------------------------------------------------------------------------------------

RAMPED = step(start_frequency=100, acceleration=1, distance=16000)


def test_a_slow_stop_ramps_down_and_the_project_is_over_then() -> None:
    course = Course()("start", project(RAMPED, stop_mode=0)).wait(5.0)("stop_project")
    assert (course.state.phase, course.state.busy) == (Phase.RAMPDOWN, True)
    course.to_the_end()
    assert course.at("stopped") == [pytest.approx(6.5)]
    assert "completed" not in course.kinds


@pytest.mark.parametrize("order", ["stop_project", "stop_motor"])
def test_neither_another_stop_nor_another_mode_makes_a_ramp_shorter(order: str) -> None:
    course = Course()("start", project(RAMPED, stop_mode=0)).wait(5.0)("stop_project").wait(0.5)
    course.state = execution.set_stop_mode(course.state, 1).state
    course(order)
    assert course.state.phase is Phase.RAMPDOWN
    course.to_the_end()
    assert course.at("stopped") == [pytest.approx(6.5)]


@pytest.mark.parametrize("order", ["stop_project", "stop_motor"])
@pytest.mark.parametrize("seconds", [0.5, 1.2])
def test_an_immediate_stop_ends_the_project_wherever_it_is(order: str, seconds: float) -> None:
    course = Course()("start", project(step(delay=1000), step())).wait(seconds)(order)
    assert course.kinds[-1] == "stopped"
    assert course.state.phase is Phase.IDLE


def test_a_stop_reaches_a_project_that_waits() -> None:
    course = Course()("start", project(step(start_input=1), stop_mode=0)).wait(9.0)("stop_project")
    assert course.kinds == ["waits", "stopped"]


def test_stop_motor_may_end_the_motion_of_the_step_only() -> None:
    course = Course(motor_stop_ends_project=False)("start", project(step(delay=1000), step(direction=1)))
    course.wait(0.25)("stop_motor")
    assert course.state.phase is Phase.DWELL
    course("stop_motor")  # nothing turns, so nothing is stopped
    course.to_the_end()
    assert course.kinds[-1] == "completed"
    assert course.position == 400 - 1600


def test_a_stop_while_slowing_down_for_a_stop_input_ends_the_project() -> None:
    slow = Step(**{**{n: getattr(RAMPED, n) for n in Step.__dataclass_fields__}, "stop_input": 1})
    course = Course(stop_input="mode")("start", project(slow, step(), stop_mode=0)).wait(5.0)
    course("set_input", 1, True).wait(0.5)("stop_project").to_the_end()
    assert course.kinds == ["begins", "stopped"]


@pytest.mark.parametrize(
    ("notice", "kinds"), [(False, ["begins", "stopped"]), (True, ["begins", "stopped", "completed"])]
)
def test_whether_a_stop_is_told_like_an_end(notice: bool, kinds: list[str]) -> None:
    assert Course(notice_on_stop=notice)("start", project()).wait(0.1)("stop_project").kinds == kinds


@pytest.mark.parametrize(("scope", "phase"), [("project", Phase.IDLE), ("device", Phase.RAMPDOWN)])
def test_whose_stop_mode_holds(scope: str, phase: Phase) -> None:
    course = Course(flags_scope=scope)("start", project(RAMPED, stop_mode=1)).wait(5.0)("stop_project")
    assert course.state.phase is phase  # the device's own is slow


# --- starts while something runs ---------------------------------------------------------------------------------


@pytest.mark.parametrize("busy", ["ignore", "silent"])
def test_a_start_while_a_project_runs_is_not_accepted(busy: str) -> None:
    course = Course(busy=busy)("start", project()).wait(0.5)("start", project(step(direction=1)))
    assert not course.accepted
    assert course.to_the_end().position == 1600


def test_a_start_may_begin_anew() -> None:
    course = Course(busy="restart")("start", project()).wait(0.5)("start", project(step(direction=1)))
    assert course.accepted
    assert course.to_the_end().position == 800 - 1600


def test_behaviour_is_kept() -> None:
    how = Behaviour(ramp="pulse")
    assert execution.power_on(0.0, how).state.how is how
