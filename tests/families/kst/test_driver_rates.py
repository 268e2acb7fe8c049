"""Finding the bit rate: by listening, and by speaking only where somebody says that nothing depends on the bus."""

from __future__ import annotations

import pytest

from motorbus.errors import LinkError, LinkLost, RequestError
from motorbus.families.kst import LineActivity, Skipped, scan_bit_rates, settings_of
from motorbus.families.kst.profiles import RATES
from motorbus.link.memory import MemoryLink
from tests.families.kst.bench import Bench, bench
from tests.families.kst.test_driver_scanning import Deaf


def look(there: Bench, **how: object) -> object:
    return there.run(scan_bit_rates(settings_of(there.bus), **how))  # type: ignore[arg-type]


@pytest.mark.parametrize("rate", RATES)
def test_traffic_tells_the_rate_and_nothing_is_sent(rate: int) -> None:
    with bench(bit_rate=rate, reports_ms=100, profile="kst-ext") as there:
        found = there.run(scan_bit_rates(settings_of(there.bus)))
        assert found.rate == rate
        assert found.activity[rate] is LineActivity.TRAFFIC
        assert {found.activity[one] for one in RATES if one < rate} <= {LineActivity.ERRORS}
        assert there.sent() == []
        assert there.sim().errors == 0
        assert there.bus.rate == 500_000


def test_a_silent_bus_is_not_spoken_to_unless_it_is_isolated() -> None:
    with bench(bit_rate=125_000) as there:
        found = there.run(scan_bit_rates(settings_of(there.bus)))
        assert (found.rate, set(found.activity.values())) == (None, {LineActivity.SILENCE})
        assert there.sent() == []
        found = there.run(scan_bit_rates(settings_of(there.bus), isolated=True))
        assert (found.rate, [one.node for one in found.found]) == (125_000, [5])
        assert there.servo().ping() is False, "the rate of the bus is as it was"


def test_nobody_is_there() -> None:
    with bench() as there:
        there.sim().unplug()
        assert there.run(scan_bit_rates(settings_of(there.bus), isolated=True)).rate is None


def test_an_adapter_that_cannot_listen_needs_an_isolated_bus() -> None:
    with bench(bit_rate=125_000, link=Deaf) as there:
        with pytest.raises(RequestError, match="cannot listen"):
            look(there)
        assert there.sent() == []
        assert there.run(scan_bit_rates(settings_of(there.bus), isolated=True)).rate == 125_000


class Without800k(MemoryLink):
    """An adapter that lacks a rate, as slcan has none of 800k that everybody agrees upon."""

    def tune(self, rate: int, listen_only: bool = False) -> None:
        if rate == 800_000:
            raise LinkError("this adapter has no such rate")
        super().tune(rate, listen_only)


def test_a_rate_that_the_adapter_lacks_is_left_out_and_told() -> None:
    with bench(bit_rate=1_000_000, reports_ms=10.0, link=Without800k) as there:
        found = there.run(scan_bit_rates(settings_of(there.bus)))
        assert (found.rate, 800_000 in found.activity) == (1_000_000, False)
        assert there.of(Skipped) == [Skipped(800_000, "this adapter has no such rate")]


def test_impossible_rates_are_refused() -> None:
    with bench() as there, pytest.raises(RequestError, match="no rate"):
        look(there, rates=(9600,))


def test_a_lost_adapter_ends_it() -> None:
    with bench() as there:
        there.link.unplug(0.5)
        with pytest.raises(LinkLost):
            look(there)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_nobody_listens_for_ever(seconds: float) -> None:
    with bench() as there, pytest.raises(RequestError, match="seconds"):
        look(there, seconds=seconds)
