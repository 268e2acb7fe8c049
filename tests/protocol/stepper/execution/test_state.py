"""Where it is and how fast, at any moment."""

from __future__ import annotations

from motorbus.families.stepper.execution import Motion, Phase, Ramp, Run, State, motion
from motorbus.families.stepper.execution.order import Place
from motorbus.families.stepper.table import Project

MOVE: Motion = motion(100, 50.0, Ramp(50.0, 0.0, False), -1)
LATE = 1e9  # s; here two moments differ by no less than a tenth of a microsecond


def test_position_and_frequency_count_from_the_beginning_of_the_phase() -> None:
    state = State(phase=Phase.MOVE, since=10.0, until=12.0, motion=MOVE, base=7)
    assert [state.position(at) for at in (9.0, 10.0, 11.0, 12.0, 99.0)] == [7, 7, -43, -93, -93]
    assert [state.frequency(at) for at in (9.0, 10.0, 11.0, 12.0)] == [0, -50, -50, 0]


def test_at_rest_there_is_no_frequency() -> None:
    assert State(base=5).position(3.0) == 5
    assert State().frequency(3.0) == 0


def test_what_counts_as_busy() -> None:
    assert [phase for phase in Phase if not State(phase=phase).busy] == [Phase.IDLE, Phase.OFF]


def test_a_run_knows_its_step() -> None:
    project = Project(total_steps=3).with_step(2, delay=9)
    assert Run(project, Place(2), asked=True).step.delay == 9


def test_at_its_end_all_pulses_are_out_however_late_it_is() -> None:
    for pulses in range(1, 200):
        move = motion(pulses, 7777.0, Ramp(50.0, 30_000.0, False))
        state = State(phase=Phase.MOVE, since=LATE, until=LATE + move.duration, motion=move)
        assert state.position(state.until) == pulses
