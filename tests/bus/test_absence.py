"""A link that is gone, and there again: what fails, what is forgotten, and that nothing is sent twice or late."""

from __future__ import annotations

import asyncio
import threading
from math import inf
from typing import Any

import pytest

from motorbus.bus import absence
from motorbus.bus.aio import AsyncBus
from motorbus.bus.pump import Bus
from motorbus.bus.ticket import Flight
from motorbus.core.operation import Effect, Exchange, Operation, Pause, outcome
from motorbus.errors import Interrupted, LinkLost
from motorbus.families.feetech import FAMILY
from motorbus.link.memory import MemoryLink
from tests.bus.responder import Responder, guarded, memory_bus, position, write
from tests.bus.script import admit_all

AWAY = 0.5
GOAL = 42


def goal(node: int, value: int, **more: Any) -> Exchange[Any]:
    return write(node, GOAL, value, Effect.MOTION)


def pulled(bus: Bus, seconds: float = inf) -> Any:
    link: Any = bus.link
    link.unplug(link.now(), seconds)
    return link


def waited(seconds: float) -> Operation[None]:
    yield from Pause(seconds)


def sent(responder: Responder) -> list[int]:
    return [packet.instruction for packet in responder.heard]


# -- while it is gone ----------------------------------------------------------------------------------------------


def test_everything_fails_at_once_and_says_that_it_is_looked_for() -> None:
    bus, responder = memory_bus()
    bus.run(position(1))
    link, heard = pulled(bus), len(responder.heard)
    for _ in range(3):
        now = link.now()
        with pytest.raises(LinkLost) as told:
            bus.run(position(1))
        assert link.now() == now
        assert "looked for again" in told.value.advice
    assert len(responder.heard) == heard
    assert (bus.turns.losses, bus.turns.gone is None) == (1, False)


def test_a_pause_under_way_is_cut_off_and_one_that_begins_then_is_not() -> None:
    bus, _ = memory_bus()
    link: Any = bus.link
    link.unplug(1.0, 2.0)
    with pytest.raises(LinkLost):
        bus.run(waited(10.0))
    assert link.now() == pytest.approx(1.0)
    bus.run(waited(1.0))
    assert (link.now(), bus.turns.gone is None) == (pytest.approx(2.0), False)
    bus.run(waited(1.5))
    assert (link.now(), bus.turns.gone is None) == (pytest.approx(3.5), True)


def test_where_a_loss_is_the_end_nothing_is_looked_for() -> None:
    bus, _ = memory_bus()
    bus.turns.renewal = None
    pulled(bus, 0.1)
    for _ in range(2):
        with pytest.raises(LinkLost) as told:
            bus.run(waited(1.0))
        assert "looked for" not in told.value.advice
    assert bus.turns.gone is None
    absence.rest(bus.turns, 5.0)
    assert bus.link.now() == 0.0


def test_a_closed_bus_is_not_looked_for() -> None:
    bus, _ = memory_bus()
    pulled(bus, 0.1)
    with pytest.raises(LinkLost):
        bus.run(position(1))
    bus.close()
    with pytest.raises(LinkLost, match="closed"):
        bus.run(position(1))


# -- there again ---------------------------------------------------------------------------------------------------


def test_the_first_call_after_its_return_succeeds_and_begins_with_a_probe() -> None:
    bus, responder = memory_bus()
    assert bus.run(position(1)) == 1
    pulled(bus, AWAY)
    with pytest.raises(LinkLost):
        bus.run(position(1))
    bus.run(waited(AWAY))
    responder.heard.clear()
    assert bus.run(position(1)) == 1
    assert len(responder.heard) == 2, "a probe, and what was asked"


def test_nothing_that_was_known_is_known() -> None:
    bus, _ = memory_bus()
    told: list[str] = []
    bus.turns.anew += (lambda: told.append("anew"),)
    seen: Exchange[Any] = Exchange(
        position(1).request, position(1).replies, repeatable=True, tells_position=True
    )
    bus.run(seen)
    assert 1 in bus.turns.known.seen
    bus.turns.echo.excluded()
    receiver = bus.turns.receiver
    pulled(bus, AWAY)
    with pytest.raises(LinkLost):
        bus.run(position(1))
    bus.link.latency = 0.016  # as an adapter has it that is plugged in anew
    bus.run(waited(AWAY + 0.1))
    turns = bus.turns
    assert told == ["anew"]
    assert dict(turns.known) == {1: None}, "who is there is known still, for a stop must reach him"
    assert (turns.known.seen, turns.echo.present, turns.latency) == ({}, None, 0.016)
    assert turns.receiver is not receiver
    assert all(trust.tainted for trust in turns.trust.nodes.values())


def test_an_answer_of_before_that_comes_then_is_not_believed() -> None:
    bus, responder = memory_bus()
    assert bus.run(position(1)) == 1
    answer, held = responder._answer, []
    responder._answer = lambda node, at, data=b"": held.append((node, data))  # type: ignore[method-assign]
    link: Any = bus.link
    link.unplug(link.now() + 0.001, AWAY)
    with pytest.raises(LinkLost):
        bus.run(position(1))
    responder._answer = answer  # type: ignore[method-assign]
    bus.run(waited(AWAY))
    responder.memory[1][56] = 99
    for node, data in held:  # a bridge has kept it
        answer(node, link.now(), data)
    assert bus.run(position(1)) == 99


def test_no_order_is_sent_later() -> None:
    bus, responder = memory_bus()
    bus.run(position(1))
    link = pulled(bus, AWAY)
    orders = [Flight(goal(1, value)) for value in range(5)]
    with bus.turns.lock:
        for order in orders:
            bus.turns.submit(order, link.now())
    with pytest.raises(LinkLost):
        bus.run(goal(1, 77))
    assert all(isinstance(order.error, LinkLost) for order in orders)
    bus.run(waited(AWAY))
    bus.run(position(1))
    assert responder.memory[1][GOAL] == 0


def test_an_operation_that_began_before_moves_nothing_any_more() -> None:
    bus, responder = memory_bus()

    def stubborn() -> Operation[list[Any]]:
        yield from position(1)
        pulled(bus, AWAY)
        told = [(yield from outcome(goal(1, 50)))]
        yield from Pause(AWAY + 0.1)
        told.append((yield from outcome(goal(1, 60))))
        told.append((yield from outcome(position(1))))
        return told

    first, second, third = bus.run(stubborn())
    assert isinstance(first, LinkLost)
    assert isinstance(second, LinkLost)
    assert "begin it anew" in second.advice
    assert third == 1
    assert responder.memory[1][GOAL] == 0
    bus.run(goal(1, 70))
    assert responder.memory[1][GOAL] == 70


def test_what_cleans_up_behind_it_may_still_let_go_and_lock() -> None:
    bus, responder = memory_bus()
    bus.run(position(1))

    def cut() -> Operation[None]:
        pulled(bus, AWAY)
        yield from outcome(guarded(1, 5))
        yield from Pause(AWAY + 0.1)
        yield from guarded(1, 6)

    bus.run(cut())
    assert (responder.memory[1][20], responder.memory[1][55]) == (6, 1)


# -- stops ---------------------------------------------------------------------------------------------------------


def test_a_latched_stop_stays_latched() -> None:
    bus, responder = memory_bus()
    bus.run(write(1, GOAL, 1, Effect.MOTION))
    link = pulled(bus, 5.0)
    outcome_ = bus.estop()
    assert outcome_.silent == (1,)
    bus.run(waited(6.0 - link.now()))
    assert bus.turns.gone is None
    with pytest.raises(Interrupted):
        bus.run(goal(1, 9))
    assert bus.run(position(1)) == 1
    assert responder.memory[1][GOAL] == 1


def test_a_stop_goes_out_when_the_port_is_there_again_in_a_moment() -> None:
    bus, responder = memory_bus()
    bus.run(write(1, GOAL, 1, Effect.MOTION))
    pulled(bus, 0.1)
    responder.heard.clear()
    assert bus.estop().acknowledged == (1,)
    assert responder.heard


def test_a_stop_of_a_port_that_stays_away_ends_soon() -> None:
    bus, _ = memory_bus()
    bus.run(write(1, GOAL, 1, Effect.MOTION))
    link = pulled(bus)
    now = link.now()
    assert bus.estop().acknowledged == ()
    assert link.now() - now <= 0.5


# -- the other pump, and threads -----------------------------------------------------------------------------------


def test_the_async_pump_does_the_same() -> None:
    async def main() -> None:
        for virtual in (True, False):
            link = MemoryLink(Responder(), virtual=virtual)
            async with AsyncBus(link, FAMILY, admit=admit_all) as bus:
                assert await bus.run(position(1)) == 1
                link.unplug(link.now(), 0.1)
                told = await asyncio.gather(*(bus.run(position(1)) for _ in range(8)), return_exceptions=True)
                assert all(isinstance(one, LinkLost) for one in told)
                await bus.run(waited(0.3))
                assert bus.turns.gone is None
                assert await asyncio.gather(*(bus.run(position(node)) for node in range(1, 9))) == list(
                    range(1, 9)
                )

    asyncio.run(main())


def test_every_thread_is_told_and_every_thread_goes_on() -> None:
    bus, _ = memory_bus(virtual=False)
    link: Any = bus.link
    wrong: list[object] = []
    lost = threading.Semaphore(0)
    again = threading.Event()

    def work(node: int) -> None:
        try:
            while True:
                bus.run(position(node))
        except LinkLost:
            lost.release()
        again.wait(30)
        while True:
            try:
                value = bus.run(position(node))
                break
            except LinkLost:
                again.wait(0)
        if value != node:
            wrong.append(value)

    threads = [threading.Thread(target=work, args=(node,)) for node in range(1, 9)]
    for thread in threads:
        thread.start()
    link.unplug()
    assert all(lost.acquire(timeout=30) for _ in threads)
    link.plug()
    again.set()
    for thread in threads:
        thread.join(30)
    assert not any(thread.is_alive() for thread in threads)
    assert wrong == []
    assert bus.turns.losses >= 1


def test_nobody_waits_for_the_lock_while_a_port_is_opened() -> None:
    """Opening takes its time, and a stop is not to wait for it."""
    bus, _ = memory_bus(virtual=False)
    link: Any = bus.link
    bus.run(position(1))
    held: list[bool] = []

    def taken() -> None:
        held.append(bus.turns.lock.acquire(timeout=30))
        bus.turns.lock.release()

    def slow(losses: int) -> None:
        thread = threading.Thread(target=taken)
        thread.start()
        thread.join(30)
        MemoryLink.renew(link, losses)

    link.renew = slow
    link.unplug()
    for _ in range(2):
        with pytest.raises(LinkLost):
            bus.run(position(1))
    assert held
    assert all(held)
