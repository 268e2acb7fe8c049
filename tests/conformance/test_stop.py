"""An emergency stop works from every state: whatever was going on, everything comes to rest and is acknowledged."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Any

import pytest

from motorbus.core.family import Family
from motorbus.core.request import Effect, Request
from motorbus.errors import Interrupted, MotionError, NoReply
from tests.conformance.test_guarded import guarded
from tests.support.subjects import possible
from tests.support.world import (
    IDS,
    Interrupting,
    StopOutcome,
    World,
    closed,
    kept,
    locks,
    make_bus,
    said,
    sent,
    switch_on,
    world,
)

NODE = IDS[0]
WAY = 0.6  # rad; some servos turn 44° to either side and no more
MOST = 2000


def met(there: World) -> None:
    """Everyone has answered once, so the bus knows them."""
    for node in IDS:
        assert there.device(node).ping() is True


def positions(there: World) -> list[float]:
    return [there.device(node).position() for node in IDS]


def under_way(there: World) -> None:
    """All of them move."""
    for node in IDS:
        device = there.device(node)
        switch_on(device)
        device.move(device.position() + WAY, wait=False)
    there.link.advance(0.05)
    assert [moving(there, node) for node in IDS] == [True] * len(IDS)


def moving(there: World, node: int) -> bool:
    """What it says, or, where it says nothing of the kind, whether it is elsewhere two milliseconds later."""
    state = there.device(node).telemetry()
    if state.moving is not None:
        return bool(state.moving)
    there.link.advance(0.002)
    return bool(there.device(node).position() != state.position)


def assert_at_rest(there: World, outcome: StopOutcome, silent: tuple[int, ...] = ()) -> None:
    """Everyone acknowledged, nobody moves and nobody will."""
    assert sorted(outcome.acknowledged) == [node for node in IDS if node not in silent]
    assert sorted(outcome.silent) == sorted(silent)
    assert outcome.promise
    there.link.advance(1.0)
    before = positions(there)
    there.link.advance(2.0)
    assert positions(there) == pytest.approx(before, abs=1e-3)


def test_when_nobody_is_known_yet(subject: Family) -> None:
    with world(subject) as there, sent(there.bus) as frames:
        assert there.bus.estop().promise
    assert len(frames) >= len(subject.open().stop({}).requests)


def test_without_a_gate(mover: Family) -> None:
    with world(mover) as there:
        met(there)
        under_way(there)
        bus = make_bus(there.link, mover.open(), gate=False)
        for node in IDS:
            assert mover.devices.blocking(bus, node).ping() is True
        assert_at_rest(there, bus.estop())


def test_when_everything_moves(mover: Family) -> None:
    with world(mover) as there:
        met(there)
        begin = positions(there)
        under_way(there)
        assert_at_rest(there, there.bus.estop())
        ways = [abs(end - start) for start, end in zip(begin, positions(there), strict=True)]
        assert all(0 < way < WAY / 2 for way in ways)


def test_when_the_torque_is_off(limp: Family) -> None:
    with world(limp) as there:
        met(there)
        for node in IDS:
            there.device(node).enable_torque()
            there.device(node).disable_torque()
        assert_at_rest(there, there.bus.estop())


def test_when_an_exchange_is_under_way(mover: Family) -> None:
    for number in range(1, 8):
        with world(mover, link=Interrupting) as there:
            met(there)
            under_way(there)
            link: Any = there.link
            link.countdown = number
            while not link.pressed:
                with suppress(KeyboardInterrupt):
                    there.device(NODE).telemetry()
            assert_at_rest(there, there.bus.estop())


def test_after_a_timeout_and_while_one_is_silent(mover: Family) -> None:
    with world(mover) as there:
        met(there)
        under_way(there)
        there.simulator.nodes[NODE].unplug()
        with pytest.raises(NoReply):
            there.device(NODE).telemetry()
        outcome = there.bus.estop()
        there.simulator.nodes[NODE].plug()
        assert_at_rest(there, outcome, silent=(NODE,))
        assert_at_rest(there, there.bus.estop())


def test_twice_and_then_released(mover: Family) -> None:
    with world(mover) as there:
        met(there)
        under_way(there)
        assert_at_rest(there, there.bus.estop())
        assert_at_rest(there, there.bus.estop())
        device = there.device(NODE)
        here = device.position()
        for refused in [getattr(device, "enable_torque", None), lambda: device.move(here + 0.1)]:
            if refused is not None:
                with pytest.raises(Interrupted):
                    refused()
        assert device.position() == pytest.approx(here, abs=1e-3)
        there.bus.reset()
        switch_on(device)
        device.move(here + 0.1)
        assert device.position() == pytest.approx(here + 0.1, abs=0.06)


def test_at_any_moment_of_a_move(mover: Family) -> None:
    """The move of one node and a guarded write of another are under way; the lock is closed in the end."""

    async def stopped_at(number: int) -> bool:
        with world(mover) as there:
            switch_on(there.device(NODE))
            to = there.device(NODE).position() + WAY
            operations = [said(there.device(NODE), "move", to)]
            operations += [guarded(there)] if kept(there.table(NODE)) else []
            bus = there.async_bus()
            for node in IDS:
                await mover.devices.awaiting(bus, node).ping()
            tasks = [asyncio.ensure_future(bus.run(operation)) for operation in operations]
            for _ in range(number):
                await asyncio.sleep(0)
            over = all(task.done() for task in tasks)
            outcome = bus.estop()
            ends = await asyncio.gather(*tasks, return_exceptions=True)
            assert [end for end in ends if end and not isinstance(end, MotionError)] == []
            assert_at_rest(there, outcome)
            for lock in locks(mover):
                assert there.memory(NODE)["lock"] == closed(lock), number
            await bus.close()
        return over

    async def stop_at_each() -> int:
        number = 0
        while not await stopped_at(number):
            number += 1 + number // 5
            assert number < MOST
        return number

    assert asyncio.run(stop_at_each()) > 10


def test_what_stops_does_not_switch_on_or_keep(family: Family) -> None:
    nodes = dict.fromkeys(possible(family, IDS))
    effects = {request.effect for request in family.open().stop(nodes).requests}
    assert effects <= {Effect.NONE, Effect.TORQUE, Effect.MOTION}


def test_stop_frames_are_small_enough_to_hurry(family: Family) -> None:
    def air(request: Request[Any]) -> float:
        return family.open().air_time(request, family.link.rate)

    nodes = dict.fromkeys(possible(family, IDS))
    assert all(air(request) < 0.02 for request in family.open().stop(nodes).requests)


def test_who_can_hold_instead_of_letting_go_takes_whom_it_is_to_hold(family: Family) -> None:
    stops, settings = family.link.stops, {option.name for option in family.link.settings}
    assert set(stops) <= {"torque_off", "hold"}
    assert ("estop_hold" in settings) == ("hold" in stops[1:])
