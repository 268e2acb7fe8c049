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
from threading import Thread
from typing import Any, Final, Self, TypeVar
from weakref import WeakKeyDictionary

from motorbus.bus.base import BaseBus, check_clocks
from motorbus.bus.blocking import Part, wait_for
from motorbus.bus.interrupts import DEFAULTS, SIGNALS
from motorbus.bus.tasks import Notify, Starting, Tree
from motorbus.bus.turn import Wake
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
        with Starting(owned.procedure):
            call = self.submit(owned.procedure, report)
        await _finish([call])
        return call.tree.result()

    def submit(self, procedure: Runnable[Any], report: Notify | None = None) -> Call:
        """Let the worker of this bus run the procedure; in virtual time that of the loop."""
        if self.link.virtual:
            self.check_thread()
            worker = _loop_worker(asyncio.get_running_loop())
        elif self._worker is None:
            worker = self._worker = _Worker()
            Thread(target=worker.work, name="motorbus asyncio", daemon=True).start()
        else:
            worker = self._worker
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
    """A procedure that a worker runs; `ended` is set in the loop. The worker carries out `orders` with the turn."""

    def __init__(
        self, bus: AsyncBus, procedure: Runnable[Any], report: Notify | None, wake: Callable[[], None]
    ) -> None:
        self.bus = bus
        self.wake = wake
        self.loop = asyncio.get_running_loop()
        self.ended: asyncio.Future[None] = self.loop.create_future()
        self.orders: deque[Callable[[], None]] = deque()
        observer = report or bus.report
        if observer is not None and not bus.link.virtual:
            observer = partial(_call_in, self.loop, observer)
        self.tree: Tree[Any] = Tree(
            bus.engine, procedure, now=bus.link.now, report=bus.event_sink(observer), wake=wake
        )

    def cancel(self, error: BaseException) -> None:
        """Let the worker throw this into the procedure, which cleans up."""
        self.orders.append(partial(self.tree.cancel, error))
        self.wake()

    def drop(self) -> None:
        """Let the worker end the procedure where it stands."""
        self.orders.append(self.tree.drop)
        self.wake()


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
                    call.cancel(error)
    except BaseException:  # the coroutine was closed: nothing is sent any more
        for call in calls:
            call.drop()
        raise
    if cancellation is not None and all(call.tree.cancellation is None for call in calls):
        raise cancellation  # all had ended before


async def run_on(procedures: Mapping[AsyncBus, Runnable[Any]]) -> dict[AsyncBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    Any other error of one of them, and a cancellation, cancels all; it is raised when all have cleaned up.
    """
    with Starting(*procedures.values()):
        check_clocks(procedures)
        calls = {bus: bus.submit(procedure) for bus, procedure in procedures.items()}
    await _finish(calls.values())
    return {bus: call.tree.outcome() for bus, call in calls.items()}


class _Worker:
    """Steps the procedures of calls: in a thread those of one bus, in a task of the loop those of all virtual buses.

    It keeps a bus alive only while it has a call of it.
    """

    def __init__(self) -> None:
        self._inbox: deque[Call] = deque()
        self._wakes = Wake()
        self._calls: list[Call] = []
        self._parts: dict[BaseBus, Part] = {}
        self._ended = False
        self.task: asyncio.Task[None] | None = None  # of the loop

    def add(self, call: Call) -> None:
        """Run this procedure, beside those that run."""
        self._inbox.append(call)
        self.wake()

    def wake(self) -> None:
        """Let the thread look at its procedures; from any thread."""
        self._wakes.set()

    def end(self) -> None:
        """Let the thread end when its procedures have."""
        self._ended = True
        self.wake()

    def work(self) -> None:
        """Run what is added until `end`; for a thread."""
        while True:
            while not (self._inbox or self._ended):
                self._wakes.wait()
            if not self._inbox:
                return
            while self._inbox or self._calls:
                for loop, future in self._step():
                    _call_in(loop, _set_result, future)

    async def work_in_loop(self, loop: asyncio.AbstractEventLoop) -> None:
        """Run what has been added."""
        try:
            while self._inbox or self._calls:
                for _, future in self._step():
                    _set_result(future)
                with contextlib.suppress(asyncio.CancelledError):  # the loop ends: what runs cleans up first
                    await asyncio.sleep(0)
        finally:
            del _LOOP_WORKERS[loop]

    def _step(self) -> list[tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]]:
        """Wait, then step all procedures; the loops and futures of calls that have ended."""
        try:
            if going := [part for part in self._parts.values() if not part.finished]:
                wait_for(going)
            self._take_calls()
            for part in self._parts.values():
                part.advance(-1.0)
        except BaseException as error:  # a fault of the bus: no call waits for ever
            for call in self._calls:
                call.tree.drop()
                call.tree.cancellation = error
        ended = [call for call in self._calls if call.tree.finished]
        self._calls = [call for call in self._calls if not call.tree.finished]
        for part in self._parts.values():
            part.trees = [tree for tree in part.trees if not tree.finished]
            part.finished = not part.trees
            if part.finished or not part.bus.link.virtual:
                part.release_turn()
        if not self._calls:
            self._parts.clear()
        return [(call.loop, call.ended) for call in ended]

    def _take_calls(self) -> None:
        while self._inbox:
            call = self._inbox.popleft()
            self._calls.append(call)
            if call.bus not in self._parts:
                self._parts[call.bus] = Part(call.bus, self._wakes)
            self._parts[call.bus].trees.append(call.tree)
        for call in self._calls:
            if call.loop.is_closed() and call.tree.cancellation is None:
                call.cancel(asyncio.CancelledError())
            while call.orders:
                self._parts[call.bus].orders.append(call.orders.popleft())


_LOOP_WORKERS: Final[WeakKeyDictionary[asyncio.AbstractEventLoop, _Worker]] = WeakKeyDictionary()
"""By loop, what runs its calls in virtual time."""


def _loop_worker(loop: asyncio.AbstractEventLoop) -> _Worker:
    """What runs the calls of this loop in virtual time."""
    worker = _LOOP_WORKERS.get(loop)
    if worker is None:
        worker = _LOOP_WORKERS[loop] = _Worker()
        worker.task = loop.create_task(worker.work_in_loop(loop))
    return worker


def _set_result(future: asyncio.Future[None]) -> None:
    if not future.done():
        future.set_result(None)


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
