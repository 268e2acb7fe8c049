"""The model of a running controller: ramps against exact arithmetic, order, and what happens when."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import inf
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.families.stepper.execution import ramp
from motorbus.families.stepper.execution.machine import Machine, Phase
from motorbus.families.stepper.execution.ramp import Ramp
from motorbus.families.stepper.parameters import Project, Step, decode_image, with_steps
from motorbus.families.stepper.program.estimate import earliest_end
from tests.protocol.stepper import exact
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B, behaviour

# one turn in one second, 1600 pulses at 1600 Hz without a ramp
TURN = Step(distance=1600, speed=60, start_frequency=1600)
RAMPED = Step(distance=16000, speed=60, start_frequency=100, acceleration=1)
GEOMETRY = Project(number=1, microsteps=8, step_angle=180, turn_distance=1600, stop_mode=1)
SLOW = {"stop_mode": 0}


def project(*steps: Step, **values: Any) -> Project:
    return replace(with_steps(GEOMETRY, steps or (TURN,)), **values)


# -- one move ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("vector", behaviour("motion"), ids=lambda v: f"{v['distance']}-{v['speed']}rpm")
def test_a_known_move_has_its_pulses_and_its_duration(vector: dict[str, Any]) -> None:
    made = Project(**{name: vector[name] for name in ("microsteps", "step_angle", "turn_distance")})
    step = Step(**{name: vector[name] for name in ("distance", "start_frequency", "acceleration", "speed")})
    pulses, speed = ramp.pulses_of(made, step), ramp.ramp_of(made, step)
    assert pulses == vector["pulses"]
    assert speed.run == pytest.approx(vector["frequency"], abs=5e-4)
    assert ramp.move_of(made, step).duration == pytest.approx(vector["time"], abs=6e-7)
    if vector["peak"]:
        assert ramp.motion(speed, pulses, 1).peak == pytest.approx(vector["peak"], abs=5e-3)


@st.composite
def moves(draw: st.DrawFn) -> tuple[int, int, int, Fraction]:
    """Pulses, start, acceleration (Hz) and running frequency."""
    run = Fraction(draw(st.integers(0, 60_000)), draw(st.integers(1, 9)))
    return draw(st.integers(0, 3000)), draw(st.integers(0, 2000)), draw(st.integers(0, 500)), run


@given(moves())
def test_durations_are_those_of_exact_arithmetic(move: tuple[int, int, int, Fraction]) -> None:
    pulses, start, growth, run = move
    speed = Ramp(float(max(start, 1)), float(run), growth * 1000.0)
    wanted = float(exact.straight_time(pulses, start, Fraction(growth * 1000), run))
    assert ramp.motion(speed, pulses, 1).duration == pytest.approx(wanted, rel=1e-9)


@given(moves(), st.floats(0, 1))
def test_pulses_only_grow_and_a_slow_stop_is_never_longer(
    move: tuple[int, int, int, Fraction], share: float
) -> None:
    pulses, start, growth, run = move
    made = ramp.motion(Ramp(float(max(start, 1)), float(run), growth * 1000.0), pulses, 1)
    counts = [made.done(made.duration * n / 40) for n in range(41)]
    assert counts == sorted(counts)
    assert counts[-1] == made.done(made.duration + 1) == (pulses if run else 0)
    assert all(0 <= made.frequency(made.duration * n / 40) <= made.peak + 1e-6 for n in range(41))
    moment = made.duration * share
    slow = made.slowing(moment)
    if slow is not None:
        assert made.done(moment) + (slow.pulses or 0) <= pulses
        assert slow.duration <= made.duration - moment + 1e-6 + 1 / made.peak


def test_a_slow_stop_goes_down_to_the_start_frequency() -> None:
    made = ramp.motion(Ramp(50.0, 8000.0, 30_000.0), 8000, 1)
    slow = made.slowing(0.6)
    assert slow is not None
    assert slow.duration == pytest.approx((8000 - 50) / 30_000)
    assert slow.pulses == int((8000**2 - 50**2) / 60_000)
    assert ramp.motion(Ramp(500.0, 50.0, 30_000.0), 100, 1).slowing(1.0) is None


@pytest.mark.parametrize("pulses", [None, 1, 100, 8000])
def test_the_moment_of_a_pulse(pulses: int | None) -> None:
    made = ramp.motion(Ramp(50.0, 8000.0, 30_000.0), pulses, -1)
    for count in (1, 2, 50, 99, 100, 4000, 8000, 20_000):
        moment = made.moment(count)
        if pulses is not None and count > pulses:
            assert moment == inf
        else:
            assert made.done(moment) >= count > made.done(moment * (1 - 1e-6))
    assert (made.moment(0), made.sign) == (0, -1)


def test_the_tick_of_the_ramp_scales_move_and_stop() -> None:
    made = project(replace(RAMPED, distance=32000), stop_mode=0)
    step = made.step(1)
    assert ramp.move_of(made, step, 10.0).duration == pytest.approx(2 * 15 + (32000 - 25500) / 1600)
    assert ramp.stop_seconds(made, step, 10.0) == pytest.approx(15.0)  # 1500 Hz by 1 Hz in 10 ms
    assert ramp.stop_seconds(replace(made, stop_mode=1), step, 10.0) == 0


# -- order ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("vector", behaviour("order"), ids=lambda v: f"{v['total_steps']}-{v['loop']}")
def test_a_known_order(vector: dict[str, Any]) -> None:
    first, last, count = vector["loop"]
    made = Project(
        total_steps=vector["total_steps"], loop_first=first, loop_last=last, loop_count=count,
        project_loop=vector["project_loop"],
    )  # fmt: skip
    assert [place.step for place in made.one_pass()] == vector["order"]
    assert made.passes == vector["passes"]
    assert [made.times(n) for n in range(1, 11)] == [vector["order"].count(n) for n in range(1, 11)]


def test_no_project_ends_before_all_its_pauses_and_pulses() -> None:
    made = project(replace(TURN, delay=500), replace(TURN, stop_input=1, delay=100), project_loop=3)
    assert earliest_end(made) == pytest.approx(3 * (1599 / 1600 + 0.5 + 0.1))
    assert earliest_end(replace(made, project_loop=255)) == inf


# -- a project -----------------------------------------------------------------------------------------


def test_a_step_moves_and_pauses_and_the_project_has_ended() -> None:
    machine = Machine()
    machine.start(project(replace(TURN, delay=500)), 0.0)
    machine.advance(1.0)
    assert machine.phase is Phase.PAUSE
    machine.advance(9.0)
    assert machine.notices == [1.5]
    assert (machine.phase, machine.position(9.0), machine.until) == (Phase.IDLE, 1600, inf)


def test_nothing_depends_on_how_often_time_is_advanced() -> None:
    made = project(replace(TURN, delay=300), replace(TURN, direction=1, distance=800), project_loop=3)
    once, often = Machine(), Machine()
    once.start(made, 0.0)
    often.start(made, 0.0)
    for n in range(600):
        often.advance(n / 10)
    once.advance(60.0)
    assert often.notices == once.notices == [pytest.approx(3 * (1.0 + 0.3 + 0.5))]
    assert often.position(60.0) == once.position(60.0) == 3 * 800


def test_position_and_frequency_at_any_moment() -> None:
    machine = Machine()
    machine.start(project(replace(TURN, direction=1)), 0.0)
    assert (machine.position(0.25), machine.frequency(0.25)) == (-400, -1600)
    assert (machine.position(1.0), machine.frequency(1.0)) == (-1600, 0)


@pytest.mark.parametrize(("dump", "seconds"), [(DUMP_A, 1.685587), (DUMP_B, 41.613525)])
def test_a_known_project_takes_its_time(dump: bytes, seconds: float) -> None:
    machine = Machine()
    machine.set_input(1, True, 0.0)
    machine.start(decode_image(dump[6:]), 0.0)
    machine.advance(100.0)
    assert machine.notices == [pytest.approx(seconds, abs=1e-6)]


def test_three_hundred_projects_take_exactly_their_time() -> None:
    random = Random(7)
    for _ in range(300):
        plain = random_project(random)
        first, last, count = plain["loop"]
        base = {name: plain[name] for name in ("microsteps", "step_angle", "turn_distance", "project_loop")}
        made = with_steps(
            Project(number=1, loop_first=first, loop_last=last, loop_count=count, **base),
            tuple(Step(**one) for one in plain["steps"]),
        )
        machine = Machine()
        machine.start(made, 0.0)
        while machine.until < inf:
            machine.advance(machine.until)
        wanted = float(exact.time_of(plain))
        assert machine.notices == [pytest.approx(wanted, rel=1e-9, abs=1e-6)], plain


def random_project(random: Random) -> dict[str, Any]:
    total = random.randint(1, 10)
    first = random.randint(1, total)
    choices = {"start_frequency": range(900), "acceleration": (0, 1, 30, 100), "speed": (0, 1, 60, 300, 1200)}
    choices |= {"delay": (0, 0, 7, 1000), "distance": range(400), "direction": (0, 1)}
    return {
        "microsteps": random.choice((1, 2, 4, 8, 16)),
        "step_angle": random.choice((90, 180, 75, 7)),
        "turn_distance": random.randint(1, 6000),
        "loop": random.choice([(0, 0, 0), (first, random.randint(first, total), random.randint(1, 20))]),
        "project_loop": random.randint(0, 5),
        "steps": [{name: random.choice(some) for name, some in choices.items()} for _ in range(total)],
    }


def test_endless_and_empty_projects_neither_hang_nor_nest() -> None:
    machine = Machine()
    machine.start(project(Step(), Step(output=1), project_loop=255), 0.0)
    machine.advance(0.01)
    assert machine.run is not None
    assert machine.run.round == pytest.approx(10, abs=2)
    loop = Machine()
    loop.start(project(Step(), Step(), loop_first=1, loop_last=2, loop_count=254, project_loop=5), 0.0)
    assert loop.notices == [0.0]
    cleared = Machine()
    cleared.start(Project(), 0.0)
    assert (cleared.phase, cleared.notices) == (Phase.IDLE, [0.0])


def test_a_busy_controller_ignores_every_start() -> None:
    machine = Machine()
    machine.start(project(), 0.0)
    machine.start(project(replace(TURN, direction=1)), 0.5)
    machine.jog(project(), 1, 0.5)
    machine.run_once(project(), 0.5)
    machine.home(project(), 0.5)
    machine.advance(9.0)
    assert (machine.position(9.0), machine.notices) == (1600, [1.0])


# -- inputs and outputs ----------------------------------------------------------------------------------


def test_outputs_switch_with_the_motion_and_not_with_the_wait() -> None:
    machine = Machine()
    machine.start(project(replace(TURN, start_input=1, output=1)), 0.0)
    machine.set_input(2, True, 1.0)
    assert (machine.phase, machine.outputs) == (Phase.WAIT, 0)
    machine.set_input(1, True, 2.0)
    assert (machine.phase, machine.outputs) == (Phase.MOVE, 1)
    machine.set_output(4, 1, 2.0)
    machine.set_output(5, 1, 2.0)
    assert (machine.outputs, machine.leds) == (7, True)


def test_an_active_input_starts_a_step_at_once() -> None:
    machine = Machine()
    machine.set_input(2, True, 0.0)
    machine.start(project(replace(TURN, start_input=2)), 0.0)
    assert machine.phase is Phase.MOVE


@pytest.mark.parametrize("moment", [0.0, 0.5])
def test_a_stop_input_ends_the_motion_at_once_and_the_pause_follows(moment: float) -> None:
    machine = Machine()
    step = replace(RAMPED, stop_input=2, delay=1000)
    machine.set_input(2, moment == 0, 0.0)
    machine.start(project(step, replace(TURN, direction=1), stop_mode=0), 0.0)
    machine.set_input(2, True, moment)
    machine.advance(moment + 0.99)
    assert (machine.phase, machine.until) == (Phase.PAUSE, moment + 1.0)
    machine.advance(9.0)
    assert machine.notices == [moment + 2.0]


def test_input_3_starts_without_a_notice_and_input_4_stops() -> None:
    machine = Machine()
    machine.set_input(3, True, 0.0, start=project())
    machine.advance(2.0)
    assert (machine.phase, machine.position(2.0)) == (Phase.IDLE, 1600)
    machine.set_input(3, False, 2.0)
    machine.set_input(3, True, 2.0, start=project())
    machine.set_input(4, True, 2.5)
    assert (machine.phase, machine.position(2.5)) == (Phase.IDLE, 1600 + 800)
    assert machine.notices == []


# -- stops ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stop", [Machine.stop_project, Machine.stop_motor])
def test_a_slow_stop_ramps_down_and_neither_another_stop_nor_mode_changes_it(stop: Any) -> None:
    machine = Machine()
    machine.start(project(RAMPED, stop_mode=0), 0.0)
    machine.stop_project(5.0)
    machine.stop_mode = 1
    stop(machine, 5.5)
    assert (machine.phase, machine.until) == (Phase.SLOWING, 6.5)
    machine.advance(9.0)
    assert (machine.phase, machine.notices) == (Phase.IDLE, [])


@pytest.mark.parametrize("stop", [Machine.stop_project, Machine.stop_motor])
@pytest.mark.parametrize("moment", [0.5, 1.2, 9.0])
def test_an_immediate_stop_ends_the_project_in_every_phase(stop: Any, moment: float) -> None:
    machine = Machine()
    machine.start(project(replace(TURN, delay=1000), replace(TURN, start_input=1)), 0.0)
    stop(machine, moment)
    assert (machine.phase, machine.run, machine.notices) == (Phase.IDLE, None, [])


def test_stop_project_leaves_a_jog_alone_and_stop_motor_ends_it() -> None:
    machine = Machine()
    machine.jog(project(), 1, 0.0)
    machine.stop_project(0.5)
    assert machine.phase is Phase.JOG
    machine.stop_motor(1.0)
    assert (machine.phase, machine.position(5.0)) == (Phase.IDLE, 1600)


# -- manual motion and power -----------------------------------------------------------------------------


def test_one_move_is_that_of_step_1() -> None:
    machine = Machine()
    machine.run_once(project(replace(TURN, direction=1, start_input=1, output=4, delay=900)), 0.0)
    assert machine.until == 1.0
    machine.advance(9.0)
    assert (machine.position(9.0), machine.outputs) == (-1600, 0)
    still = Machine()
    still.jog(project(replace(TURN, speed=0)), 1, 0.0)
    assert still.phase is Phase.IDLE


def test_homing_runs_in_reverse_to_input_5_and_counts_from_there() -> None:
    machine = Machine()
    machine.home(project(stop_mode=0), 0.0)
    machine.advance(0.5)
    assert machine.position(0.5) == -800
    machine.set_input(5, True, 1.0)
    assert (machine.phase, machine.position(1.0), machine.is_homed) == (Phase.IDLE, 0, True)
    machine.home(project(), 2.0)
    assert machine.phase is Phase.IDLE


def test_without_supply_all_but_the_position_is_lost() -> None:
    machine = Machine()
    machine.start(project(replace(TURN, output=2)), 0.0)
    machine.power_off(0.5)
    assert (machine.phase, machine.outputs, machine.position(9.0)) == (Phase.OFF, 0, 800)
    machine.start(project(), 1.0)
    machine.power_on(2.0)
    assert (machine.phase, machine.run, machine.position(2.0)) == (Phase.IDLE, None, 800)
    machine.power_off(3.0)
    machine.power_on(4.0, home_with=project())
    assert machine.phase is Phase.HOMING
