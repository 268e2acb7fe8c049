"""The async pump: the same operations awaited, and a cancelled task that leaves the bus usable."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import pytest

from motorbus.core.operation import Operation, Together
from motorbus.errors import LinkLost, NoReply
from tests.bus.responder import LOCK, async_bus, guarded, memory_bus, position, positions


def single(node: int) -> Operation[int]:
    return (yield from position(node))


def several() -> Operation[list[int]]:
    return (yield from Together([position(n) for n in (1, 2, 3)]))


@pytest.mark.parametrize("virtual", [True, False])
def test_the_same_operations_run(virtual: bool) -> None:
    async def main() -> None:
        bus, responder = async_bus(virtual=virtual)
        async with bus:
            assert await bus.run(position(1)) == 1
            assert await bus.run(several()) == [1, 2, 3]
            assert (await bus.run(positions(4, 5))).missing == ()
            responder.dead = {6}
            with pytest.raises(NoReply):
                await bus.run(position(6))

    asyncio.run(main())


def test_blocking_and_async_leave_equal_traces() -> None:
    blocking, _ = memory_bus()
    watch = blocking.trace.subscribe()
    blocking.run(several())
    blocking.run(guarded(1, 5))

    async def main() -> list[Any]:
        bus, _ = async_bus()
        other = bus.trace.subscribe()
        await bus.run(several())
        await bus.run(guarded(1, 5))
        return list(other)

    assert asyncio.run(main()) == list(watch)


@pytest.mark.parametrize("virtual", [True, False])
def test_many_tasks_share_one_bus(virtual: bool) -> None:
    async def work(bus: Any, node: int) -> list[int]:
        return [await bus.run(position(node)) for _ in range(5)]

    async def main() -> None:
        bus, _ = async_bus(virtual=virtual)
        async with bus:
            nodes = [1 + index % 20 for index in range(64)]
            results = await asyncio.gather(*(work(bus, node) for node in nodes))
            assert results == [[node] * 5 for node in nodes]

    asyncio.run(main())


@pytest.mark.parametrize("virtual", [True, False])
@pytest.mark.parametrize("steps", range(1, 16))
def test_a_task_cancelled_at_any_await_leaves_the_bus_usable(virtual: bool, steps: int) -> None:
    async def main() -> None:
        bus, responder = async_bus(virtual=virtual)
        async with bus:
            task = asyncio.ensure_future(bus.run(guarded(1, 9)))
            for _ in range(steps):
                await asyncio.sleep(0)
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):  # or it had ended before
                await task
            assert responder.memory[1][LOCK] == 1
            assert await bus.run(position(1)) == 1
            assert await bus.run(single(2)) == 2

    asyncio.run(main())


def test_a_lost_link_fails_what_waits() -> None:
    async def main() -> None:
        bus, _ = async_bus(virtual=False)
        async with bus:
            link: Any = bus.link
            await bus.run(position(1))
            link.unplug()
            with pytest.raises(LinkLost):
                await bus.run(position(1))

    asyncio.run(main())
