"""Several buses on one event loop: as blocking ones, and a cancelled task that leaves all of them usable."""

from __future__ import annotations

import asyncio
import contextlib
from itertools import pairwise
from typing import Any

import pytest

from motorbus.core.operation import Operation, Pause, Report
from motorbus.errors import LinkLost, NoReply
from tests.bus.responder import LOCK, guarded, position
from tests.bus.several import Several, SeveralAsync, single, wander
from tests.bus.test_concert import AS_GOOD_AS_EQUAL, CLOCKS
from tests.bus.test_concert_interrupted import held, stumble


async def check_usable(several: SeveralAsync) -> None:
    assert {responder.memory[1][LOCK] for responder in several.responders.values()} == {1}
    told = await several.concert.run({name: single(2) for name in several.buses})
    assert set(told.values()) == {2}
    for bus in several.buses.values():
        assert await bus.run(position(3)) == 3
    await several.close()


@pytest.mark.parametrize("virtual", CLOCKS)
def test_each_bus_has_its_own_result_or_error(virtual: tuple[bool, ...]) -> None:
    async def main() -> None:
        several = SeveralAsync(*virtual)
        several.responders["a"].dead = {1}
        told = await several.concert.run({"a": single(1), "b": guarded(1, 9)})
        assert isinstance(told["a"], NoReply)
        assert told["b"] is None
        await check_usable(several)

    asyncio.run(main())


def test_blocking_and_async_leave_equal_traces() -> None:
    blocking = Several(True, True, True)
    watches = [bus.trace.subscribe() for bus in blocking.buses.values()]
    blocking.concert.run({name: wander(7, name, 0.0, []) for name in blocking.buses})

    async def main() -> list[list[Any]]:
        several = SeveralAsync(True, True, True)
        others = [bus.trace.subscribe() for bus in several.buses.values()]
        await several.concert.run({name: wander(7, name, 0.0, []) for name in several.buses})
        return [list(watch) for watch in others]

    assert asyncio.run(main()) == [list(watch) for watch in watches]


def test_who_acts_acts_at_the_time_that_all_clocks_show() -> None:
    async def main() -> list[tuple[float, str]]:
        several = SeveralAsync(True, True, True)
        await several.buses["b"].run(iter(Pause(5.0)))
        log: list[tuple[float, str]] = []
        await several.concert.run(
            {
                name: wander(seed, name, several.origins[name], log)
                for seed, name in enumerate(several.buses, 1)
            }
        )
        return log

    log = asyncio.run(main())
    assert len(log) == 90
    assert log[0][0] >= 5.0
    assert all(later[0] - sooner[0] > -AS_GOOD_AS_EQUAL for sooner, later in pairwise(log))


def test_a_virtual_clock_beside_a_real_one_never_runs_ahead_of_it() -> None:
    async def main() -> list[float]:
        several = SeveralAsync(True, False)
        await several.buses["a"].run(iter(Pause(0.02)))
        ahead: list[float] = []

        def work(name: str) -> Operation[None]:
            for _ in range(10):
                now = yield from Pause(0.002)
                wall = several.buses["b"].link.now() - several.origins["b"]
                ahead.append(now - several.origins[name] - wall)
                yield from position(1)

        await several.concert.run({name: work(name) for name in several.buses})
        await several.close()
        return ahead

    ahead = asyncio.run(main())
    assert len(ahead) == 20
    assert max(ahead) < AS_GOOD_AS_EQUAL


@pytest.mark.parametrize("virtual", [(True, True), (False, False), (True, False)])
@pytest.mark.parametrize("steps", range(1, 16, 2))
def test_a_task_cancelled_at_any_await_leaves_every_bus_usable(virtual: tuple[bool, ...], steps: int) -> None:
    async def main() -> None:
        several = SeveralAsync(*virtual)
        work = several.concert.run({name: guarded(1, 9) for name in several.buses})
        task = asyncio.ensure_future(work)
        for _ in range(steps):
            await asyncio.sleep(0)
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):  # or it had ended before
            await task
        await check_usable(several)

    asyncio.run(main())


@pytest.mark.parametrize("times", [1, 2, 3])
def test_a_cancelled_task_raises_when_all_have_cleaned_up(times: int) -> None:
    async def main() -> list[str]:
        several = SeveralAsync(False, False)
        begun, done = asyncio.Event(), list[str]()
        several.buses["a"].report = lambda event: begun.set()

        def telling() -> Operation[None]:
            yield from Report("begun")
            yield from held(done)

        task = asyncio.ensure_future(several.concert.run({"b": held(done), "a": telling()}))
        await begun.wait()
        for _ in range(times):
            task.cancel()
            await asyncio.sleep(0)
        with pytest.raises(asyncio.CancelledError):
            await task
        await check_usable(several)
        return done

    assert asyncio.run(main()) == ["CancelledError", "CancelledError"]


def test_a_coroutine_that_is_closed_cleans_up_at_once() -> None:
    async def main() -> None:
        several = SeveralAsync(True, True)
        coroutine = several.concert.run({name: guarded(1, 9) for name in several.buses})
        for _ in range(4):
            coroutine.send(None)
        coroutine.close()
        await check_usable(several)

    asyncio.run(main())


@pytest.mark.parametrize("virtual", [(True, True, True), (False, False, False), (True, False, True)])
def test_an_error_that_is_not_ours_interrupts_the_others(virtual: tuple[bool, ...]) -> None:
    async def main() -> None:
        several = SeveralAsync(*virtual)
        done: list[str] = []
        with pytest.raises(LookupError):
            await several.concert.run({"a": held(done), "b": stumble(), "c": held(done)})
        assert done == ["LookupError", "LookupError"]
        await check_usable(several)

    asyncio.run(main())


@pytest.mark.parametrize("virtual", [(True, True), (False, False)])
def test_many_tasks_share_the_same_buses(virtual: tuple[bool, ...]) -> None:
    async def main() -> None:
        several = SeveralAsync(*virtual)
        together = [several.concert.run({"a": single(n), "b": position(n + 1)}) for n in range(1, 11)]
        alone = [several.buses["ab"[n % 2]].run(position(n)) for n in range(1, 11)]
        assert await asyncio.gather(*together) == [{"a": n, "b": n + 1} for n in range(1, 11)]
        assert await asyncio.gather(*alone) == list(range(1, 11))
        await several.close()

    asyncio.run(main())


def test_a_bus_that_is_closed_meanwhile_says_so_and_the_others_go_on() -> None:
    async def main() -> None:
        several = SeveralAsync(False, False)

        def close() -> Operation[int]:
            yield from Pause(0.01)
            several.buses["b"].link.close()
            return (yield from single(2))

        told = await several.concert.run({"b": iter(Pause(60.0)), "a": close()})
        assert told["a"] == 2
        assert isinstance(told["b"], LinkLost)
        await several.close()

    asyncio.run(main())
