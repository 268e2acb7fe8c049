"""What is fixed in every time comes out of two controls, and a line that does not keep time is doubted."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.families.stepper.driver.characterising.experiments import Seen
from motorbus.families.stepper.driver.characterising.findings import Case
from motorbus.families.stepper.driver.characterising.listening import Heard
from motorbus.families.stepper.driver.characterising.timing import Timing, controlled, once
from motorbus.families.stepper.driver.characterising.trials import controls
from motorbus.families.stepper.table import encode_image
from tests.families.stepper.bench import Bench, bench
from tests.families.stepper.driver.characterising.studies import case_of


@pytest.mark.parametrize("turnaround", [0.0, 0.005, 0.02])
@pytest.mark.parametrize("pace", [False, True])
def test_what_is_fixed_is_found(turnaround: float, pace: bool) -> None:
    with bench(turnaround=turnaround, pace=pace) as there:
        case = case_of(there)
        timing = there.run(controlled(case))
        assert timing is not None
        assert timing.turnaround == pytest.approx(turnaround, abs=0.004)
        assert timing.clock == pytest.approx(1.0, abs=1e-3)
        assert timing.offset == pytest.approx(-turnaround - 0.0035, abs=0.005)
        assert timing.latency == pytest.approx(turnaround + 17 * 10 / 9600 * pace, abs=0.005)
        assert set(case.found.measured) == {"overhead", "turnaround", "clock"}
        assert case.found.known["read_view"] == "stored"
        assert not case.found.doubts


@pytest.mark.parametrize(
    "fault",
    [
        {"notice_fault": "lost", "fault_every": 3},
        {"notice_fault": "late", "fault_every": 2, "fault_time": 0.2},
        {"notice_fault": "late", "fault_every": 3, "fault_time": 0.5},
        {"notice_fault": "early"},
        {"notice_fault": "lost", "fault_every": 4},
    ],
)
def test_a_line_that_keeps_no_time_is_doubted(fault: dict[str, Any]) -> None:
    with bench(**fault) as there:
        case = case_of(there)
        assert there.run(controlled(case)) is None
        assert case.found.doubts
        assert "read_view" not in case.found.known


def test_times_are_told_in_seconds_of_the_controller() -> None:
    timing = Timing(offset=-0.01, clock=1.1, latency=0.02, turnaround=0.005)
    heard = Heard((5.0, 6.0, 7.0), (5.1, 6.2, None), (7.3,))
    at, seen = timing.seen(heard)
    assert at == pytest.approx((0.0, 1.0, 2.0 / 1.1))
    assert seen.answered == (True, True, False)
    assert seen.ends == pytest.approx(((7.3 - 5.1 + 0.01) / 1.1,))
    assert isinstance(seen, Seen)


def run_once(there: Bench, case: Case, latency: float) -> Heard | None:
    trial, _ = controls(case.motor, case.scratch)
    there.simulated.put(4, trial.project)
    return there.run(once(case, trial, 1.0, 1, latency))


def test_a_start_that_is_answered_late_or_not_at_all_is_doubted() -> None:
    with bench(turnaround=0.05) as there:
        case = case_of(there)
        assert run_once(there, case, 0.05) is not None
        assert not case.found.doubts
        assert run_once(there, case, 0.01) is None
        assert case.found.doubts == ["an acknowledgement came late"]
        there.simulated.switch(reply_fault="lost", fault_every=3)
        found = [run_once(there, case, 0.05) for _ in range(3)]
        assert None in found
        assert "a start was not acknowledged" in case.found.doubts


def test_the_image_of_a_control_is_what_it_says() -> None:
    with bench() as there:
        case = case_of(there)
        short, long = controls(case.motor, case.scratch)
        assert encode_image(short.project) != encode_image(long.project)
        assert long.longest({}) - short.longest({}) == pytest.approx(1.0)
