"""A bus that only listens: nothing leaves, everybody is told why, and notices still come."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus.pump import Bus
from motorbus.core.operation import Alone, CanFrame, Listen, Notice, Operation, Pause, Together, Tune, outcome
from motorbus.errors import LinkError, RequestError
from motorbus.link.memory import MemoryLink
from tests.bus.lanes import RATE, Lanes, Nodes, can_bus, everyone, read
from tests.bus.script import admit_all


def listening(rate: int = 125_000) -> Operation[int]:
    return (yield from Tune(rate, listen_only=True))


def speaking(rate: int = RATE) -> Operation[int]:
    return (yield from Tune(rate))


def link_of(bus: Bus) -> MemoryLink:
    assert isinstance(bus.link, MemoryLink)
    return bus.link


def test_it_reaches_the_link_and_gives_the_rate_before() -> None:
    bus, nodes = can_bus()
    assert bus.run(listening()) == RATE
    assert link_of(bus).listen_only
    assert (link_of(bus).rate, nodes.rate, bus.rate) == (125_000, 125_000, 125_000)
    assert bus.run(speaking()) == 125_000
    assert not link_of(bus).listen_only


def test_every_exchange_is_refused_and_the_link_is_not_lost() -> None:
    bus, nodes = can_bus()
    bus.run(listening(RATE))
    for exchange in (read(1), everyone()):
        with pytest.raises(RequestError, match="only listens") as caught:
            bus.run(exchange)
        assert "nothing was sent" in str(caught.value)
    assert nodes.heard == []
    bus.run(speaking())
    assert bus.run(read(1)) == 100


def test_to_cease_listening_at_the_same_rate_is_a_change_too() -> None:
    bus, _ = can_bus()
    bus.run(listening(RATE))
    assert bus.turns.listening
    assert bus.run(speaking(RATE)) == RATE
    assert not bus.turns.listening


def test_zero_only_asks() -> None:
    bus, _ = can_bus()
    assert bus.run(speaking(0)) == RATE
    bus.run(listening())
    assert bus.run(speaking(0)) == 125_000
    assert bus.turns.listening


def test_notices_are_heard_meanwhile() -> None:
    bus, nodes = can_bus()
    nodes.coming = [(0.01, CanFrame(0x581, bytes(4)))]

    def hear() -> Operation[Notice | None]:
        yield from Tune(RATE, listen_only=True)
        heard = yield from Listen(lambda notice: notice.node == 1, 0.1)
        yield from Tune(RATE)
        return heard

    heard = bus.run(hear())
    assert heard is not None
    assert heard.kind == "report"


def test_who_waits_for_somebody_who_listens_alone_is_not_refused() -> None:
    bus, _ = can_bus()

    def scan() -> Operation[None]:
        yield from Tune(RATE, listen_only=True)
        yield from Pause(0.1)
        yield from Tune(RATE)

    def both() -> Operation[list[Any]]:
        results: list[Any] = yield from Together([_alone(scan()), _after(0.05)])
        return results

    assert bus.run(both())[1] == 100


def _alone(operation: Operation[None]) -> Operation[None]:
    yield from Alone(operation)


def _after(seconds: float) -> Operation[object]:
    yield from Pause(seconds)
    return (yield from outcome(read(1)))


def test_a_link_that_was_opened_so_never_speaks() -> None:
    nodes = Nodes()
    link = MemoryLink(nodes, rate=RATE)
    link.listen_only = True
    family: Any = Lanes()
    bus = Bus(link, family, admit=admit_all)
    for _ in range(2):
        with pytest.raises(RequestError, match="opened listen-only"):
            bus.run(read(1))
        bus.run(speaking(250_000))
    assert link.listen_only
    assert link.rate == 250_000
    assert nodes.heard == []


def test_an_adapter_that_cannot_listen_says_so_and_stays_as_it_was() -> None:
    bus, _ = can_bus()
    link: Any = bus.link

    def refuse(rate: int, listen_only: bool = False) -> None:
        raise LinkError("this adapter cannot listen only")

    link.tune = refuse
    with pytest.raises(LinkError, match="cannot listen"):
        bus.run(listening())
    assert not bus.turns.listening
    assert bus.run(read(1)) == 100
