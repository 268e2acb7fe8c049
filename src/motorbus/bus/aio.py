"""The bus on an asyncio event loop.

A thread of the bus runs its procedures with the blocking engine; the loop only waits for their ends, so a stop or a
slow device never blocks it. In virtual time, which passes only while a program waits, a task of the loop does the same.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections import deque
from collections.abc import Callable, Coroutine, Iterable, Mapping
from functools import partial
from queue import SimpleQueue
from threading import Thread
from typing import Any, Final, Self, TypeVar
from weakref import WeakKeyDictionary

from motorbus.bus.base import BaseBus, check_clocks
from motorbus.bus.interrupts import DEFAULTS, SIGNALS
from motorbus.bus.running import Part, wait_for
from motorbus.bus.tasks import Notify, Tree, starting
from motorbus.core.steps import Runnable, discard

T = TypeVar("T")


class AsyncBus(BaseBus):
    """An open bus on the running event loop. Any number of its tasks may call `run`."""

    is_async = True
    _worker: _Worker | None = None

    def run(self, procedure: Runnable[T], report: Notify | None = None) -> Coroutine[Any, Any, T]:
        """Run a procedure as `Bus.run` does. A cancelled task cleans up, then raises CancelledError.

        Ctrl-C is left to the event loop, which cancels the main task. `report` is called in the loop; what it raises
        goes to the exception handler of the loop.
        """
        return self._run(Owned(procedure), report)

    async def _run(self, owned: Owned, report: Notify | None) -> Any:
        with starting(owned.procedure):
            call = self.submit(owned.procedure, report)
        await _finish([call])
        return call.tree.result()

    def submit(self, procedure: Runnable[Any], report: Notify | None = None) -> Call:
        """Let the worker of this bus run the procedure."""
        if self.link.virtual:
            self.check_thread()
            worker: _Worker | _LoopWorker = _LoopWorker.of_loop()
        else:
            worker = self._worker = self._worker or _Worker()
        call = Call(self, procedure, report, worker.wake)
        worker.add(call)
        return call

    def _drop(self) -> None:
        self._close_port()
        if self._worker is not None:
            self._worker.end()

    async def close(self) -> None:
        """Give the port back. Nothing is sent: devices keep doing what they were ordered. Calls that wait fail."""
        self._drop()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()


class Owned:
    """A procedure, or a tuple of them, that is closed if the task that was to run it is cancelled before it begins."""

    def __init__(self, procedure: Any) -> None:
        self.procedure = procedure

    def __del__(self) -> None:
        discard(self.procedure)


class Call:
    """A procedure that a worker runs; `ended` is set in the loop.

    `cancellations` are errors with which the worker cancels it, None to end it where it stands.
    """

    def __init__(
        self, bus: AsyncBus, procedure: Runnable[Any], report: Notify | None, wake: Callable[[], None]
    ) -> None:
        self.bus = bus
        self.wake = wake
        self.loop = asyncio.get_running_loop()
        self.ended: asyncio.Future[None] = self.loop.create_future()
        self.cancellations: deque[BaseException | None] = deque()
        observer = report or bus.report
        if observer is not None and not bus.link.virtual:
            observer = partial(_call_in, self.loop, observer)
        self.tree: Tree[Any] = Tree(
            bus.engine, procedure, now=bus.link.now, report=bus.event_sink(observer), wake=wake
        )

    def request_end(self, request: BaseException | None) -> None:
        """Cancel the procedure with this error; None: end it where it stands."""
        self.cancellations.append(request)
        self.wake()

    def end_as_requested(self) -> None:
        """Carry out what was asked; the caller has the turn."""
        if self.loop.is_closed() and self.tree.cancellation is None:
            self.tree.cancel(asyncio.CancelledError())
        while self.cancellations:
            error = self.cancellations.popleft()
            if error is not None:
                self.tree.cancel(error)
            elif not self.tree.finished:
                self.tree.drop()


async def _finish(calls: Iterable[Call]) -> None:
    """Wait until all have ended. A cancellation, or an error that is none of ours, cancels them; they clean up."""
    calls = list(calls)
    cancellation: BaseException | None = None
    try:
        while going := [call.ended for call in calls if not call.ended.done()]:
            error: BaseException | None = None
            try:
                await asyncio.wait(going, return_when=asyncio.FIRST_COMPLETED)
            except asyncio.CancelledError as cancelled:
                error = cancellation = cancelled
            else:
                if len(calls) > 1:
                    ended = [call for call in calls if call.ended in going and call.ended.done()]
                    error = next(filter(None, (call.tree.foreign_error() for call in ended)), None)
            if error is not None:
                for call in calls:
                    call.request_end(error)
    except BaseException:  # the coroutine was closed: nothing is sent any more
        for call in calls:
            call.request_end(None)
        raise
    if cancellation is not None and all(call.tree.cancellation is None for call in calls):
        raise cancellation  # all had ended before


async def run_on(procedures: Mapping[AsyncBus, Runnable[Any]]) -> dict[AsyncBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    Any other error of one of them, and a cancellation, cancels all; it is raised when all have cleaned up.
    """
    with starting(*procedures.values()):
        check_clocks(procedures)
        calls = {bus: bus.submit(procedure) for bus, procedure in procedures.items()}
    await _finish(calls.values())
    return {bus: call.tree.outcome() for bus, call in calls.items()}


class _Worker:
    """A thread that runs the procedures of one bus, which it keeps alive only while it has some."""

    def __init__(self) -> None:
        self._wakes: SimpleQueue[None] = SimpleQueue()
        self._inbox: deque[Call] = deque()
        self._ended = False
        Thread(target=self._work, name="motorbus asyncio", daemon=True).start()

    def add(self, call: Call) -> None:
        """Run this procedure, beside those that run."""
        self._inbox.append(call)
        self.wake()

    def wake(self) -> None:
        """Let the thread look at its procedures; from any thread."""
        if self._wakes.empty():
            self._wakes.put(None)

    def end(self) -> None:
        """Let the thread end when its procedures have."""
        self._ended = True
        self.wake()

    def _work(self) -> None:
        while True:
            while not (self._inbox or self._ended):
                self._wakes.get()
            if not self._inbox:
                return
            _serve(self._inbox, self._wakes)


def _serve(inbox: deque[Call], wakes: SimpleQueue[None]) -> None:
    """Run procedures of one bus until all have ended; the last of them is reported when nothing here holds the bus."""
    part: Part | None = Part(inbox[0].bus, inbox, wakes)
    calls: list[Call] = []
    while part is not None:
        ended = _advance(part, inbox, calls)
        if not calls and not inbox:
            part = None
        for loop, future in ended:
            _call_in(loop, _set_result, future)


def _advance(
    part: Part, inbox: deque[Call], calls: list[Call]
) -> list[tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]]:
    """Wait, then step these procedures and those of the inbox; remove those that have ended and give their futures."""
    try:
        if calls:
            part.wait()
        while inbox:
            calls.append(inbox.popleft())
        part.calls, part.trees = calls, [call.tree for call in calls]
        part.advance(-1.0)
    except BaseException as error:  # a fault of the bus: no call waits for ever
        for call in calls:
            call.tree.drop()
            call.tree.cancellation = error
        part.finished = True
    ended = [call for call in calls if call.tree.finished]
    calls[:] = [call for call in calls if not call.tree.finished]
    part.trees = [call.tree for call in calls]
    part.release_turn()
    return [(call.loop, call.ended) for call in ended]


def _set_result(future: asyncio.Future[None]) -> None:
    if not future.done():
        future.set_result(None)


class _LoopWorker:
    """A task of the loop that runs the procedures of all its buses in virtual time."""

    _of: Final[WeakKeyDictionary[asyncio.AbstractEventLoop, _LoopWorker]] = WeakKeyDictionary()

    def __init__(self) -> None:
        self._calls: list[Call] = []
        self._task: asyncio.Task[None] | None = None

    @classmethod
    def of_loop(cls) -> _LoopWorker:
        """That of the running loop."""
        return cls._of.setdefault(asyncio.get_running_loop(), cls())

    def add(self, call: Call) -> None:
        """Run this procedure, beside those that run."""
        self._calls.append(call)
        if self._task is None:
            self._task = call.loop.create_task(self._work())

    def wake(self) -> None:
        """It looks at its procedures in every turn of the loop."""

    async def _work(self) -> None:
        parts: dict[BaseBus, Part] = {}
        failure: BaseException | None = None
        try:
            while self._calls:
                self._step(parts)
                with contextlib.suppress(asyncio.CancelledError):  # the loop ends: what runs cleans up first
                    await asyncio.sleep(0)
        except BaseException as error:  # a fault of a bus: no call waits for ever
            failure = error
        finally:
            self._task = None
            for call in self._calls:
                call.tree.drop()
                call.tree.cancellation = failure
                _set_result(call.ended)
            self._calls.clear()
            for part in parts.values():
                part.finished = True
                part.release_turn()

    def _step(self, parts: dict[BaseBus, Part]) -> None:
        for bus in {call.bus: None for call in self._calls}:
            part = parts.setdefault(bus, Part(bus))
            part.calls = [call for call in self._calls if call.bus is bus]
            part.trees = [call.tree for call in part.calls]
            part.advance(-1.0)
        for call in tuple(self._calls):
            if call.tree.finished:
                self._calls.remove(call)
                _set_result(call.ended)
        if going := [part for part in parts.values() if not part.finished]:
            wait_for(going)


def _call_in(loop: asyncio.AbstractEventLoop, function: Callable[..., object], *given: object) -> None:
    """Call this function in the thread of the loop; a closed loop needs no call."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(function, *given)


class TaskSignals:
    """On an event loop SIGTERM and SIGHUP cancel the task that makes this; `end` raises SystemExit for them.

    Ctrl-C is left to the event loop. Needs the main thread, and default handlers.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._task = asyncio.current_task()
        self._code = 0
        self._added: list[int] = []
        for number in SIGNALS:
            if number != signal.SIGINT and signal.getsignal(number) in DEFAULTS:
                with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
                    self._loop.add_signal_handler(number, self._cancel, number)
                    self._added.append(number)

    def _cancel(self, number: int) -> None:
        self._code = self._code or 128 + number
        if self._task is not None:
            self._task.cancel()

    def end(self) -> None:
        """Give the default handlers back. Raises SystemExit if a signal came."""
        for number in self._added:
            self._loop.remove_signal_handler(number)
        self._added.clear()
        if self._code:
            raise SystemExit(self._code)
