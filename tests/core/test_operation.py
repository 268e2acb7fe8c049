"""Steps are values; `yield from` gives each the type of its answer; `afterwards` always cleans up."""

from __future__ import annotations

from typing import assert_type

import pytest

from motorbus.core.operation import (
    Alone,
    Due,
    Exchange,
    Listen,
    Notice,
    Operation,
    Pause,
    Report,
    Step,
    Together,
    Tune,
    afterwards,
    outcome,
)
from motorbus.errors import MotorbusError, NoReply


def number(value: int) -> Exchange[int]:
    return Exchange(bytes([value]), (Due(1, 1, 1),), lambda answer: answer.replies[0].data[0])


def everything() -> Operation[str]:
    one = yield from number(1)
    assert_type(one, int)
    several = yield from Together([number(2), number(3)])
    assert_type(several, list[int])
    alone = yield from Alone(number(4))
    assert_type(alone, int)
    yield from Pause(0.1)
    notice = yield from Listen(lambda n: True, 1.0)
    assert_type(notice, Notice | None)
    yield from Tune(500_000)
    yield from Report("event")
    return f"{one} {several} {alone} {notice}"


def test_every_step_yields_itself_and_returns_what_is_sent_in() -> None:
    operation = everything()
    kinds: list[type[Step]] = []
    answers: list[object] = [1, [2, 3], 4, None, None, None, None]
    step = next(operation)
    for answer in answers[:-1]:
        kinds.append(type(step))
        step = operation.send(answer)
    kinds.append(type(step))
    with pytest.raises(StopIteration) as end:
        operation.send(answers[-1])
    assert kinds == [Exchange, Together, Alone, Pause, Listen, Tune, Report]
    assert end.value.value == "1 [2, 3] 4 None"


def test_an_outcome_turns_our_errors_into_values_and_no_others() -> None:
    operation: Operation[int | MotorbusError] = outcome(number(1))
    next(operation)
    with pytest.raises(StopIteration) as end:
        operation.throw(NoReply("silent"))
    assert isinstance(end.value.value, NoReply)
    operation = outcome(number(1))
    next(operation)
    with pytest.raises(KeyboardInterrupt):
        operation.throw(KeyboardInterrupt())


def guarded(log: list[str], fail: BaseException | None = None) -> Operation[int]:
    def body() -> Operation[int]:
        value = yield from number(1)
        if fail is not None:
            raise fail
        return value

    def lock() -> Exchange[int]:
        log.append("lock")
        return number(9)

    return afterwards(body(), lock)


def test_afterwards_cleans_up_and_returns_the_value() -> None:
    log: list[str] = []
    operation = guarded(log)
    next(operation)
    lock = operation.send(7)
    assert isinstance(lock, Exchange)
    assert lock.request == b"\x09"
    with pytest.raises(StopIteration) as end:
        operation.send(None)
    assert end.value.value == 7
    assert log == ["lock"]


@pytest.mark.parametrize("error", [NoReply("silent"), KeyboardInterrupt(), ValueError("bug")])
def test_afterwards_cleans_up_after_any_error(error: BaseException) -> None:
    log: list[str] = []
    operation = guarded(log, error)
    next(operation)
    operation.send(7)
    assert log == ["lock"]
    with pytest.raises(type(error)):
        operation.send(None)


def test_an_interruption_of_the_clean_up_repeats_it() -> None:
    log: list[str] = []
    operation = guarded(log)
    next(operation)
    operation.send(7)
    operation.throw(KeyboardInterrupt())
    assert log == ["lock", "lock"]
    with pytest.raises(KeyboardInterrupt):
        operation.send(None)


def test_a_clean_up_that_fails_is_not_repeated_for_ever() -> None:
    log: list[str] = []
    operation = guarded(log)
    next(operation)
    operation.send(7)
    with pytest.raises(NoReply):
        operation.throw(NoReply("silent"))
    assert log == ["lock"]
