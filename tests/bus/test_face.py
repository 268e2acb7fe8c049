"""What both buses show: rate, statistics, trace, notices, whether it is simulated, the latch."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus.face import BusFace
from motorbus.core.family import Readdressed
from motorbus.core.operation import Effect, Exchange, Operation, Report
from motorbus.errors import LimitExceeded
from motorbus.families.feetech import FAMILY
from motorbus.link.memory import MemoryLink
from tests.bus.responder import Responder, memory_bus, position, write


def test_it_shows_its_parts() -> None:
    bus, _ = memory_bus()
    assert bus.simulated
    assert bus.rate == 1_000_000
    watch = bus.trace.subscribe()
    bus.run(position(1))
    assert [record.direction for record in watch] == ["tx", "rx"]
    assert bus.statistics.of(1).ok == 1
    assert len(bus.notices.subscribe()) == 0


def test_the_gate_is_asked_for_motion_and_torque_only() -> None:
    asked: list[Effect] = []

    def admit(exchange: Exchange[Any]) -> None:
        asked.append(exchange.effect)

    bus = type(memory_bus()[0])(MemoryLink(Responder()), FAMILY, admit=admit)
    for effect in Effect:
        bus.run(write(1, 20, 1, effect))
    assert asked == [Effect.TORQUE, Effect.MOTION]


def test_a_refused_motion_does_not_wake_the_stop_thread() -> None:
    def refuse(exchange: Exchange[Any]) -> None:
        raise LimitExceeded("no")

    bus = type(memory_bus()[0])(MemoryLink(Responder(), virtual=False), FAMILY, admit=refuse)
    with pytest.raises(LimitExceeded):
        bus.run(write(1, 42, 1, Effect.MOTION))
    assert isinstance(bus, BusFace)
    assert bus.stopper._thread is None
    bus.close()


def test_who_wants_to_hears_first_that_a_device_is_about_to_answer_to_another_id() -> None:
    bus, _ = memory_bus()
    heard: list[object] = []
    event, other = Readdressed(1, 7), Readdressed(None, 9)

    def tells(what: object) -> Operation[None]:
        yield from Report(what)

    bus.run(tells(event))  # nobody listens
    bus.readdressed = lambda told: heard.append(("first", told))
    bus.run(tells(event))
    bus.run(tells(other), report=heard.append)
    bus.run(tells("something else"))
    assert heard == [("first", event), ("first", other), other]
