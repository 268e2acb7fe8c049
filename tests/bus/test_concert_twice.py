"""Ctrl-C once more while the first one is dealt with, on several buses run as one: each is closed up and let go of.

On an event loop and without one, where all clocks are virtual, where none is, and where some are.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from tests.bus.responder import guarded
from tests.bus.several import Several, SeveralAsync, left, single
from tests.conftest import Figures, Rounds
from tests.faults.cutting import NEVER, Outcome, Twice, cut, laters, places

PATIENCE = 20.0  # s; by then what was interrupted has long cleaned up, or never will


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a second interrupt a quarter of a second is left; a process that gets no processor may miss that."""
    monkeypatch.setattr("motorbus.bus.run.HURRY", PATIENCE)
    monkeypatch.setattr("motorbus.bus.run.CLEAN_UP", PATIENCE)


class Cut(NamedTuple):
    """What came of a guarded change on every bus that was cut, and what is wrong afterwards."""

    came: Outcome
    wrong: list[str]


def blocking(virtual: tuple[bool, ...], at: int, later: int) -> Cut:
    several = Several(*virtual)
    changes = {name: guarded(1, 9) for name in several.buses}
    came = cut(lambda: several.concert.run(changes), at, KeyboardInterrupt, later, Twice)
    wrong = left(several.buses, several.responders)
    if not wrong:
        asked = {name: single(2) for name in several.buses}
        wrong += [] if set(several.concert.run(asked).values()) == {2} else ["the next answers are wrong"]
    several.close()
    return Cut(came, wrong)


def looped(virtual: tuple[bool, ...], at: int, later: int) -> Cut:
    with asyncio.Runner() as runner:
        loop = runner.get_loop()
        several = runner.run(_made(virtual))
        tasks: list[asyncio.Task[Any]] = []

        def act() -> object:
            changes = {name: guarded(1, 9) for name in several.buses}
            tasks.append(loop.create_task(several.concert.run(changes)))
            return loop.run_until_complete(tasks[0])

        came = cut(act, at, KeyboardInterrupt, later, Twice)
        return Cut(came, runner.run(_after(several, tasks)))


async def _made(virtual: tuple[bool, ...]) -> SeveralAsync:
    return SeveralAsync(*virtual)


async def _after(several: SeveralAsync, tasks: list[asyncio.Task[Any]]) -> list[str]:
    """What is wrong when a task that outlived its loop's interruption has come to its end."""
    _, pending = await asyncio.wait(tasks, timeout=PATIENCE) if tasks else ((), ())
    wrong = ["it never ends"] if pending else left(several.buses, several.responders)
    if not wrong:
        asked = several.concert.run({name: single(2) for name in several.buses})
        answers = await asyncio.wait_for(asked, PATIENCE)
        wrong += [] if set(answers.values()) == {2} else ["the next answers are wrong"]
    await several.close()
    return wrong


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("virtual", [(True, True), (False, False), (False, True)])
@pytest.mark.parametrize("run", [blocking, looped])
def test_l17_a_second_interrupt_while_the_first_is_dealt_with_on_several_buses(
    run: Callable[[tuple[bool, ...], int, int], Cut],
    virtual: tuple[bool, ...],
    rounds: Rounds,
    figures: Figures,
) -> None:
    run(virtual, NEVER, 0)  # what is made at the first time and kept is no line of those that follow
    walked = run(virtual, NEVER, 0).came.walked
    cuts, twice, wrong = 0, 0, list[str]()
    for number, at in enumerate(places(walked, 1, rounds(600, 12))):
        for later in laters(number):
            came, found = run(virtual, at, later)
            ended = came.where is None or isinstance(came.error, KeyboardInterrupt)
            found += [] if ended else [f"it ended with {came.error!r}"]
            wrong += [f"{one}, cut at {came.where} and at {came.again}" for one in found]
            cuts += 1
            twice += came.again is not None
    clocks = " and ".join("a virtual clock" if one else "a real one" for one in virtual)
    what = f"L17 interrupted twice: several buses, {run.__name__}, {clocks}"
    figures(what, family="feetech", cuts=cuts, twice=twice, wrong=len(wrong))
    assert wrong == []
    assert twice >= cuts / 2 > 0  # the others were over by then
