"""Scanning: one broadcast, then the silent ids in flight together; what does not fit is told; nothing is written."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Found
from motorbus.core.request import Data
from motorbus.core.steps import Progress
from motorbus.errors import LinkError, RequestError
from motorbus.families.kst import Skipped, Suspicion, scan
from motorbus.families.kst.driver.scan import OTHER_FORMAT, TORN, WRONG_RATE
from motorbus.families.kst.profiles import RATES
from motorbus.link.memory import MemoryLink
from tests.families.kst.bench import bench
from tests.families.kst.test_driver_presence import NoErrors

EVERYONE = "600#4000300000000000"


def test_one_frame_finds_everybody_and_the_silent_are_asked_twice() -> None:
    with bench(ids=(1, 37, 127)) as there:
        found = there.run(there.driver.scan())
        assert [(one.node, one.rate) for one in found] == [(1, 500_000), (37, 500_000), (127, 500_000)]
        frames = there.sent()
        assert frames[0] == EVERYONE
        assert len(frames) == 1 + 2 * 124 + 3 * 3  # of those who are there: id, version, position
        assert there.of(Found) == [Found(one.node, 500_000, None) for one in found]
        assert there.events.index(Found(127, 500_000, None)) == 2
        progress = there.of(Progress)
        assert [one.done for one in progress] == sorted(one.done for one in progress)
        assert there.link.now() < 0.5


def test_named_ids_are_asked_one_by_one() -> None:
    with bench(ids=(1, 37)) as there:
        assert [one.node for one in there.run(there.driver.scan((37, 38)))] == [37]
        assert EVERYONE not in there.sent()


def test_servos_that_ignore_a_broadcast_are_found_all_the_same() -> None:
    with bench(ids=(3, 90), broadcast_read=False) as there:
        assert [one.node for one in there.run(there.driver.scan())] == [3, 90]


def test_impossible_ids_are_refused() -> None:
    with bench() as there:
        with pytest.raises(RequestError):
            there.run(there.driver.scan((0,)))
        assert there.sent() == []


def test_a_scan_reads_and_never_writes() -> None:
    with bench(ids=(1, 2)) as there:
        there.run(there.driver.scan((), RATES))
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}


def test_an_id_that_waits_for_a_restart_is_told() -> None:
    with bench() as there:
        there.servo().set_node_id(9)
        for ids in ((), (5,)):
            there.events.clear()
            (found,) = there.run(there.driver.scan(ids))
            assert found.identity is not None
            assert found.identity.details["reads_back_id"] == 9
            (suspicion,) = there.of(Suspicion)
            assert suspicion.node == 5
            assert "reads back the id 9" in suspicion.what


@pytest.mark.parametrize("ids", [(), (5,)])
def test_d2_two_servos_with_one_id_are_told(ids: tuple[int, ...]) -> None:
    with bench(duplicate="5", duplicate_delay=0.0003) as there:
        assert [one.node for one in there.run(there.driver.scan(ids))] == [5]
        assert "two servos with one id" in there.of(Suspicion)[0].what


def test_d2_bus_errors_are_told() -> None:
    with bench(ids=(5, 6)) as there:
        there.sim(6).values["node_id"] = 7
        there.sim(6).node = 5
        found = there.run(there.driver.scan((5,)))
        assert [one.node for one in found] in ([], [5])
        assert any("bus errors during the scan" in one.what for one in there.of(Suspicion))


def test_at_another_rate_it_listens_first_and_the_rate_is_set_back() -> None:
    with bench(bit_rate=250_000, reports_ms=20, profile="kst-ext") as there:
        found = there.run(there.driver.scan((), RATES))
        assert [(one.node, one.rate) for one in found] == [(5, 250_000)]
        skipped = there.of(Skipped)
        assert {one.rate for one in skipped} == set(RATES) - {250_000, 500_000}
        assert there.bus.rate == there.link.rate == 500_000


def test_d12_a_running_bus_at_another_rate_is_not_disturbed() -> None:
    with bench(bit_rate=250_000, reports_ms=20, profile="kst-ext") as there:
        found = there.run(there.driver.scan((), tuple(rate for rate in RATES if rate != 500_000)))
        assert there.sim().errors == 0
        assert [one.rate for one in found] == [250_000], "where it listened first and heard somebody"


def test_a_silent_bus_at_another_rate_loses_one_frame_for_each_rate_that_was_named() -> None:
    with bench(bit_rate=250_000) as there:
        wrong = tuple(rate for rate in RATES if rate not in (250_000, 500_000))
        found = there.run(there.driver.scan((5,), (*wrong, 250_000)))
        assert [(one.node, one.rate) for one in found] == [(5, 250_000)]
        assert there.of(Suspicion) == [Suspicion(0, rate, WRONG_RATE) for rate in wrong]
        assert there.sim().errors == len(wrong)


class Deaf(MemoryLink):
    """An adapter that cannot just listen."""

    def tune(self, rate: int, listen_only: bool = False) -> None:
        if listen_only:
            raise LinkError("this adapter has no listen-only mode")
        super().tune(rate, listen_only)


def test_an_adapter_that_cannot_listen_scans_the_rates_it_was_told_all_the_same() -> None:
    with bench(bit_rate=250_000, link=Deaf) as there:
        assert [one.rate for one in there.run(there.driver.scan((5,), (125_000, 250_000)))] == [250_000]


def test_without_a_configured_bus_it_works_as_well() -> None:
    with bench(ids=(5, 6)) as there:
        assert [one.node for one in there.run(scan())] == [5, 6]


def test_frames_of_the_scan_are_of_eight_bytes() -> None:
    with bench() as there:
        seen: list[Data] = []
        watch = there.bus.trace.subscribe(limit=10_000)
        there.run(there.driver.scan())
        seen += [record.data for record in watch if record.direction == "tx"]
        assert {len(one.data) for one in seen if isinstance(one, CanFrame)} == {8}


@pytest.mark.parametrize(("spoken", "taken"), [("std", "ext"), ("ext", "std")])
def test_a_scan_without_a_reply_names_the_other_id_format(spoken: str, taken: str) -> None:
    with bench(settings={"id_format": spoken}, id_format=taken) as there:
        assert there.run(there.driver.scan()) == []
        assert there.of(Suspicion) == [Suspicion(0, 500_000, OTHER_FORMAT)]


def test_where_somebody_answers_the_other_id_format_is_not_tried() -> None:
    with bench() as there:
        there.run(there.driver.scan())
        assert all(len(frame.partition("#")[0]) == 3 for frame in there.sent())


def test_two_servos_whose_answers_break_each_other_are_suspected_without_bus_errors() -> None:
    with bench(ids=(5, 5, 6), line=NoErrors()) as there:
        there.simulator.servos[1].raw_position = 3
        assert [one.node for one in there.run(there.driver.scan())] == [5, 6]
        assert there.of(Suspicion) == [Suspicion(5, 500_000, TORN)]
