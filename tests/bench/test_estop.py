"""Emergency stops over pseudo-terminals: each arrives on every bus that is listened to, and figures are reckoned."""

from __future__ import annotations

import pytest

from bench.estop import BUSES, COLUMNS, MOST, SHARE, STOPS, Sample, at_share, rows, samples, verdict

FOUND = [Sample(bus, 0.001 * number) for bus in BUSES for number in range(1, 41)]


def test_each_stop_arrives_on_every_bus_beside_one_that_is_blocked() -> None:
    found = samples(3, lambda text: None)
    assert [one.bus for one in found] == [bus for bus in BUSES for _ in range(3)]
    assert all(one.seconds > 0 for one in found)


def test_a_share_of_some_is_what_so_many_do_not_exceed() -> None:
    assert at_share(range(1, 1001), SHARE) == 1000
    assert at_share(range(1, 2001), SHARE) == 1999
    assert at_share([3.0], SHARE) == 3.0


def test_there_is_a_row_for_each_bus() -> None:
    told = rows(FOUND)
    assert len(told) == len(BUSES)
    assert all(len(row) == len(COLUMNS) for row in told)
    assert told[0] == ("six servos", "40", "20.50 ms", "40.00 ms", "40.00 ms", "40.00 ms")


def test_it_is_said_whether_the_figure_was_reached() -> None:
    assert verdict(FOUND) == "99.9% of all within 40.0 ms. At most 50 ms: reached."
    assert verdict([Sample("arm", 0.2)]).endswith("MISSED.")


@pytest.mark.soak
def test_of_a_thousand_and_more_999_in_1000_arrive_in_time() -> None:
    found = samples(STOPS, lambda text: None)
    print(*rows(found), verdict(found), sep="\n")
    assert at_share([one.seconds for one in found], SHARE) <= MOST
