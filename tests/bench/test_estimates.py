"""What is timed is the estimate of ten steps, and the verdict is on the first of them."""

from __future__ import annotations

from bench import estimates
from bench.estimates import Cost
from bench.figures import Spread
from motorbus.families.stepper import execution


def test_what_is_measured_has_ten_steps() -> None:
    found = estimates.forecasts()
    assert [one.program.project.total_steps for one in found] == [10, 10, 10]
    longest = found[-1]
    runs = execution.sent_in_all(longest.program.project, longest.how)
    assert sum(sum(times.values()) for times in runs.values()) == 645_160
    assert any(len(times) > 1 for times in runs.values())


def test_each_is_timed_so_often() -> None:
    told: list[str] = []
    found = estimates.costs(1, told.append)
    assert [one.name for one in found] == [one.name for one in estimates.forecasts()]
    assert len(told) == len(found)
    assert all(one.seconds.low > 0 for one in found)


def test_the_verdict_is_that_of_the_first() -> None:
    fast, slow = Cost("a", Spread(0.049, 0.01, 9.0)), Cost("b", Spread(0.051, 0.01, 9.0))
    assert estimates.verdict([fast, slow]).endswith("49.00 ms. Less than 50 ms: reached.")
    assert estimates.verdict([slow, fast]).endswith("MISSED.")
    assert estimates.rows([fast]) == [("a", "49.00", "10.00 – 9000.00")]
