"""Every experiment tells its readings apart, whatever the others are, and moves no farther than it says."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import pytest
from hypothesis import given

from motorbus.families.stepper import execution
from motorbus.families.stepper.driver.characterising.experiments import (
    SLACK,
    SLOW_TURNS,
    WAYS,
    Act,
    Motor,
    Seen,
    Trial,
)
from motorbus.families.stepper.driver.characterising.study import IN_SILENCE
from motorbus.families.stepper.driver.characterising.trials import controls, ramp, ramp_speeds, trials
from motorbus.families.stepper.execution import USUAL, Behaviour, State
from motorbus.families.stepper.table import Project
from tests.families.stepper.behaviours import switches

MOTORS = [
    Motor.of(Project(microsteps=microsteps, step_angle=angle))
    for microsteps, angle in ((1, 180), (8, 180), (16, 90), (256, 90), (10, 7))
]
EACH = pytest.mark.parametrize("motor", MOTORS, ids=lambda motor: f"{float(motor.per_turn):g}")
USUAL_MOTOR = MOTORS[1]


def at(trial: Trial) -> tuple[float, ...]:
    return tuple(act.at for act in trial.acts)


def apart(one: Seen, other: Seen) -> bool:
    if one.answered != other.answered or len(one.ends) != len(other.ends):
        return True
    return any(abs(a - b) > 2 * (SLACK + 0.01 * b) for a, b in zip(one.ends, other.ends, strict=True))


@EACH
def test_what_is_seen_of_two_readings_is_clearly_apart(motor: Motor) -> None:
    for trial in trials(motor, 4, 3):
        for name in trial.settles:
            fixed: dict[str, Any] = {other: WAYS[other][0] for other in (*trial.settles, *trial.depends)}
            shown = [trial.played(fixed | {name: value}, at(trial)) for value in WAYS[name]]
            if trial.name == "single move stopped, no start":  # it tells them where the move has a notice
                fixed["notice_on_once"] = True
                shown = [trial.played(fixed | {name: value}, at(trial)) for value in WAYS[name]]
            assert all(apart(one, other) for one, other in combinations(shown, 2)), (trial.name, name, shown)


@pytest.mark.parametrize("number", range(len(trials(USUAL_MOTOR, 4, 3))))
@given(way=switches())
def test_no_reading_that_a_trial_does_not_name_makes_a_difference_to_it(
    number: int, way: dict[str, Any]
) -> None:
    trial = trials(USUAL_MOTOR, 4, 3)[number]
    named = {name: way[name] for name in (*trial.settles, *trial.depends)}
    needed = dict(trial.needs)
    assert trial.played(way | needed, at(trial)) == trial.played(named | needed, at(trial))


@EACH
@given(way=switches())
def test_a_control_takes_the_same_in_every_reading(motor: Motor, way: dict[str, Any]) -> None:
    for trial, pause in zip(controls(motor, 4), (0.3, 1.3), strict=True):
        (end,) = trial.played(way, at(trial)).ends
        assert end == pytest.approx(pause + 1 / motor.frequency(motor.quick), rel=1e-9)


def positions(project: Project, acts: tuple[Act, ...], how: Behaviour) -> list[int]:
    """Where the motor is every 10 ms, in pulses."""
    state, found, left = State(how=how), [], list(acts)
    for tick in range(1000):
        now = tick / 100
        while left and left[0].at <= now:
            command = left.pop(0).command
            if command == "start_project":
                state = execution.start(state, project, now).state
            elif command == "run_once":
                state = execution.run_once(state, project, now).state
            else:
                stop = execution.stop_project if command == "stop_project" else execution.stop_motor
                state = stop(state, now).state
        state = execution.advance(state, now).state
        found.append(state.position(now))
    return found


@EACH
def test_no_trial_moves_farther_than_it_says(motor: Motor) -> None:
    for trial in trials(motor, 4, 3):
        for way in trial.ways({}):
            how: dict[str, Any] = dict(way)
            farthest = max(map(abs, positions(trial.project, trial.acts, replace(USUAL, **how))), default=0)
            assert farthest <= round(trial.turns * float(motor.per_turn)), trial.name


@EACH
def test_all_slow_trials_together_leave_the_rest_of_the_travel_to_the_ramp(motor: Motor) -> None:
    for reverse in (0, 1):
        made = [
            one
            for one in trials(motor, 4, 3)
            if one.project.step(one.project.total_steps).direction == reverse
        ]
        assert IN_SILENCE * sum(one.turns for one in made) <= SLOW_TURNS


@EACH
@pytest.mark.parametrize("travel", [0.5, 1.0, 20.0])
def test_a_ramp_stays_within_its_travel_and_comes_back(motor: Motor, travel: float) -> None:
    for rpm in ramp_speeds(motor):
        project = ramp(motor, 4, travel, rpm, 64, 0.05)
        assert 1 <= rpm <= 240
        assert project.step(1).distance <= (travel - SLOW_TURNS) * project.turn_distance
        assert sum(step.sign * step.distance for step in project.steps) == 0


def test_a_project_without_steps_is_started_only_while_another_one_is_selected() -> None:
    names = [one.name for one in trials(USUAL_MOTOR, 4, 1)]
    assert names.index("without steps") < names.index("single move")
    assert "without steps" not in [one.name for one in trials(USUAL_MOTOR, 4, None)]
