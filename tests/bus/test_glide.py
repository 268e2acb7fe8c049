"""The straight way awaited: the values of the usual way, and whatever goes otherwise ends as it does there.

A simulated servo at the other end of a real pseudo-terminal, served by the event loop of the test.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from threading import Thread
from typing import Any

import pytest

import motorbus
from motorbus import feetech
from motorbus.core.family import Simulator
from motorbus.core.operation import Exchange
from motorbus.errors import Interrupted, LinkLost, NoReply
from motorbus.link.pty import PtyMaster
from tests.bus.struck import Landings
from tests.faults.cutting import NEVER, cut, places

STEP = math.tau / 4096
POSITION = feetech.AsyncServo.position.function


class Far:
    """The far end: what the servo says passes `change`, and goes out in the pieces that it gives."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.master = PtyMaster()
        self.simulator: Simulator = feetech.FAMILY.simulator((1, 2, 3))
        self.simulator.tune(1_000_000)
        self.change: Callable[[bytes], list[bytes]] = lambda data: [data]
        self.asked = 0
        self.said = b""
        loop.add_reader(self.master.fileno(), self._hear)

    def _hear(self) -> None:
        self.asked += 1
        self.simulator.receive(self.master.read(), self.loop.time())
        due = self.simulator.due()
        self.loop.call_later(0.0 if due is None else max(0.0, due - self.loop.time()), self._say)

    def _say(self) -> None:
        self.said += b"".join(bytes(data) for _, data in self.simulator.advance(self.loop.time()))  # type: ignore[arg-type]
        due = self.simulator.due()
        if due is not None:  # several answer one question: all of it goes out together
            self.loop.call_later(max(0.0, due - self.loop.time()), self._say)
            return
        said, self.said = self.said, b""
        for number, piece in enumerate(self.change(said)):
            self.loop.call_later(0.002 * number, self.master.write, piece)

    def close(self) -> None:
        if self.master.fileno() >= 0:
            self.loop.remove_reader(self.master.fileno())
            self.master.close()


@asynccontextmanager
async def there() -> AsyncIterator[tuple[Far, Any, feetech.AsyncServo]]:
    """The far end, the bus, and servo 1, which is known."""
    far = Far(asyncio.get_running_loop())
    try:
        async with motorbus.open_async(f"feetech:{far.master.slave_name},baud=1000000") as bus:
            servo = feetech.AsyncServo(bus, 1)
            await servo.prepare()
            await servo.position()
            yield far, bus, servo
    finally:
        far.close()


def run(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(main())


def kept(servo: feetech.AsyncServo) -> Exchange[float]:
    """What `position` runs, of a servo that is known."""
    exchange = POSITION(servo)
    assert isinstance(exchange, Exchange)
    return exchange


def straight(exchange: Exchange[Any]) -> bool:
    """Whether the exchange in the air, or the last one, was answered at one look: then it is not told yet."""
    course = exchange.course
    return any(one.pending for one in (course, course.twin))


def test_it_is_the_straight_way_and_tells_the_same() -> None:
    async def main() -> None:
        async with there() as (far, bus, servo):
            told = [await servo.position() for _ in range(20)]
            assert straight(kept(servo))
            assert told == [2048 * STEP] * 20
            asked, far.asked = far.asked, 0
            assert asked >= 20
            ledger = bus.statistics.nodes[1]
            assert ledger.sent == ledger.ok

    run(main)


@pytest.mark.parametrize("at", [8, 16, 3, 23])
def test_an_answer_in_pieces_lands_too_and_goes_the_usual_way_where_its_last_packet_is_cut(
    monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    landings = Landings(monkeypatch)

    async def main() -> None:
        async with there() as (far, bus, servo):
            others = [feetech.AsyncServo(bus, node) for node in (2, 3)]
            for one in others:
                await one.prepare()
            group = feetech.sync_read_positions([servo, *others])
            far.change = lambda data: [data[:at], data[at:]]
            for _ in range(10):
                found = await bus.run(group)
                assert found.values == dict.fromkeys((1, 2, 3), 2048 * STEP)
                assert bus.turns.idle
            assert (len(landings.groups) > 5) is (at <= 16)

    run(main)


def test_an_answer_in_pieces_and_one_that_is_damaged_are_as_in_the_usual_way() -> None:
    async def main() -> None:
        async with there() as (far, bus, servo):
            far.change = lambda data: [data[:3], data[3:]]
            assert await servo.position() == 2048 * STEP
            spoilt = [True]

            def once(data: bytes) -> list[bytes]:
                wrong = spoilt.pop() if spoilt else False
                return [data[:-1] + bytes((data[-1] ^ 1,)) if wrong else data]

            far.change = once
            assert await servo.position() == 2048 * STEP
            assert bus.statistics.nodes[1].errors["checksum"] == 1
            far.change = lambda data: [data]
            assert await servo.position() == 2048 * STEP

    run(main)


def test_a_servo_that_is_silent_is_told_as_ever_and_heard_again() -> None:
    async def main() -> None:
        async with there() as (far, bus, servo):
            far.change = lambda data: []
            with pytest.raises(NoReply):
                await servo.position()
            far.change = lambda data: [data]
            assert await servo.position() == 2048 * STEP
            assert bus.turns.idle

    run(main)


def test_who_is_cancelled_leaves_it_in_the_air_and_its_answer_to_nobody() -> None:
    async def main() -> None:
        async with there() as (far, bus, servo):
            await servo.position()
            task = asyncio.ensure_future(servo.position())
            await asyncio.sleep(0)
            assert bus.turns.aloft is not None
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert bus.turns.flying, "the answer is still under way"
            far.simulator.nodes[1].raw_position = 1000  # type: ignore[attr-defined]
            assert await servo.position() == 1000 * STEP

    run(main)


def test_a_stop_of_another_thread_ends_it() -> None:
    async def main() -> None:
        async with there() as (far, bus, servo):
            await servo.enable_torque()
            await servo.position()
            far.change = lambda data: []
            task = asyncio.ensure_future(servo.position())
            await asyncio.sleep(0)
            assert bus.turns.aloft is not None
            thread = Thread(target=bus.estop)
            thread.start()
            with pytest.raises(Interrupted):
                await task
            far.change = lambda data: [data]
            while thread.is_alive():
                await asyncio.sleep(0.001)
            assert await servo.position() == 2048 * STEP

    run(main)


def test_a_link_that_is_lost_is_told_at_once_and_to_everybody() -> None:
    async def main() -> None:
        async with there() as (far, _, servo):
            far.close()
            for _ in range(2):
                with pytest.raises(LinkLost):
                    await servo.position()

    run(main)


def test_many_tasks_share_one_exchange() -> None:
    async def main() -> None:
        async with there() as (_, bus, servo):
            found = await asyncio.gather(*(servo.position() for _ in range(30)))
            assert found == [2048 * STEP] * 30
            assert bus.turns.idle

    run(main)


def test_what_is_carried_along_is_not_left_behind() -> None:
    async def main() -> None:
        async with there() as (_, bus, servo):
            steps: list[None] = []
            bus.turns.chores.append(lambda: steps.append(None))
            await servo.position()
            assert steps

    run(main)


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_an_interrupt_at_any_line_leaves_the_bus_usable(
    error: type[BaseException], rounds: Callable[[int], int]
) -> None:
    """The task that was interrupted ends; the lock is free, and the next one reads what is so."""
    loop = asyncio.new_event_loop()
    try:
        loop.run_until_complete(_cut_everywhere(loop, error, rounds(NEVER), _interrupted))
    finally:
        loop.close()


async def _cut_everywhere(
    loop: asyncio.AbstractEventLoop, error: type[BaseException], most: int, act: Callable[..., Any]
) -> None:
    async with there() as (_, bus, servo):
        whole = cut(lambda: act(bus, servo), NEVER, error)
        await _settled(bus, servo)
        for at in places(whole.walked, 1, min(most, 60)):
            came = cut(lambda: act(bus, servo), at, error)
            await _settled(bus, servo, came.where)


def _interrupted(bus: Any, servo: feetech.AsyncServo) -> None:
    """As far as it goes without the loop: it leaves, and whoever awaits it is gone."""
    coroutine = bus.run(kept(servo))
    try:
        coroutine.send(None)
    finally:
        coroutine.close()


def is_free(bus: Any) -> bool:
    """Whether another thread gets the lock within a second."""
    taken: list[bool] = []

    def take() -> None:
        taken.append(bus.turns.lock.acquire(timeout=1.0))
        if taken[0]:
            bus.turns.lock.release()

    thread = Thread(target=take)
    thread.start()
    thread.join()
    return taken == [True]


async def _settled(bus: Any, servo: feetech.AsyncServo, where: object = None) -> None:
    assert is_free(bus), f"somebody holds the lock, cut at {where}"
    assert await servo.position() == 2048 * STEP
