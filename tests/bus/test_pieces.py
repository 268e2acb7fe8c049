"""Answers in pieces on the straight way: collected until all is there, and taken in by whoever looks meanwhile."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus.pump import Bus
from motorbus.families.feetech import FAMILY
from motorbus.link.base import Delivery, Side
from motorbus.link.memory import MemoryLink
from tests.bus.responder import position
from tests.bus.script import admit_all
from tests.bus.struck import Landings, Struck, Train, kept, order, struck_bus

ALL = (1, 2, 3, 4, 5, 6)
TINY = 1e-9
PIECES = ("apart", "bytes", "split")


def where(found: Any) -> list[int]:
    """Whose values these are."""
    replies, missing = found
    assert missing == ()
    return [key for key, *_ in replies]


@pytest.mark.parametrize("fault", PIECES)
@pytest.mark.parametrize("nodes", [(1,), ALL])
def test_an_answer_in_pieces_lands_as_one_that_comes_whole(
    monkeypatch: pytest.MonkeyPatch, nodes: tuple[int, ...], fault: str
) -> None:
    landings = Landings(monkeypatch)
    bus, _, line = struck_bus()
    exchange = kept(*nodes)
    bus.run(exchange)
    course = exchange.course
    for _ in range(20):
        line.fault = fault
        assert where(bus.run(exchange)) == list(nodes)
        assert bus.turns.idle
        assert not line.fault
    assert len(landings.ids) == 21
    assert exchange.course is course, "it was made anew"
    assert not bus.turns.statistics.nodes[1].errors
    assert not bus.turns.statistics.nodes[1].retries


@pytest.mark.parametrize("fault", PIECES)
def test_goals_may_leave_ahead_of_it(monkeypatch: pytest.MonkeyPatch, fault: str) -> None:
    landings = Landings(monkeypatch)
    bus, _, line = struck_bus()
    exchange = kept(*ALL)
    for _ in range(5):
        line.fault = fault
        assert where(bus.volley(order(), exchange)[1]) == list(ALL)
    assert len(landings.groups) == 5


@pytest.mark.parametrize("fault", PIECES)
@pytest.mark.parametrize("nodes", [(1,), ALL])
def test_whoever_looks_meanwhile_finds_the_pieces_taken_in_and_nothing_is_lost(
    monkeypatch: pytest.MonkeyPatch, nodes: tuple[int, ...], fault: str
) -> None:
    bus, _, line = struck_bus()
    exchange = kept(*nodes)
    bus.run(exchange)
    read, looks = bus.link.read, []

    def looked(until: float) -> Any:
        with bus.turns.lock:
            looks.append(bus.turns.aloft is None)
        return read(until)

    monkeypatch.setattr(bus.link, "read", looked)
    for _ in range(5):
        line.fault = fault
        assert where(bus.run(exchange)) == list(nodes)
        assert bus.turns.idle
    assert len(looks) > 5
    assert not bus.turns.statistics.nodes[1].errors
    assert not bus.turns.statistics.nodes[1].retries


@pytest.mark.parametrize("nodes", [(1,), ALL])
def test_of_what_was_kept_nothing_is_left_for_the_next_answer(nodes: tuple[int, ...]) -> None:
    bus, _, line = struck_bus()
    exchange = kept(*nodes)
    bus.run(exchange)
    line.fault = "split short"
    if len(nodes) == 1:
        assert where(bus.run(exchange)) == [1], "asked again"
        assert bus.turns.statistics.nodes[1].retries == 1
    else:
        assert bus.run(exchange)[1] == nodes
    for _ in range(5):
        assert where(bus.run(exchange)) == list(nodes)


class Doubled(Struck):
    """A byte is doubled on the way, so that the first bytes of the answer look like all of a sound one."""

    def carry(self, sender: Side, data: Any, at: float) -> list[Delivery]:
        if sender is Side.HOST or self.fault != "doubled byte":
            return super().carry(sender, data, at)
        self.fault = ""
        shifted = data[:6] + data[5:]
        pieces = shifted[:3], shifted[3:8], shifted[8:]
        return [Delivery(at + number * 1e-5, Side.HOST, piece) for number, piece in enumerate(pieces)]


def test_a_byte_too_many_behind_the_last_piece_is_seen() -> None:
    first = 5
    second = 255 - (1 + 4 + 2 * first)  # the sum of a packet that says the first byte twice
    line, simulator = Doubled(), Train()
    bus = Bus(MemoryLink(simulator, line=line), FAMILY, admit=admit_all)
    bus.turns.echo.excluded()
    bus.run(position(1))
    exchange = kept(1)
    simulator.memory[1][56:58] = bytes((first, second))
    assert bus.run(exchange) == ([(1, 0, first, second)], ())
    line.fault = "doubled byte"
    assert bus.run(exchange) == ([(1, 0, first, second)], ()), "asked again, as the first answer was none"
    assert not line.fault
    assert [len(data) for data in line.sent[-2:]] == [8, 8]


@pytest.mark.parametrize("nodes", [(1,), ALL])
def test_who_sleeps_sleeps_until_the_last_bit_can_be_here(
    monkeypatch: pytest.MonkeyPatch, nodes: tuple[int, ...]
) -> None:
    bus, _, line = struck_bus()
    slept: list[float] = []
    monkeypatch.setattr(bus, "sleeps", True)
    monkeypatch.setattr(bus.link, "doze", slept.append, raising=False)
    exchange = kept(*nodes)
    for fault in ("", *PIECES):
        line.fault = fault
        before, free = bus.link.now(), bus.turns.free_at
        assert where(bus.run(exchange)) == list(nodes)
        least = max(before, free) + FAMILY.air_time(exchange, 1_000_000)
        assert least - TINY <= slept.pop() <= least + len(nodes) * 1e-5 + TINY, (
            "a byte more in its other form"
        )
    before = bus.link.now()
    bus.volley(order(), exchange)
    assert slept.pop() > before + FAMILY.air_time(exchange, 1_000_000), "the goals go before it"
    assert not slept


def test_a_bus_sleeps_as_its_link_was_told() -> None:
    for told in (True, False):
        link = MemoryLink(Train(), line=Struck())
        link.sleeps, link.virtual = told, False  # type: ignore[attr-defined]
        assert Bus(link, FAMILY).sleeps is told
    assert not Bus(MemoryLink(Train(), line=Struck()), FAMILY).sleeps
