"""The twin beside the machine it is made of, and beside the simulated controller that it is the estimate of."""

from __future__ import annotations

from dataclasses import replace
from math import pi, tau
from typing import Any

import pytest
from hypothesis import given, settings

from motorbus.families.stepper import execution
from motorbus.families.stepper.driver import Estimated
from motorbus.families.stepper.driver.progress import Twin
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program import plan
from motorbus.families.stepper.table import Project, decode_image
from tests.families.stepper.behaviours import short_projects, switches
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.vectors import DUMP_B
from tests.protocol.stepper.execution.course import project, step

B = decode_image(DUMP_B[6:])
ENDS = ("zero_distance",)  # a step that never ends has no fraction


def twin(made: Project, at: float = 0.0, how: Behaviour = USUAL, *active: int) -> Any:
    return Twin(plan(made, how), at, frozenset(active))


def test_where_it_should_be_is_told_in_rad_and_steps() -> None:
    near: Any = pytest.approx
    two = twin(project(step(delay=1000), step(direction=1, distance=800)), 50.0)
    assert two.told(50.5) == Estimated(50.5, near(0.2), 1, 1, 1, near(pi), None)
    assert two.told(51.5) == Estimated(51.5, near(0.6), 1, 1, 1, near(tau), None)
    assert two.told(52.25) == Estimated(52.25, near(0.9), 1, 1, 2, near(tau * 3 / 4), None)
    assert two.told(52.5) == Estimated(52.5, 1.0, 1, 1, 0, near(pi), None)
    assert two.told(99.0).position == near(pi)


def test_passes_are_counted_and_the_last_one_stays() -> None:
    many = twin(project(step(), project_loop=4))
    assert [many.told(at).round for at in (0.0, 0.9, 1.1, 2.1, 3.1, 4.1)] == [1, 1, 2, 3, 4, 4]
    assert many.told(5.0).passes == 4


def test_a_loop_of_steps_counts_in_the_fraction() -> None:
    loop = twin(project(step(), step(delay=1000), loop_first=2, loop_last=2, loop_count=3))
    assert [loop.told(at).fraction for at in (0.5, 1.5, 3.5, 6.5)] == pytest.approx(
        [0.5 / 7, 1.5 / 7, 0.5, 6.5 / 7]
    )


def test_a_wait_takes_no_part_and_is_named() -> None:
    waits = twin(project(step(), step(start_input=2)))
    told = waits.told(5.0)
    assert (told.fraction, told.waiting_for, told.step) == (pytest.approx(0.5), 2, 2)
    waits.press(2, True, 6.0)
    told = waits.told(6.5)
    assert (told.fraction, told.waiting_for) == (pytest.approx(0.75), None)


def test_an_input_that_is_active_already_is_no_wait() -> None:
    assert twin(project(step(start_input=2)), 0.0, USUAL, 2).told(0.5).waiting_for is None


def test_a_step_that_is_cut_short_is_through() -> None:
    cut = twin(project(step(stop_input=1), step()))
    cut.press(1, True, 0.25)
    told = cut.told(0.25)
    assert (told.fraction, told.position, told.step) == (0.5, pytest.approx(tau / 4), 2)


def test_without_an_end_there_is_no_fraction() -> None:
    endless = twin(project(step(), project_loop=255))
    assert [endless.told(at).fraction for at in (0.5, 700.0)] == [None, None]
    assert (endless.told(700.5).passes, endless.told(700.5).round) == (None, 701)
    never = twin(project(step(distance=0)), 0.0, Behaviour(zero_distance="endless"))
    assert never.told(5.0).fraction is None


def test_what_takes_no_time_is_over_at_once() -> None:
    assert twin(project(step(distance=0))).told(0.0) == Estimated(0.0, 1.0, 1, 1, 0, 0.0, None)
    assert twin(replace(project(), microsteps=0)).told(0.1).position == 0.0


@settings(max_examples=200, deadline=None)
@given(made=short_projects(inputs=False), how=switches(ENDS))
def test_the_fraction_only_grows_and_ends_at_one(made: Project, how: dict[str, Any]) -> None:
    whole = plan(made, Behaviour(**how))
    model = Twin(whole, 7.0)
    moments = [whole.estimate.seconds * n / 40 for n in range(42)]
    told = [model.told(7.0 + at) for at in moments]
    fractions = [one.fraction for one in told]
    assert all(0 <= (fraction or 0.0) <= 1 for fraction in fractions)
    assert fractions == sorted(fractions, key=lambda one: one or 0.0)
    assert fractions[-1] == 1.0
    if how["rounding"] != "carry":  # else a step counts with its average
        share = [at / whole.estimate.seconds if whole.estimate.seconds else 1.0 for at in moments[:-1]]
        assert [one.fraction for one in told[:-1]] == pytest.approx(share, abs=1e-6)


class Beside:
    """Each estimate, and where the simulated motor was at the same moment, in pulses."""

    def __init__(self, there: Bench) -> None:
        self._there = there
        self.pairs: list[tuple[Estimated, int, float]] = []

    def __call__(self, event: object) -> None:
        if isinstance(event, Estimated):
            state = execution.advance(self._there.simulated.state, event.at).state
            turn = float(self._there.simulated.store.project(1).pulses_per_turn or 1)
            self.pairs.append((event, state.position(event.at), event.position * turn / tau))


@settings(max_examples=60, deadline=None)
@given(made=short_projects(inputs=False), how=switches(ENDS))
def test_the_estimate_is_the_simulated_position_to_a_pulse(made: Project, how: dict[str, Any]) -> None:
    """Of a controller that behaves as assumed, and acknowledges when it begins."""
    with bench(turnaround=0.0, **how) as there:
        there.simulated.put(1, made)
        beside = Beside(there)
        there.bus.report = beside
        ran = there.device.run(1, how=Behaviour(**how))
        assert beside.pairs or ran.seconds == 0
        for _, truth, estimate in beside.pairs:
            assert estimate == pytest.approx(truth, abs=1.0 + 1e-6)


@pytest.mark.parametrize("turnaround", [0.002, 0.02])
def test_it_lags_by_the_time_of_the_acknowledgement_and_no_more(turnaround: float) -> None:
    moves = project(step(speed=600, distance=16000, start_frequency=16000), step(direction=1, distance=16000))
    with bench(turnaround=turnaround) as there:
        there.simulated.put(1, moves)
        beside = Beside(there)
        there.bus.report = beside
        there.device.run(1, expert=True)
        assert len(beside.pairs) > 40
        for _, truth, estimate in beside.pairs:
            assert abs(estimate - truth) <= 1 + 16000 * turnaround


def test_watched_inputs_keep_it_in_step() -> None:
    with bench(turnaround=0.0) as there:
        there.simulated.put(1, replace(B, number=1))
        for number in range(6):
            there.simulator.press(1, True, 6.0 + 9 * number)
            there.simulator.press(1, False, 7.0 + 9 * number)
        beside = Beside(there)
        there.bus.report = beside
        there.device.run(1, watch=(1, 2))
        waited = [told.waiting_for for told, _, _ in beside.pairs]
        assert waited.count(1) > 20
        for told, truth, estimate in beside.pairs:
            assert abs(estimate - truth) <= 1 + 32000 * 0.05, told  # a press is believed within two rounds
        assert beside.pairs[-1][0].fraction == pytest.approx(1.0, abs=0.01)
        assert beside.pairs[-1][0].round == 3


def test_without_watching_it_waits_for_ever_and_says_so() -> None:
    with bench() as there:
        there.simulated.put(1, project(step(), step(start_input=1)))
        there.simulator.press(1, True, 3.0)
        beside = Beside(there)
        there.bus.report = beside
        there.device.run(1, expert=True)
        assert beside.pairs[-1][0].waiting_for == 1
        assert beside.pairs[-1][0].fraction == pytest.approx(0.5)
