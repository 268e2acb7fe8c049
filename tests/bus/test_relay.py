"""Handing the pump from thread to thread, and giving back what an interrupted thread still holds."""

from __future__ import annotations

import threading
import time

import pytest

from motorbus.bus.ticket import Flight
from motorbus.core.operation import Listen, Operation
from motorbus.errors import NoReply
from tests.bus.responder import memory_bus, position


def test_an_exchange_on_an_idle_bus_is_answered_by_the_thread_that_starts_it() -> None:
    bus, _ = memory_bus()
    flight = Flight(position(1))
    bus.relay.start(flight)
    assert flight.done
    assert bus.relay.pumper is None


def test_while_another_thread_pumps_an_exchange_is_queued() -> None:
    bus, _ = memory_bus()
    bus.relay.pumper = -1
    flight = Flight(position(1))
    bus.relay.start(flight)
    assert not flight.done
    bus.relay.turn()
    assert not flight.done, "sent perhaps, but waited for by the one who pumps"
    bus.relay.pumper = None
    while not flight.done:
        bus.relay.turn()
    assert flight.error is None


def test_recovering_lets_go_of_the_lock_however_often_it_is_held() -> None:
    bus, _ = memory_bus()
    bus.turns.lock.acquire()
    bus.turns.lock.acquire()
    bus.relay.pumper = threading.get_ident()
    bus.relay.recover()
    taken: list[bool] = []
    thread = threading.Thread(target=lambda: taken.append(bus.turns.lock.acquire(timeout=5)))
    thread.start()
    thread.join()
    assert taken == [True]
    assert bus.relay.pumper is None


def test_recovering_when_nothing_is_held_changes_nothing() -> None:
    bus, _ = memory_bus()
    bus.relay.pumper = -1
    bus.relay.recover()
    assert bus.relay.pumper == -1, "another thread's"
    bus.relay.pumper = None
    assert bus.run(position(1)) == 1


def test_a_thread_that_waits_for_something_far_away_holds_up_no_deadline() -> None:
    bus, responder = memory_bus(virtual=False)
    responder.dead = {2}

    def listen() -> Operation[object]:
        return (yield from Listen(lambda notice: False, 1.0))

    thread = threading.Thread(target=lambda: bus.run(listen()))
    thread.start()
    begun = time.monotonic()
    while time.monotonic() < begun + 5 and bus.relay.pumper is None:
        time.sleep(0.001)
    seconds = []
    for _ in range(3):
        before = bus.link.now()
        with pytest.raises(NoReply):
            bus.run(position(2))
        seconds.append(bus.link.now() - before)
    assert min(seconds) < 0.5, "not only when the listener wakes"
    thread.join(20)
    bus.close()


def test_the_pump_is_claimed_by_one_and_whoever_left_a_bell_hears_that_it_is_free() -> None:
    bus, _ = memory_bus()
    rung: list[str] = []
    bus.relay.bells.add(lambda: rung.append("free"))
    assert bus.relay.claim()
    assert bus.relay.claim(), "the same thread again"
    claims: list[bool] = []
    thread = threading.Thread(target=lambda: claims.append(bus.relay.claim()))
    thread.start()
    thread.join()
    assert claims == [False]
    assert rung == []
    bus.relay.hand_over()
    assert bus.relay.pumper is None
    assert rung == ["free"]
    assert bus.run(position(1)) == 1
    assert len(rung) > 1, "each time that somebody has pumped"
