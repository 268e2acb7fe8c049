"""Row L17 on an event loop: a task is cancelled at every await, and Ctrl-C or want of memory falls on any line.

As on a blocking bus: an exception and never a value, nothing left on the bus, the next reads are right, a stop goes
out.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from motorbus.bus.aio import AsyncBus
from tests.conftest import Figures, Rounds
from tests.faults.cutting import NEVER, Outcome, Scissors, Twice, afterwards, cut, laters, places, stuck
from tests.faults.off import are_off
from tests.faults.scenes import KINDS, Scene
from tests.faults.test_interrupts import ERRORS, OFTEN_CUT, VISITS


@contextmanager
def looped(kind: str) -> Iterator[tuple[Scene, asyncio.AbstractEventLoop]]:
    """A scene of this kind on an async bus, and the loop it lives on."""
    loop = asyncio.new_event_loop()
    try:
        there = Scene(KINDS[kind].family, face=AsyncBus)
        there.run = lambda operation: loop.run_until_complete(there.bus.run(operation))
        yield there, loop
    finally:
        loop.close()


def cut_in_loop(
    there: Scene,
    loop: asyncio.AbstractEventLoop,
    kind: str,
    at: int,
    error: type[BaseException],
    later: int = 0,
    scissors: type[Scissors] = Scissors,
) -> Outcome:
    """The operation in a task, cut at a line or two; a task that outlived that is awaited to its end."""
    tasks: list[asyncio.Task[Any]] = []

    def act() -> Any:
        tasks.append(loop.create_task(there.bus.run(KINDS[kind].act(there))))
        return loop.run_until_complete(tasks[0])

    came = cut(act, at, error, later, scissors)
    if tasks and not tasks[0].done():
        loop.run_until_complete(asyncio.wait(tasks))
    return came


def walk(kind: str, error: type[BaseException]) -> Outcome:
    """A task that carries this kind out and is not cut, line by line."""
    with looped(kind) as (there, loop):
        KINDS[kind].prepare(there)
        return cut_in_loop(there, loop, kind, NEVER, error)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", KINDS)
def test_l17_an_interrupt_at_any_line_of_a_task(kind: str, rounds: Rounds, figures: Figures) -> None:
    cuts, wrong = 0, list[str]()
    walk(kind, KeyboardInterrupt)  # what is made at the first time and kept is no line of those that follow
    for error in ERRORS:
        whole = walk(kind, error)
        assert whole.error is None
        for at in places(whole.walked, VISITS, rounds(NEVER, 4)):
            wrong += faults_of_task(kind, at, error)
            cuts += 1
    family, left = KINDS[kind].family, stuck(wrong)
    figures(f"L17 interrupts: {kind}, in a task", family=family, cuts=cuts, stuck=left, wrong=len(wrong))
    assert wrong == []
    assert cuts


def faults_of_task(kind: str, at: int, error: type[BaseException]) -> list[str]:
    """What is wrong when a task of this kind is cut there."""
    with looped(kind) as (there, loop):
        KINDS[kind].prepare(there)
        came = cut_in_loop(there, loop, kind, at, error)
        wrong = [] if came.where is not None else ["it was not cut"]
        wrong += [] if isinstance(came.error, error) else [f"it ended with {came.error!r}, {came.value!r}"]
        wrong += afterwards(there, there.run)
        return [f"{one}, cut at {came.where}" for one in wrong]


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", OFTEN_CUT)
def test_l17_a_second_interrupt_at_any_line_of_the_clean_up_of_a_task(
    kind: str, rounds: Rounds, figures: Figures
) -> None:
    walk(kind, KeyboardInterrupt)  # what is kept from a first time on walks fewer lines
    whole = walk(kind, KeyboardInterrupt)
    cuts, twice, wrong = 0, 0, list[str]()
    for number, at in enumerate(places(whole.walked, 2, rounds(NEVER, 18))):
        for later in laters(number):
            came, found = cut_twice(kind, at, later)
            wrong += [f"{one}, cut at {came.where} and at {came.again}" for one in found]
            cuts += 1
            twice += came.again is not None
    family, left = KINDS[kind].family, stuck(wrong)
    what = f"L17 interrupted twice: {kind}, in a task"
    figures(what, family=family, cuts=cuts, twice=twice, stuck=left, wrong=len(wrong))
    assert wrong == []
    assert twice >= cuts / 2 > 0  # the others were over by then


def cut_twice(kind: str, at: int, later: int) -> tuple[Outcome, list[str]]:
    """What came of a task of this kind that was cut there and so many lines later, and what is wrong then."""
    with looped(kind) as (there, loop):
        KINDS[kind].prepare(there)
        came = cut_in_loop(there, loop, kind, at, KeyboardInterrupt, later, Twice)
        wrong = [] if isinstance(came.error, KeyboardInterrupt) else [f"it ended with {came.error!r}"]
        return came, wrong + afterwards(there, there.run)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", KINDS)
def test_l17_a_task_that_is_cancelled_at_any_await(kind: str, rounds: Rounds, figures: Figures) -> None:
    awaits, cancelled, wrong = 0, True, list[str]()
    step = 1 if rounds(7, 1) == 7 else 7  # every one in the long runs
    count = 0
    while cancelled:
        awaits += step if awaits else 1
        with looped(kind) as (there, loop):
            KINDS[kind].prepare(there)
            ended = loop.run_until_complete(cancelled_after(there, kind, awaits))
            cancelled = isinstance(ended, asyncio.CancelledError)
            count += cancelled
            assert cancelled or not told(kind) or KINDS[kind].done(there, ended), (
                "never a value that is wrong"
            )
            wrong += [f"{one}, cancelled at await {awaits}" for one in afterwards(there, there.run)]
            assert awaits < 10_000, "it has no end"
    family, left = KINDS[kind].family, stuck(wrong)
    figures(f"L17 cancelled: {kind}", family=family, awaits=awaits, cuts=count, stuck=left, wrong=len(wrong))
    assert wrong == []
    assert count


def told(kind: str) -> bool:
    """Whether what it did can be told without asking the device by a blocking bus."""
    return kind.endswith(("read", "dump", "torque"))


async def cancelled_after(there: Scene, kind: str, awaits: int) -> Any:
    """The value, or CancelledError, of a task that is cancelled when it has awaited so often."""
    task = asyncio.ensure_future(there.bus.run(KINDS[kind].act(there)))
    for _ in range(awaits):
        if task.done():
            break
        await asyncio.sleep(0)
    else:
        if not are_off():
            task.cancel()
    return (await asyncio.gather(task, return_exceptions=True))[0]
