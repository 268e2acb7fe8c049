"""The bus on an asyncio event loop: procedures of all tasks share one engine."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable, Coroutine, Mapping, Sequence
from math import inf
from threading import get_ident
from typing import Any, Final, Generic, Self, TypeVar
from weakref import WeakMethod

from motorbus.bus.base import IDLE, BaseBus, check_clocks
from motorbus.bus.interrupts import DEFAULTS, SIGNALS
from motorbus.bus.jobs import RequestJob
from motorbus.bus.prepared import Prepared
from motorbus.bus.tasks import Notify, TaskTree, starting
from motorbus.core.request import Request
from motorbus.core.steps import Runnable, discard
from motorbus.errors import LinkError, LinkLost

T = TypeVar("T")

LONGEST: Final = 3600.0
"""s; the longest time that a task waits before it looks again."""
LOOK: Final = 0.001
"""s between two looks at a link without descriptor."""


class AsyncBus(BaseBus):
    """An open bus on the running event loop. Any number of its tasks may call `run`."""

    is_async = True
    _loop: asyncio.AbstractEventLoop | None = None
    _descriptor: int | None = None
    _thread = 0
    _timer: asyncio.TimerHandle | None = None
    _direct: tuple[Prepared, _Call] | None = None
    """The prepared request in flight, and its call; `send` makes it an ordinary attempt before anything else leaves."""

    def run(self, procedure: Runnable[T], report: Notify | None = None) -> Coroutine[Any, Any, T]:
        """Run a procedure as `Bus.run` does. A cancelled task cleans up, then raises CancelledError.

        Ctrl-C is left to the event loop, which cancels the main task.
        """
        # Without a TaskTree: one request without an effect, in real time. Virtual time passes in `_wait` only; the
        # engine compares a request with an effect with the stops since its start, which a TaskTree records.
        if isinstance(procedure, Request) and not procedure.effect and not self.link.virtual:
            return self._transact(procedure)
        return self._run(Owned(procedure), report)

    async def _run(self, owned: Owned, report: Notify | None) -> Any:
        with starting(owned.procedure):
            part: _Part[Any] = _Part(self, owned.procedure, report, asyncio.Event())
        await _run_parts([part])
        return part.tree.result()

    async def _transact(self, request: Request[Any]) -> Any:
        """Carry out one request that changes nothing."""
        with starting():
            call = _Call(request)
        with self.turn:
            try:
                prepared = self.find_prepared(request)
                if prepared is not None and self.write(prepared) is None:
                    prepared = None
            except LinkLost as error:
                self._lost(error)
                raise
            if prepared is not None:
                self._direct = prepared, call
            else:
                self.engine.submit(call, self.link.now())
                self.send()
            self.watch()
        try:
            return await call.future
        except asyncio.CancelledError:
            self.engine.cancel(call)
            raise

    def send(self) -> None:
        """As `BaseBus.send`; a prepared request in flight becomes an attempt like any other first."""
        if self._direct is not None:
            (prepared, call), self._direct = self._direct, None
            self.adopt(prepared, (), call)
        super().send()

    def watch(self) -> None:
        """Have `_look` called when data has come, or at the next deadline."""
        if self.link.virtual:
            return
        loop = asyncio.get_running_loop()
        descriptor = self.link.fileno()
        if loop is not self._loop or descriptor != self._descriptor:
            self._unwatch()
            self._loop, self._descriptor, self._thread = loop, descriptor, get_ident()
            if descriptor is not None and descriptor >= 0 and self.engine.gone is None:
                loop.add_reader(descriptor, _call, WeakMethod(self._look))
        seconds = self.engine.next_deadline() - self.now()
        if self.engine.gone is not None or self.engine.stopping:
            seconds = min(seconds, IDLE)
        elif descriptor is None and not (self.engine.idle and not self.engine.notification_handlers):
            seconds = min(seconds, LOOK)
        if seconds == inf:
            return
        moment = loop.time() + max(0.0, seconds)
        if self._timer is not None:
            if self._timer.when() <= moment:  # it looks again then
                return
            self._timer.cancel()
        self._timer = loop.call_at(moment, _call, WeakMethod(self._wake))

    def _wake(self) -> None:
        self._timer = None
        self._look()

    def _look(self) -> None:
        with self.turn:
            if self._direct is not None:
                self._look_for_reply(*self._direct)
            else:
                self.receive(-inf)
                self.send()
            if not self.engine.idle or self.engine.notification_handlers:
                self.watch()

    def _look_for_reply(self, prepared: Prepared, call: _Call) -> None:
        """Take what has come for a prepared request; what is not its complete reply goes the general path."""
        deadline = prepared.attempt.deadline
        try:
            chunks = self.link.read(-inf)
            if not chunks and self.link.now() < deadline:
                return
            self._direct = None
            value = self.accept(prepared, chunks, deadline)
            if value is None:
                self.adopt(prepared, chunks, call)
                self.send()
            else:
                call.settle(value)
        except LinkError as error:
            self._direct = None
            self._lost(error)
            call.settle(error=self.engine.gone or error)
        except Exception as error:
            call.settle(error=error)

    def _unwatch(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._loop is not None and self._descriptor is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._descriptor)
        self._loop = self._descriptor = None

    def _lost(self, error: LinkError) -> None:
        super()._lost(error)
        self._forget_descriptor()

    def _reconnect(self) -> bool:
        back = super()._reconnect()
        self._forget_descriptor()
        return back

    def _forget_descriptor(self) -> None:
        """The file behind the descriptor is not the same any more."""
        loop = self._loop
        if loop is not None and not loop.is_closed():
            if get_ident() == self._thread:
                self._unwatch()
            else:
                loop.call_soon_threadsafe(self._unwatch)

    def _drop(self) -> None:
        self._forget_descriptor()
        self._hang_up()

    async def close(self) -> None:
        """Give the port back. Nothing is sent: devices keep doing what they were ordered. Calls that wait fail."""
        error = LinkLost("the bus is closed", advice="open it again")
        with self.turn:
            self._unwatch()
            direct, self._direct = self._direct, None
            if direct is not None:
                direct[1].settle(error=error)
            self.engine.lost(error)
        self._hang_up()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()


def _call(method: WeakMethod[Callable[[], None]]) -> None:
    """Call this method, unless its bus was dropped."""
    if (found := method()) is not None:
        found()


def call_in(loop: asyncio.AbstractEventLoop, function: Callable[[], object]) -> None:
    """Call this function in the thread of the loop, from the stop thread; a closed loop needs no call."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(function)


class Owned:
    """A procedure, or a tuple of them, that is closed if the task that was to run it is cancelled before it begins."""

    def __init__(self, procedure: Any) -> None:
        self.procedure = procedure

    def __del__(self) -> None:
        discard(self.procedure)


class _Call(RequestJob):
    """A request whose value a task of the running loop awaits."""

    def __init__(self, request: Request[Any]) -> None:
        super().__init__(request, settled=self._settled)
        self.loop = asyncio.get_running_loop()
        self.thread = get_ident()
        self.future: asyncio.Future[Any] = self.loop.create_future()

    def _settled(self) -> None:
        if get_ident() == self.thread:
            self._complete()
        else:
            call_in(self.loop, self._complete)

    def _complete(self) -> None:
        if self.future.done():
            return
        if self.error is not None:
            self.future.set_exception(self.error)
        else:
            self.future.set_result(self.value)


async def run_on(procedures: Mapping[AsyncBus, Runnable[Any]]) -> dict[AsyncBus, Any]:
    """Run a procedure on each bus at the same time: what each returned, or the MotorbusError that it raised.

    Any other error of one of them, and a cancellation, cancels all; it is raised when all have cleaned up.
    """
    with starting(*procedures.values()):
        check_clocks(procedures)
        news = asyncio.Event()
        parts = [_Part(bus, procedure, None, news) for bus, procedure in procedures.items()]
    await _run_parts(parts)
    return {part.bus: part.tree.outcome() for part in parts}


class _Part(Generic[T]):
    """A procedure on one bus; `news` is set when a tree can go on."""

    def __init__(
        self, bus: AsyncBus, procedure: Runnable[T], report: Notify | None, news: asyncio.Event
    ) -> None:
        bus.check_thread()
        self.bus = bus
        self.news = news
        self._loop = asyncio.get_running_loop()
        self._thread = get_ident()
        self.tree: TaskTree[T] = TaskTree(
            bus.engine, procedure, now=bus.now, report=bus.event_sink(report), settled=self._settled
        )

    def _settled(self) -> None:
        if get_ident() == self._thread:
            self.news.set()
        else:
            call_in(self._loop, self.news.set)

    def advance(self) -> bool:
        """Step the tree and send, until it waits for something; True when it has ended."""
        with self.bus.turn:
            while not self.tree.advance():
                self.news.clear()
                self.bus.send()
                if not self.news.is_set():
                    self.bus.watch()
                    return False
        return True

    def receive(self, until: float) -> None:
        with self.bus.turn:
            self.bus.receive(until)

    def cancel(self, error: BaseException) -> None:
        if not self.tree.root.finished:
            with self.bus.turn:
                self.tree.cancel(error)

    def drop(self) -> None:
        with self.bus.turn:
            self.tree.drop()


async def _run_parts(parts: Sequence[_Part[Any]]) -> None:
    """Run all trees to their end. A cancellation, or an error that is none of ours, cancels them; they clean up."""
    try:
        while True:
            try:
                going = [part for part in parts if not part.advance()]
                if not going:
                    return
                for part in parts:
                    if (error := part.tree.foreign_error()) is not None:
                        raise error
                await _wait(going)
            except GeneratorExit:
                raise
            except BaseException as error:
                for part in parts:
                    part.cancel(error)
    except GeneratorExit:  # the coroutine was closed: nothing is sent any more
        for part in parts:
            part.drop()
        raise


async def _wait(parts: Sequence[_Part[Any]]) -> None:
    """Wait until one of these can go on."""
    if all(part.bus.link.virtual for part in parts):
        events = {part: part.bus.next_event(part.tree.next_moment()) for part in parts}
        moment = min(events.values())
        for part in sorted(parts, key=events.__getitem__):
            part.receive(moment if moment < inf else part.bus.now() + IDLE)
        await asyncio.sleep(0)
        return
    news = parts[0].news
    seconds = min(max(0.0, part.tree.next_moment() - part.bus.now()) for part in parts)
    timer = asyncio.get_running_loop().call_later(min(seconds, LONGEST), news.set)
    try:
        await news.wait()
    finally:
        timer.cancel()


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
