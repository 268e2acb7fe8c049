"""Which interruption is raised, and a coroutine that is closed: it cleans up at once, whatever falls into that."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Coroutine, Iterator
from typing import Any

import pytest

from motorbus.bus.interruption import closed, foremost, interrupts
from motorbus.bus.ticket import Ticket
from motorbus.core.operation import Operation, Pause
from motorbus.errors import NoReply
from tests.bus.responder import guarded, position
from tests.bus.several import SeveralAsync, left, single
from tests.bus.test_concert_interrupted import stumble
from tests.conftest import Rounds
from tests.faults.cutting import NEVER, Outcome, Scissors, cut

ERRORS = (KeyboardInterrupt, MemoryError)


@pytest.mark.parametrize(
    ("error", "is_one"),
    [
        (KeyboardInterrupt(), True),
        (asyncio.CancelledError(), True),
        (GeneratorExit(), True),
        (MemoryError(), True),
        (NoReply("silent"), False),
        (ValueError("a bug"), False),
        (None, False),
    ],
)
def test_an_interruption_is_nobodys_failure(error: BaseException | None, is_one: bool) -> None:
    assert interrupts(error) is is_one


def test_what_ends_a_program_is_raised_before_what_ends_a_task() -> None:
    cancelled, stopped, other = asyncio.CancelledError(), KeyboardInterrupt(), MemoryError()
    assert foremost(cancelled) is cancelled
    assert foremost(cancelled, None, ValueError("a bug")) is cancelled
    assert foremost(cancelled, None, stopped, other) is stopped
    assert foremost(ValueError("a bug"), stopped) is stopped
    assert foremost(other, stopped) is other


def test_its_notes_go_along() -> None:
    cancelled, stopped = asyncio.CancelledError(), KeyboardInterrupt()
    cancelled.add_note("a motor may still turn")
    assert foremost(cancelled, stopped).__notes__ == ["a motor may still turn"]
    assert foremost(cancelled, stopped).__notes__ == ["a motor may still turn"], "once"
    assert foremost(stopped, KeyboardInterrupt()) is stopped


def test_what_falls_into_a_closing_is_known_by_it() -> None:
    def awaits() -> Iterator[None]:
        try:
            yield
        except GeneratorExit:
            raise KeyboardInterrupt from ValueError("a cause is no context")

    suspended = awaits()
    next(suspended)
    with pytest.raises(KeyboardInterrupt) as caught:
        suspended.close()  # type: ignore[attr-defined]
    around = caught.value.__context__
    assert isinstance(around, GeneratorExit)
    assert closed(caught.value, None)
    assert closed(GeneratorExit(), around)
    assert not closed(caught.value, around), "that was closed by which this has been awaited"
    assert not closed(KeyboardInterrupt(), None)
    assert not closed(None, None)


class Closing(Scissors):
    """Within a closing nobody gives back a lock, for another may hold it."""

    gives_back = False


def work(several: SeveralAsync, alone: bool) -> Coroutine[Any, Any, object]:
    """A guarded change on one bus by itself, or on all of them."""
    if alone:
        return several.buses["a"].run(guarded(1, 9))
    return several.concert.run({name: guarded(1, 9) for name in several.buses})


async def closed_after(alone: bool, awaits: int, at: int, error: type[BaseException]) -> Outcome | None:
    """What came of a closing that was cut there; None when all had ended before. Nothing may be left of it."""
    several = SeveralAsync(True, True)
    coroutine = work(several, alone)
    for _ in range(awaits):
        try:
            coroutine.send(None)
        except StopIteration:
            return None
    came = cut(coroutine.close, at, error, scissors=Closing)
    assert left(several.buses, several.responders) == [], came.where
    told = await several.concert.run({name: single(2) for name in several.buses})
    assert set(told.values()) == {2}, came.where
    await several.close()
    return came


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("alone", [True, False], ids=["one bus", "several"])
def test_an_interruption_at_any_line_of_a_closing_is_raised_and_everyone_has_cleaned_up(
    alone: bool, error: type[BaseException], rounds: Rounds
) -> None:
    async def main() -> int:
        cuts = awaits = 0
        while (whole := await closed_after(alone, awaits + 1, NEVER, error)) is not None:
            awaits += 1
            assert whole.error is None, "nothing but the closing itself, which Python takes back"
            lines = len(whole.walked)
            for at in range(1, lines + 1, -(-lines // rounds(NEVER, 40))):
                came = await closed_after(alone, awaits, at, error)
                assert came is not None
                assert came.where is None or isinstance(came.error, error), (came.where, came.error)
                cuts += came.where is not None
        return cuts

    assert asyncio.run(main()) >= 100


@pytest.mark.parametrize("alone", [True, False], ids=["one bus", "several"])
def test_one_that_is_closed_within_the_lock_of_another_call_takes_nothing_from_it(alone: bool) -> None:
    """As the garbage collector does, who may come by at any line of the same thread."""

    async def main() -> None:
        several = SeveralAsync(True, True)
        coroutine = work(several, alone)
        coroutine.send(None)
        turns, closings = several.buses["a"].turns, list[bool]()
        submit = turns.submit

        def close_and_submit(ticket: Ticket, now: float) -> None:
            turns.submit = submit  # type: ignore[method-assign]
            coroutine.close()
            closings.append(turns.lock._is_owned())  # type: ignore[attr-defined]
            submit(ticket, now)

        turns.submit = close_and_submit  # type: ignore[method-assign]
        assert await several.buses["a"].run(single(2)) == 2
        assert closings == [True]
        assert left(several.buses, several.responders) == []
        await several.close()

    asyncio.run(main())


def test_who_is_awaited_while_another_is_closed_is_not_closed_by_that() -> None:
    """The end of an async generator may await: others go on while what was cut off there cleans up."""
    ticks = [0]
    between: list[int] = []

    async def others() -> None:
        while True:
            ticks[0] += 1
            await asyncio.sleep(0)

    def cleans_up() -> Operation[None]:
        try:
            yield from Pause(1000.0)
        finally:
            before = ticks[0]
            yield from position(1)
            between.append(ticks[0] - before)

    async def ends(several: SeveralAsync) -> AsyncGenerator[None, None]:
        try:
            yield
        finally:
            with pytest.raises(LookupError):
                await several.concert.run({"a": cleans_up(), "b": stumble()})

    async def main() -> None:
        several = SeveralAsync(True, True)
        beside = asyncio.create_task(others())
        generator = ends(several)
        await anext(generator)
        await generator.aclose()
        beside.cancel()
        await several.close()

    asyncio.run(main())
    assert len(between) == 1
    assert between[0] > 0
