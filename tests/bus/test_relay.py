"""Handing the pump from thread to thread, and giving back what an interrupted thread still holds."""

from __future__ import annotations

import threading

from motorbus.bus.ticket import Flight
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
