"""Steps are values; `await` gives each the type of its value; `with_cleanup` always cleans up."""

from __future__ import annotations

from inspect import CORO_CLOSED, getcoroutinestate
from typing import Any, assert_type

import pytest

from motorbus.core.request import Expected, Notification, Request, Step
from motorbus.core.steps import (
    Emit,
    Exclusive,
    Gather,
    Guard,
    Procedure,
    Runnable,
    SetBitrate,
    Shielded,
    Sleep,
    WaitFor,
    catch,
    discard,
    gather,
    with_cleanup,
)
from motorbus.errors import MotorbusError, NoReply
from tests.families.player import played


def number(value: int) -> Request[int]:
    return Request(bytes([value]), (Expected(1, 1, 1),), lambda answer: answer.replies[0].data[0])


async def everything() -> str:
    one = await number(1)
    assert_type(one, int)
    several = await gather(number(2), number(3))
    assert_type(several, tuple[int, int])
    alone = await Exclusive(number(4))
    assert_type(alone, int)
    await Sleep(0.1)
    notice = await WaitFor(lambda n: True, 1.0)
    assert_type(notice, Notification | None)
    await SetBitrate(500_000)
    await Emit("event")
    return f"{one} {several} {alone} {notice}"


def test_every_step_yields_itself_and_returns_what_is_sent_in() -> None:
    operation = everything()
    kinds: list[type[Step[Any]]] = []
    answers: list[object] = [1, [2, 3], 4, None, None, None, None]
    step = operation.send(None)
    for answer in answers[:-1]:
        kinds.append(type(step))
        step = operation.send(answer)
    kinds.append(type(step))
    with pytest.raises(StopIteration) as end:
        operation.send(answers[-1])
    assert kinds == [Request, Gather, Exclusive, Sleep, WaitFor, SetBitrate, Emit]
    assert end.value.value == "1 [2, 3] 4 None"


def test_an_outcome_turns_our_errors_into_values_and_no_others() -> None:
    operation: Procedure[int | MotorbusError] = catch(number(1))
    begun = operation.send(None)
    assert isinstance(begun, Request)
    with pytest.raises(StopIteration) as end:
        _ = operation.throw(NoReply("silent"))
    assert isinstance(end.value.value, NoReply)
    operation = catch(number(1))
    begun = operation.send(None)
    with pytest.raises(KeyboardInterrupt):
        _ = operation.throw(KeyboardInterrupt())


class Locked(Guard):
    """Request 1 opens, request 9 closes."""

    def __init__(self, log: list[int]) -> None:
        self.log = log

    async def enter(self) -> None:
        await number(1)

    async def leave(self, error: BaseException | None) -> None:
        await number(9)


def carried_out(operation: Runnable[Any], log: list[int], *, fails_at: int, error: BaseException) -> Any:
    """Run a procedure whose request of this number fails."""

    def carry_out(step: Any) -> Any:
        if isinstance(step, Shielded):
            return played(step.runnable, carry_out)
        log.append(step.wire[0])
        if step.wire[0] == fails_at:
            raise error
        return step.wire[0]

    return played(operation, carry_out)


async def changed(log: list[int]) -> int:
    async with Locked(log):
        return await number(2)


ERRORS = [NoReply("silent"), KeyboardInterrupt(), ValueError("bug")]
CASES = [(error, number) for error in ERRORS for number in (0, 1, 2, 9)]
CASES.remove((ERRORS[1], 9))  # a bus raises it when the guard has ended


@pytest.mark.parametrize("kind", ["guard", "with_cleanup"])
@pytest.mark.parametrize(("error", "fails_at"), CASES)
def test_the_end_of_a_guard_follows_its_beginning(kind: str, error: BaseException, fails_at: int) -> None:
    log: list[int] = []
    work = changed(log) if kind == "guard" else with_cleanup(number(2), lambda: number(9))
    if fails_at in ((1, 2, 9) if kind == "guard" else (2, 9)):
        with pytest.raises(type(error)):
            carried_out(work, log, fails_at=fails_at, error=error)
    else:
        assert carried_out(work, log, fails_at=fails_at, error=error) == 2
    opened = [1] if kind == "guard" else []
    assert log == [*opened, *([2] if fails_at != 1 or not opened else []), 9]


@pytest.mark.parametrize("steps", [1, 2], ids=["in enter", "in the block"])
def test_a_procedure_that_is_dropped_leaves_no_guard(steps: int) -> None:
    procedure = changed([])
    for _ in range(steps):
        procedure.send(None)
    procedure.close()  # raises RuntimeError where it awaits another step


def test_a_clean_up_that_fails_is_a_note_of_the_interruption() -> None:
    class Failing(Guard):
        async def leave(self, error: BaseException | None) -> None:
            raise NoReply("the lock is silent")

    async def interrupted() -> None:
        async with Failing():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        carried_out(interrupted(), [], fails_at=0, error=ValueError())
    assert caught.value.__notes__ == ["clean-up failed: the lock is silent"]


def test_what_is_never_started_is_closed_with_all_that_it_was_given() -> None:
    inner = changed([])
    discard(gather(Exclusive(catch(inner))))
    assert getcoroutinestate(inner) == CORO_CLOSED
