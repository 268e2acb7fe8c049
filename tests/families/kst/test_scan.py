"""Scan of ids: what is sent, what is reported, what is left undisturbed."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from motorbus.core.family import Found
from motorbus.core.scan import Skipped
from motorbus.core.steps import Progress
from motorbus.errors import LinkError, LinkLost, RequestError
from motorbus.families.kst import ScanWarning, scan
from motorbus.families.kst.profiles import RATES
from motorbus.link.memory import MemoryLink
from tests.families.kst.bench import Bench

ALL = "600#4000300000000000"


def run_scan(bench: Bench, ids: Sequence[int] = (), rates: Sequence[int] = ()) -> list[tuple[int, int]]:
    """The nodes that the scan finds, with their rates."""
    return [(one.node, one.rate) for one in bench.bus.run(scan(bench.settings, ids, rates))]


def test_scan_sends_one_broadcast_and_reads_silent_ids_twice() -> None:
    with Bench(1, 37, 127) as bench:
        found = [(1, 500_000), (37, 500_000), (127, 500_000)]
        assert run_scan(bench) == found
        frames = bench.sent()
        assert (frames[0], len(frames)) == (ALL, 1 + 2 * 124 + 3 * 8)
        assert bench.events[:3] == [Found(*one, None) for one in found]
        progress = [event.done for event in bench.of(Progress)]
        assert progress == sorted(progress)
        assert bench.link.now() < 1.0
        assert run_scan(bench, (37, 38)) == [(37, 500_000)]
        assert ALL not in bench.sent()
        for ids, rates in (((0,), ()), ((5,), (9600,))):
            with pytest.raises(RequestError):
                run_scan(bench, ids, rates)


@pytest.mark.parametrize("ids", [(), (5,)])
def test_scan_reports_an_id_that_needs_a_restart(ids: tuple[int, ...]) -> None:
    with Bench() as bench:
        bench.servo().set_node_id(9)
        (found,) = bench.bus.run(bench.bus.driver.scan(ids))
        assert found.identity is not None
        assert found.identity.details["reads_back_id"] == 9
        (warning,) = bench.of(ScanWarning)
        assert warning.node == 5
        assert "reads back the id 9" in warning.what


@pytest.mark.parametrize(
    ("ids", "duplicate", "evidence"),
    [((5, 5, 6), "", "no read of its position"), ((5, 6), "5", "2 answers to one request")],
)
def test_scan_warns_of_two_servos_with_one_id(ids: tuple[int, ...], duplicate: str, evidence: str) -> None:
    with Bench(*ids, duplicate=duplicate) as bench:
        bench[5].raw_position = 3
        assert run_scan(bench) == [(5, 500_000), (6, 500_000)]
        (warning,) = bench.of(ScanWarning)
        assert warning.node == 5
        assert evidence in warning.what


@pytest.mark.parametrize(("sent", "accepted"), [("std", "ext"), ("ext", "std")])
def test_scan_without_a_reply_names_the_other_id_format(sent: str, accepted: str) -> None:
    with Bench(settings={"id_format": sent}, id_format=accepted) as bench:
        assert run_scan(bench) == []
        (warning,) = bench.of(ScanWarning)
        assert "id_format=ext" in warning.what


class Without800k(MemoryLink):
    """An adapter that lacks a rate, as slcan."""

    def tune(self, rate: int) -> None:
        if rate == 800_000:
            raise LinkError("this adapter has no such rate")
        super().tune(rate)


def test_rate_that_the_adapter_lacks_is_skipped() -> None:
    with Bench(link=Without800k) as bench:
        assert run_scan(bench, (5,), (800_000, 500_000)) == [(5, 500_000)]
        assert bench.of(Skipped) == [Skipped(800_000, "this adapter has no such rate")]


def test_a_lost_adapter_ends_a_scan() -> None:
    with Bench() as bench:
        bench.link.unplug(0.1)
        with pytest.raises(LinkLost):
            run_scan(bench, (5,), RATES)
