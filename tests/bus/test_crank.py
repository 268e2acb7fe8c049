"""The crank drains before it sends, does not wait when somebody can go on, and survives a lost link."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest

from motorbus.bus.crank import crank, launch
from motorbus.bus.pump import Bus
from motorbus.bus.ticket import Flight, Timer
from motorbus.core.operation import Data, Effect, Exchange, Operation
from motorbus.errors import LinkLost, RequestError
from motorbus.families.feetech import FAMILY, wire
from motorbus.link.memory import MemoryLink
from tests.bus.responder import Responder, memory_bus, position
from tests.bus.script import reply


def as_operation(exchange: Exchange[int]) -> Operation[int]:
    return (yield from exchange)


def test_what_has_arrived_before_the_request_left_is_not_its_answer() -> None:
    bus, responder = memory_bus()
    responder._out.append((0.0, reply(1, 999)))
    assert bus.run(position(1)) == 1
    assert bus.statistics.other["foreign"] == 1


def test_nobody_waits_when_somebody_can_go_on() -> None:
    bus, _ = memory_bus()
    flight = Flight(Exchange(wire.action()))
    bus.turns.submit(flight, 0.0)
    crank(bus.link, bus.turns, inf)
    assert flight.done
    assert bus.link.now() == 0.0


def test_a_crank_waits_no_longer_than_told() -> None:
    bus, _ = memory_bus()
    timer = Timer()
    timer.deadline = 10.0
    bus.turns.submit(timer, 0.0)
    crank(bus.link, bus.turns, 0.1)
    assert bus.link.now() == pytest.approx(0.1)


def test_a_lost_link_fails_what_waits_and_does_not_raise() -> None:
    bus, _ = memory_bus()
    flight = Flight(position(1))
    bus.turns.submit(flight, 0.0)
    bus.link.unplug()  # type: ignore[attr-defined]
    crank(bus.link, bus.turns, inf)
    assert isinstance(flight.error, LinkLost)
    again = Flight(position(1))
    assert not launch(bus.link, bus.turns, again)
    crank(bus.link, bus.turns, inf)  # which looks for the link first
    assert isinstance(again.error, LinkLost)


def test_a_refused_exchange_sends_nothing() -> None:
    bus, responder = memory_bus()
    bus.turns.admit = None
    flight = Flight(Exchange(wire.action(), effect=Effect.MOTION))
    assert not launch(bus.link, bus.turns, flight)
    assert isinstance(flight.error, RequestError)
    assert responder.heard == []


class HeldUp(MemoryLink):
    """The host is held up in the middle of a reply, until long after the deadline; the rest is in the buffer."""

    held_up = 0

    def read(self, until: float) -> list[Data]:
        arrived = super().read(until)
        if arrived and not self.held_up:
            self.held_up = 1
            (frame,) = arrived
            assert isinstance(frame, bytes)
            self._arrived.insert(0, frame[5:])
            self.advance(1.0)
            return [frame[:5]]
        return arrived


@pytest.mark.parametrize("operation", [position(1), as_operation(position(1))])
def test_a_host_that_was_held_up_looks_once_more_before_it_calls_a_node_silent(operation: Any) -> None:
    link = HeldUp(Responder())
    bus = Bus(link, FAMILY)
    assert bus.run(operation) == 1
    assert link.held_up
    assert bus.statistics.of(1).retries == 0
