"""The crank drains before it sends, does not wait when somebody can go on, and survives a lost link."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.bus.crank import crank, launch
from motorbus.bus.ticket import Flight, Timer
from motorbus.core.operation import Effect, Exchange
from motorbus.errors import LinkLost, RequestError
from motorbus.families.feetech import wire
from tests.bus.responder import memory_bus, position
from tests.bus.script import reply


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
    assert isinstance(again.error, LinkLost)


def test_a_refused_exchange_sends_nothing() -> None:
    bus, responder = memory_bus()
    bus.turns.admit = None
    flight = Flight(Exchange(wire.action(), effect=Effect.MOTION))
    assert not launch(bus.link, bus.turns, flight)
    assert isinstance(flight.error, RequestError)
    assert responder.heard == []
