"""What may come between a port that is lost and one that is there again: rates, stops, other threads."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus import absence
from motorbus.bus.crank import push
from motorbus.bus.run import Run
from motorbus.bus.ticket import Flight
from motorbus.core.operation import Exchange, Operation, Tune, afterwards
from motorbus.errors import LinkLost, RequestError
from tests.bus.responder import memory_bus, position
from tests.bus.test_absence import AWAY, goal, pulled, waited


def seen() -> Exchange[Any]:
    return Exchange(position(1).request, position(1).replies, repeatable=True, tells_position=True)


def ordering() -> Operation[Any]:
    return (yield from goal(1, 7))


def test_a_rate_that_is_set_again_while_it_is_gone_is_the_rate_when_it_is_back() -> None:
    bus, _ = memory_bus()
    usual = bus.turns.rate

    def elsewhere() -> Operation[None]:
        yield from Tune(500_000)
        pulled(bus, AWAY)
        yield from position(1)

    with pytest.raises(LinkLost):
        bus.run(afterwards(elsewhere(), lambda: iter(Tune(usual))))
    bus.run(waited(AWAY))
    assert bus.run(position(1)) == 1
    assert (bus.turns.rate, bus.link.rate, bus.turns.untuned) == (usual, usual, False)


def test_a_port_that_is_lost_while_its_rate_is_changed_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    bus, _ = memory_bus()

    def torn(rate: int, listen_only: bool = False) -> None:
        raise LinkLost("it went away")

    monkeypatch.setattr(bus.link, "tune", torn)
    with pytest.raises(LinkLost):
        bus.run(iter(Tune(500_000)))
    assert bus.turns.gone is not None


def test_a_rate_that_cannot_be_set_when_it_is_back_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    bus, _ = memory_bus()
    link, usual = pulled(bus, AWAY), bus.turns.rate
    with pytest.raises(LinkLost):
        bus.run(position(1))
    bus.run(iter(Tune(500_000)))

    def refused(rate: int, listen_only: bool = False) -> None:
        raise RequestError("the adapter cannot")

    monkeypatch.setattr(link, "tune", refused)
    bus.run(waited(AWAY))
    assert bus.run(position(1)) == 1
    assert bus.turns.rate == usual


def test_where_anybody_was_is_forgotten_when_it_is_lost_and_not_only_when_it_is_back() -> None:
    bus, _ = memory_bus()
    bus.run(seen())
    assert bus.turns.known.fresh(bus.link.now())[1] is not None
    pulled(bus)
    with pytest.raises(LinkLost):
        bus.run(position(1))
    assert bus.turns.known.fresh(bus.link.now())[1] is None, "a stop would hold it there when it is back"


def test_nothing_leaves_before_it_was_said_what_is_forgotten() -> None:
    bus, responder = memory_bus()
    link = pulled(bus, AWAY)
    with pytest.raises(LinkLost):
        bus.run(position(1))
    link.plug()  # another thread has just opened it
    with bus.turns.lock:
        bus.turns.submit(Flight(goal(1, 7)), link.now())
    responder.heard.clear()
    push(link, bus.turns)
    link.advance(0.1)
    assert not responder.heard


def test_an_order_is_judged_in_the_moment_in_which_it_is_queued() -> None:
    bus, responder = memory_bus()
    link = pulled(bus, 0.0)

    class Meddling:
        """The lock of the turns; whoever had it before has lost the port, and found it."""

        def __init__(self, own: Any) -> None:
            self.own = own
            self.done = False

        def __enter__(self) -> object:
            self.own.acquire()
            if not self.done:
                self.done = True
                bus.turns.lost(LinkLost("it went away"))
                assert absence.back(bus.turns)
            return self

        def __exit__(self, *exc: object) -> None:
            self.own.release()

    turns: Any = bus.turns
    run = Run(bus.turns, ordering(), now=link.now)
    own, turns.lock = turns.lock, Meddling(turns.lock)
    assert run.advance(), "it has failed"
    turns.lock = own
    with pytest.raises(LinkLost, match="since this was begun"):
        run.result()
    link.advance(0.1)
    assert not responder.heard
