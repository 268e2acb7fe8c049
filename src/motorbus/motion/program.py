"""Programs over several buses: `async def` functions that await the steps of this module, blocking or on asyncio.

A procedure awaits requests on one bus; a program awaits procedures on several.
"""

from __future__ import annotations

from collections.abc import Coroutine, Mapping, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any, Final, TypeAlias, TypeVar

from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import carry_out_batch, exchange_on, run_on
from motorbus.bus.interrupts import interrupts
from motorbus.core.request import Request, Step
from motorbus.core.steps import Runnable, Shielded, Sleep, discard
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, WireError

T = TypeVar("T")
Program: TypeAlias = Coroutine[Step[Any], Any, T]
LOST: Final = (NoReply, WireError, OutcomeUnknown)
"""Errors of one exchange that the next cycle makes good."""
SPIN: Final = 0.0002  # s before a moment in which a blocking program polls the clock


@dataclass(slots=True, eq=False)
class OnBuses(Step["dict[BaseBus, Any]"]):
    """Run a procedure on each bus at the same time; gives the value of each, or its MotorbusError."""

    procedures: Mapping[BaseBus, Runnable[Any]]


@dataclass(slots=True, eq=False)
class Exchange(Step["dict[BaseBus, Any]"]):
    """Send a batch on each bus at the moment `at` (s, link clock); gives the values of each, or its MotorbusError.

    The value of a request that was lost is its error.
    """

    batches: Mapping[BaseBus, Sequence[Request[Any]]]
    at: float = 0.0


async def run(bus: BaseBus, procedure: Runnable[T]) -> T:
    """Run one procedure on one bus."""
    value = (await OnBuses({bus: procedure}))[bus]
    if isinstance(value, MotorbusError):
        raise value
    return value  # type: ignore[no-any-return]


def drive(program: Program[T]) -> T:
    """Run a program in this thread. A signal is raised in it between two steps, when each bus has cleaned up."""
    with interrupts():
        return _drive(program, shield=False)


def _drive(program: Program[T], *, shield: bool) -> T:
    value: Any = None
    error: BaseException | None = None
    while True:
        try:
            step = program.throw(error) if error is not None else program.send(value)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        value = error = None
        try:
            if isinstance(step, Shielded):
                value = _drive(step.runnable, shield=True)  # type: ignore[arg-type]
            elif isinstance(step, OnBuses):
                value = run_on(_shielded(step.procedures) if shield else step.procedures)
            else:
                assert isinstance(step, Exchange)
                _wait_until(next(iter(step.batches)), step.at)
                value = exchange_on(step.batches, LOST)  # type: ignore[arg-type]
        except BaseException as caught:
            error = caught


def _wait_until(bus: BaseBus, moment: float) -> None:
    pause = moment - bus.now() - (0.0 if bus.link.virtual else SPIN)
    if pause > 0:
        run_on({bus: Sleep(pause)})
    while not bus.link.virtual and monotonic() < moment:
        pass


async def drive_async(program: Program[T]) -> T:
    """Run a program on asyncio. A cancelled task cleans up first."""
    try:
        return await _drive_async(program, shield=False)
    finally:
        discard(program)


async def _drive_async(program: Program[T], *, shield: bool) -> T:
    from motorbus.bus import aio

    value: Any = None
    error: BaseException | None = None
    while True:
        try:
            step = program.throw(error) if error is not None else program.send(value)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        value = error = None
        try:
            if isinstance(step, Shielded):
                value = await _drive_async(step.runnable, shield=True)  # type: ignore[arg-type]
                continue
            if isinstance(step, OnBuses):
                procedures = step.procedures
            else:
                assert isinstance(step, Exchange)
                bus = next(iter(step.batches))
                if (pause := step.at - bus.now()) > 0:
                    await aio.run_on({bus: Sleep(pause)})  # type: ignore[dict-item]
                procedures = {bus: carry_out_batch(batch, LOST) for bus, batch in step.batches.items()}
            value = await aio.run_on(_shielded(procedures) if shield else procedures)  # type: ignore[arg-type]
        except GeneratorExit:
            raise
        except BaseException as caught:
            error = caught


def _shielded(procedures: Mapping[BaseBus, Runnable[Any]]) -> dict[BaseBus, Runnable[Any]]:
    return {bus: Shielded(procedure) for bus, procedure in procedures.items()}


def raise_first(values: Mapping[Any, Any]) -> None:
    """Raise the first MotorbusError of these values, with a note for each other."""
    errors = [value for value in values.values() if isinstance(value, MotorbusError)]
    for other in errors[1:]:
        if other.summary != errors[0].summary:
            errors[0].add_note(f"also: {other.summary}")
    if errors:
        raise errors[0]
