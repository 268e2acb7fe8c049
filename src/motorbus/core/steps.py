"""Procedures and the steps that they await.

A driver function returns a `Runnable`: a procedure, which is a coroutine that awaits *steps*, or, if one request is
enough, the `Request` itself, which may be kept and run again. Which one may depend on what is known of the device. A
step is a plain value: the bus that runs the procedure (`bus/tasks.py`) carries it out; no event loop is involved. A
procedure awaits nothing but steps and procedures.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterable, Sequence
from dataclasses import dataclass
from inspect import CORO_CREATED, getcoroutinestate
from types import CoroutineType
from typing import Any, Final, NamedTuple, Self, TypeAlias, TypeVar, overload

from motorbus.core.request import Notification, Step
from motorbus.errors import MotorbusError

T = TypeVar("T")
T2 = TypeVar("T2")
T3 = TypeVar("T3")
T4 = TypeVar("T4")
T5 = TypeVar("T5")
T_co = TypeVar("T_co", covariant=True)

Procedure: TypeAlias = Coroutine[Step[Any], Any, T]
Runnable: TypeAlias = "Coroutine[Step[Any], Any, T] | Step[T]"  # what a bus runs: a procedure or a step


@dataclass(slots=True, eq=False)
class Gather(Step[T_co]):
    """Procedures that overlap where the bus allows it; gives the tuple of their results; made by `gather`.

    An error in one does not end the others; an interruption (KeyboardInterrupt, MemoryError) ends all. After all have
    ended the first error is raised, with a note for each other; `catch()` around each gives errors as values.
    """

    runnables: Sequence[Runnable[Any]]


@overload
def gather(first: Runnable[T], second: Runnable[T2], /) -> Gather[tuple[T, T2]]: ...
@overload
def gather(first: Runnable[T], second: Runnable[T2], third: Runnable[T3], /) -> Gather[tuple[T, T2, T3]]: ...
@overload
def gather(
    first: Runnable[T], second: Runnable[T2], third: Runnable[T3], fourth: Runnable[T4], /
) -> Gather[tuple[T, T2, T3, T4]]: ...
@overload
def gather(
    first: Runnable[T],
    second: Runnable[T2],
    third: Runnable[T3],
    fourth: Runnable[T4],
    fifth: Runnable[T5],
    /,
) -> Gather[tuple[T, T2, T3, T4, T5]]: ...
@overload
def gather(*runnables: Runnable[T]) -> Gather[tuple[T, ...]]: ...
def gather(*runnables: Runnable[Any]) -> Gather[Any]:
    """Run these procedures so that they overlap where the bus allows it; see `Gather`."""
    return Gather(runnables)


@dataclass(slots=True, eq=False)
class Exclusive(Step[T_co]):
    """A procedure during which the bus sends nothing else, except a stop."""

    runnable: Runnable[T_co]


@dataclass(slots=True, eq=False)
class Sleep(Step[float]):
    """Wait at least `seconds` on the link clock; gives the time (s) then. 0 only reads the clock."""

    seconds: Final[float]


@dataclass(slots=True, eq=False)
class WaitFor(Step["Notification | None"]):
    """Wait at most `until` seconds for a notification that `match` accepts; gives it, or None."""

    match: Final[Callable[[Notification], bool]]
    until: Final[float]


@dataclass(slots=True, eq=False)
class SetBitrate(Step[int]):
    """Set the rate of the link (bit/s) when nothing is in flight; gives the previous rate. 0 only reads it."""

    rate: Final[int]


class Progress(NamedTuple):
    """An event for `Emit`: `done` of `total` units of work, and the present activity."""

    done: int
    total: int
    what: str = ""


class JournalEntry(NamedTuple):
    """An event for `Emit` that must be on disk before the next step: the state of a guarded change."""

    change: str  # the driver function that makes the change, as "set_id"
    state: str  # ASKED, INTENT, OUTCOME, or the name of a step that was reached
    facts: dict[str, object]
    """Of INTENT: plain data that suffices to finish or revert the change, with the id of the device as "node". Optional
    texts for the user: "what" is unfinished, its "cause", and "advice" ({bus} in it is replaced)."""


ASKED: Final = "asked"
"""Requested, conditions not yet checked. Not stored, but refused while another change on the bus is unfinished."""
INTENT: Final = "intent"  # the next step may change something
OUTCOME: Final = "outcome"  # the change has ended; `facts["outcome"]` says how
REACHED: Final = "reached"  # in the facts of a resumed change: its states so far, in order
READABLE: Final = "readable"  # in the facts: True for a change that only reads or leaves readings valid


@dataclass(slots=True, eq=False)
class Emit(Step[None]):
    """Pass an event (progress, an early result, a journal record) to its observers before the next step."""

    event: Final[object]


@dataclass(slots=True, eq=False)
class Shielded(Step[T_co]):
    """A procedure into which no cancellation is thrown: it is raised at this `await` when the procedure has ended.

    For the end of a `Guard` only. From the time-out of the clean-up on its steps fail; see `bus/tasks.py`.
    """

    runnable: Runnable[T_co]


class Guard:
    """A guarded sequence for `async with`: `leave` runs after the block, and also if `enter` raises: a device may have
    received its first request.

    Nothing is thrown into `leave`. If the block was interrupted, an error of `leave` becomes a note of that.
    A procedure that is dropped sends nothing: GeneratorExit never calls `leave`.
    """

    async def enter(self) -> None:
        """Begin the sequence."""

    async def leave(self, error: BaseException | None) -> None:
        """End the sequence; `error` is what is being raised."""
        raise NotImplementedError

    async def __aenter__(self) -> Self:
        try:
            await self.enter()
        except GeneratorExit:
            raise
        except BaseException as error:
            await self._leave(error)
            raise
        return self

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if not isinstance(error, GeneratorExit):
            await self._leave(error)

    async def _leave(self, error: BaseException | None) -> None:
        try:
            await Shielded(self.leave(error))
        except MotorbusError as failure:
            if error is None or isinstance(error, Exception):
                raise
            error.add_note(f"clean-up failed: {failure.summary}")


class _CleanUp(Guard):
    def __init__(self, function: Callable[[], Runnable[object]]) -> None:
        self._function = function

    async def leave(self, error: BaseException | None) -> None:
        await self._function()


async def with_cleanup(runnable: Runnable[T], clean_up: Callable[[], Runnable[object]]) -> T:
    """Run `runnable`, then `clean_up()`, whatever is raised; see `Guard`."""
    async with _CleanUp(clean_up):
        return await runnable


async def catch(runnable: Runnable[T]) -> T | MotorbusError:
    """Run `runnable`; a MotorbusError becomes the value, so that a loop can visit all nodes."""
    try:
        return await runnable
    except MotorbusError as error:
        return error


def discard(runnable: object) -> None:
    """Close a procedure that never starts, and those that it was given; Python warns of a coroutine that is dropped."""
    given: Iterable[object] = ()
    if isinstance(runnable, CoroutineType) and getcoroutinestate(runnable) == CORO_CREATED:
        given = tuple(runnable.cr_frame.f_locals.values()) if runnable.cr_frame else ()
        runnable.close()
    elif isinstance(runnable, list | tuple):
        given = runnable
    elif isinstance(runnable, Gather):
        given = runnable.runnables
    elif isinstance(runnable, Exclusive | Shielded):
        given = (runnable.runnable,)
    for one in given:
        discard(one)
