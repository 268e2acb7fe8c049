"""Running procedures: a tree of tasks, and what each of them waits for. No I/O and no clock.

A task has a stack of coroutines: its procedure, and above it the policy of the request that it awaits, if that is in
trouble. What a task awaits is an attempt in `sending` or on the wire, a timer, or its children.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from operator import attrgetter
from threading import local
from types import CoroutineType
from typing import Any, Final, Generic, TypeVar

from motorbus.bus import failures
from motorbus.bus.attempt import Attempt
from motorbus.bus.engine import Engine
from motorbus.bus.nodes import GATED
from motorbus.bus.retry import carry_out
from motorbus.core.request import Notification, Priority, Request, Response, Step
from motorbus.core.steps import (
    Emit,
    Exclusive,
    Gather,
    JournalEntry,
    Runnable,
    SetBitrate,
    Shielded,
    Sleep,
    WaitFor,
    discard,
)
from motorbus.errors import MotorbusError, RequestError

T = TypeVar("T")
PRIORITY: Final = attrgetter("priority")
Notify = Callable[[object], None]

CLEANUP_TIMEOUT: Final = 2.0
"""s for the steps that a cancelled procedure still carries out."""
SECOND_TIMEOUT: Final = 0.25
"""s from a second cancellation on."""
LONG_SLEEP: Final = 0.5
"""s; a sleep of a clean-up from here on waits for a device to come to rest, and extends the timeout."""
LONGEST_EXTENSION: Final = 30.0
"""s by which such sleeps extend it."""


class _Stepping(local):
    """Whether this thread executes the code of a procedure."""

    active = False


STEPPING: Final = _Stepping()


def check_outside() -> None:
    """Raise RequestError inside of a procedure: a call that waits there would wait for itself."""
    if STEPPING.active:
        raise RequestError(
            "a bus or a device method was called inside of a procedure",
            expected="a step, or the driver function: `await feetech.Servo.position.function(servo)`",
            advice="nothing was sent",
        )


class Starting:
    """Closes these procedures if they are refused. Raises RequestError inside of another procedure."""

    def __init__(self, *runnables: object) -> None:
        self._runnables = runnables
        if STEPPING.active:
            discard(runnables)
            check_outside()

    def __enter__(self) -> None:
        return

    def __exit__(self, kind: object, *rest: object) -> None:
        if kind is not None:
            discard(self._runnables)


class Timer:
    """A task sleeps until this moment (s), or until a notification that `listener` takes."""

    def __init__(self, task: Task, until: float) -> None:
        self.task = task
        self.until = until
        self.listener: Callable[[Notification], None] | None = None


class Pause:
    """A task waits until nothing is in flight: to set the rate, or to have the bus alone (`tune` is None)."""

    def __init__(self, task: Task, tune: SetBitrate | None = None) -> None:
        self.task = task
        self.tune = tune
        self.priority = Priority.POLL if tune is None else Priority.CONFIGURATION


class Task:
    """One procedure of a tree, and the one thing that it waits for."""

    def __init__(self, tree: Tree[Any], procedure: Runnable[Any], parent: Task | None = None) -> None:
        if not isinstance(procedure, Step | CoroutineType):
            raise RequestError(
                f"{procedure!r} is neither a procedure nor a step",
                expected="a coroutine of steps, or a step, as feetech.Servo.position.function(servo)",
                advice="nothing was sent",
            )
        self.tree = tree
        self.procedure = procedure
        self.parent = parent
        coroutine = procedure.__await__() if isinstance(procedure, Step) else procedure
        self.stack: list[tuple[Any, Request[Any] | None]] = [(coroutine, None)]
        """Its coroutine, and above it the policy of a request."""
        self.children: list[Task] = []
        self.waits_for: Attempt | Timer | Pause | None = None
        self.owner: Task | None = None if parent is None else parent.owner
        """It runs inside of the exclusive use of this task."""
        self.stop_since = tree.since
        """Epoch from which a stop of its nodes withdraws its present request."""
        self.claims = False  # its end releases exclusive use
        self.joins_one = False  # the value of its only child is its value, not a tuple
        self.entered = False  # its code has begun
        self.finished = False
        self.exempt: bool = parent is not None and parent.exempt
        """The cancellation was thrown into it, or must not be, as for the end of a guard and what that starts."""
        self.value: Any = None
        self.error: BaseException | None = None


class Tree(Generic[T]):
    """Runs one procedure on the engine of one bus. `report` gets its events; it was called at epoch `since`, else now.

    `wake` is called when another thread has ended something that it waits for.
    """

    def __init__(
        self,
        engine: Engine,
        procedure: Runnable[T],
        *,
        now: Callable[[], float],
        report: Notify | None = None,
        wake: Callable[[], None] | None = None,
        since: int = -1,
    ) -> None:
        self.engine = engine
        self.now = now
        self.report = report
        self.wake = wake
        self.since = since if since >= 0 else engine.nodes.epoch
        self.has_ordered = False
        """It has sent a motion, torque or stop request: from now on only stops after its next request end that."""
        self.cancellation: BaseException | None = None
        self.interruption: BaseException | None = None
        """Raised by one of several children, and no Exception: it cancels the others."""
        self.deadline = inf
        """s; from then on every step of the clean-up fails."""
        self.extension = 0.0
        """s by which sleeps of the clean-up may still extend `deadline`."""
        self.ready: deque[tuple[Task, Any, BaseException | None]] = deque()
        """Tasks that can go on, with the value or error of what they have waited for."""
        self.sending: list[Attempt | Pause] = []
        """What is to be sent, by priority, then in order."""
        self.timers: list[Timer] = []
        self.finished = False
        """The procedure has ended."""
        self.root = Task(self, procedure)
        self.ready.append((self.root, None, None))
        engine.end_sleeps.append(self.end_sleeps)

    # -- forward -----------------------------------------------------------------------------------------------

    def advance(self) -> bool:
        """Step every task that can go on; True when the procedure has ended."""
        if self.timers or self.deadline < inf:
            self._expire(self.now())
        while self.ready:
            self._step(*self.ready.popleft())
            if self.interruption is not None and self.cancellation is None:
                self.cancel(self.interruption)
        return self.finished

    def _expire(self, now: float) -> None:
        for timer in tuple(self.timers):
            if timer.until <= now:
                self._end(timer, None if timer.listener is not None else now)
        if now >= self.deadline:
            for task in self._waiting(self.root):
                if task.waits_for is not None:
                    self._drop_wait(task)
                    self.ready.append((task, None, failures.abandoned()))

    def next_moment(self) -> float:
        """The moment (s) at which `advance` has something to do by itself; inf when there is none."""
        if self.finished or not self.timers:
            return inf if self.finished else self.deadline
        return min(self.deadline, *[timer.until for timer in self.timers])

    def result(self) -> T:
        """What the procedure returned; raises its error, or the cancellation."""
        if (error := self.error()) is not None:
            raise error
        value: T = self.root.value
        return value

    def outcome(self) -> Any:
        """What the procedure returned, or its MotorbusError; raises any other error."""
        try:
            return self.result()
        except MotorbusError as error:
            return error

    def error(self) -> BaseException | None:
        """What `result` raises. Errors of the clean-up are notes of the cancellation."""
        if self.cancellation is None:
            return self.root.error
        _add_note(self.cancellation, self.root.error)
        return self.cancellation

    def foreign_error(self) -> BaseException | None:
        """The error that ended the procedure, once, if it is no MotorbusError: it ends other procedures, too."""
        error = self.root.error
        if self.cancellation is not None or isinstance(error, MotorbusError | None):
            return None
        self.cancellation = error
        return error

    def _step(self, task: Task, value: Any, error: BaseException | None) -> None:
        if task.finished:
            return
        task.waits_for = None
        task.entered = True
        coroutine, request = task.stack[-1]
        outer, STEPPING.active = STEPPING.active, True
        try:
            step = coroutine.send(value) if error is None else coroutine.throw(error)
        except StopIteration as end:
            task.stack.pop()
            if request is None:
                self._finish(task, end.value)
            else:
                self._decode(task, request, end.value)
            return
        except BaseException as failure:
            task.stack.pop()
            if request is None:
                self._finish(task, error=failure)
            else:
                self.ready.append((task, None, failure))
            return
        finally:
            STEPPING.active = outer
        try:
            self._begin(task, step)
        except Exception as failure:  # of the gate or of the driver
            self.ready.append((task, None, failure))

    def _decode(self, task: Task, request: Request[Any], answer: Response) -> None:
        try:
            self.ready.append((task, decode(request, answer), None))
        except Exception as error:  # a refusal of the device, or an error of the driver
            self.ready.append((task, None, error))

    def _finish(self, task: Task, value: Any = None, error: BaseException | None = None) -> None:
        task.value, task.error, task.finished = value, error, True
        if error is not None and not isinstance(error, Exception) and task is not self.root:
            self.interruption = error
        self._release(task)
        if task is self.root:
            self._end_tree()
        elif task.parent is not None and all(child.finished for child in task.parent.children):
            self._join(task.parent)

    def _release(self, task: Task) -> None:
        if task.claims and self.engine.exclusive is task.owner:
            self.engine.exclusive = None

    def _end_tree(self) -> None:
        self.finished = True
        if self.end_sleeps in self.engine.end_sleeps:
            self.engine.end_sleeps.remove(self.end_sleeps)

    def _join(self, task: Task) -> None:
        """All children have ended: their values, or the first error, go to the parent; a cancellation goes first."""
        children, task.children = task.children, []
        if self.cancellation is not None and not task.exempt:
            for child in children:
                _add_note(self.cancellation, child.error)
            task.exempt = True
            self.ready.append((task, None, self.cancellation))
            return
        errors = [child.error for child in children if child.error is not None]
        errors.sort(key=lambda error: isinstance(error, Exception))  # an interrupt is raised first
        for other in errors[1:]:
            if str(other) != str(errors[0]):
                errors[0].add_note(f"also: {str(other) or type(other).__name__}")
        values = tuple(child.value for child in children)
        self.ready.append((task, values[0] if task.joins_one else values, errors[0] if errors else None))

    # -- steps -------------------------------------------------------------------------------------------------

    def _begin(self, task: Task, step: Step[Any]) -> None:
        if isinstance(step, Request):
            self._begin_request(task, step)
        elif isinstance(step, Attempt):
            step.direct = False
            self._queue(task, step)
        elif isinstance(step, Gather):
            self._start(task, step, step.runnables)
        elif isinstance(step, Exclusive | Shielded):
            self._start(task, step, (step.runnable,))
        elif isinstance(step, Emit):
            self._emit(task, step.event)
        elif isinstance(step, Sleep | WaitFor):
            self._sleep(task, step, self.now())
        elif isinstance(step, SetBitrate):
            task.waits_for = pause = Pause(task, step)
            self.sending.append(pause)
        else:
            raise RequestError(
                f"a procedure awaited {type(step).__name__}, which is no step",
                cause="asyncio.sleep(), futures and tasks need an event loop; a procedure runs without one",
                advice="await steps of motorbus only, such as Sleep(seconds)",
            )

    def _start(self, task: Task, step: Step[Any], runnables: Sequence[Runnable[Any]]) -> None:
        """Start the children of a task."""
        task.joins_one = not isinstance(step, Gather)
        try:
            task.children = [Task(self, one, task) for one in runnables]
        except RequestError:
            discard(step)
            raise
        if not task.children:
            self.ready.append((task, (), None))
        for child in task.children:
            child.exempt = child.exempt or isinstance(step, Shielded)
            if isinstance(step, Exclusive) and child.owner is None:  # what is nested belongs to the outermost
                child.claims, child.owner = True, child
                child.waits_for = pause = Pause(child)
                self._enqueue(pause)
            else:
                self.ready.append((child, None, None))

    def _begin_request(self, task: Task, request: Request[Any]) -> None:
        engine = self.engine
        if request.effect in GATED:
            task.stop_since = engine.nodes.epoch if self.has_ordered else self.since
            self.has_ordered = True
            engine.check_stops(request, self.since, task.stop_since)
        if self.deadline < inf and self.now() >= self.deadline:
            raise failures.abandoned()
        if request.priority is Priority.STOP:
            engine.note_stop(request)
        excluded = engine.put_off(request, self.now()) if engine.sync.out_of_sync else ()
        if excluded is None:
            self._push(task, request, None)
            return
        attempt = engine.attempt(request)
        attempt.direct, attempt.excluded = True, excluded
        self._queue(task, attempt)

    def _queue(self, task: Task, attempt: Attempt) -> None:
        task.waits_for, attempt.task = attempt, task
        attempt.since, attempt.stop_since, attempt.write_until = self.since, task.stop_since, 0.0
        self._enqueue(attempt)

    def _enqueue(self, one: Attempt | Pause) -> None:
        insort(self.sending, one, key=PRIORITY)

    def put_back(self, attempt: Attempt) -> None:
        """The link was full: this attempt leaves before others of its priority."""
        self.sending.insert(bisect_left(self.sending, attempt.priority, key=PRIORITY), attempt)

    def _push(self, task: Task, request: Request[Any], attempt: Attempt | None) -> None:
        """Let the policy carry out the request that this task awaits."""
        task.stack.append((carry_out(self.engine, request, attempt), request))
        self.ready.append((task, None, None))

    def _emit(self, task: Task, event: object) -> None:
        """The report has been handed over before the next step; what it raises is raised in the task."""
        if self.report is not None:
            self.report(event)
        elif isinstance(event, JournalEntry):
            raise RequestError(
                f"this bus keeps no journal, so it refuses {event.change}()",
                cause="a guarded change is recorded before it begins, so that a crash can be repaired",
                advice="open the bus with motorbus.open(), or give it a `report`; nothing was sent",
            )
        self.ready.append((task, None, None))

    def _sleep(self, task: Task, step: Sleep | WaitFor, now: float) -> None:
        if now >= self.deadline:
            raise failures.abandoned()
        if isinstance(step, WaitFor):
            self._listen(Timer(task, now + step.until), step)
        elif step.seconds <= 0.0:
            self.ready.append((task, now, None))
        else:
            if LONG_SLEEP <= step.seconds <= self.extension:
                self.extension -= step.seconds
                self.deadline += step.seconds
            task.waits_for = timer = Timer(task, now + step.seconds)
            self.timers.append(timer)

    def _listen(self, timer: Timer, step: WaitFor) -> None:
        def listen(notice: Notification) -> None:
            try:
                if step.match(notice):
                    self._end(timer, notice)
            except Exception as error:
                self._end(timer, error=error)

        timer.listener = listen
        timer.task.waits_for = timer
        self.engine.notification_handlers.append(listen)
        self.timers.append(timer)

    def _end(self, timer: Timer, value: Any = None, error: BaseException | None = None) -> None:
        self._remove(timer)
        self.ready.append((timer.task, value, error))
        if self.wake is not None:
            self.wake()

    def _remove(self, timer: Timer) -> None:
        self.timers.remove(timer)
        if timer.listener is not None:
            self.engine.notification_handlers.remove(timer.listener)

    # -- what was sent -----------------------------------------------------------------------------------------

    def end(self, attempt: Attempt) -> None:
        """An attempt of one of these tasks has ended."""
        task, attempt.task = attempt.task, None
        if attempt.error is not None:
            self.ready.append((task, None, attempt.error))
        elif not attempt.direct:
            self.ready.append((task, attempt, None))
        elif attempt.accepted is None:
            self._push(task, attempt.request, attempt)
        else:
            self._decode(task, attempt.request, attempt.accepted)

    def continue_from(self, attempt: Attempt) -> None:
        """The procedure is a request whose first attempt is on the wire, or has failed."""
        task = self.root
        self.ready.clear()
        task.entered = True
        task.stack[-1][0].send(None)
        task.waits_for, attempt.task = attempt, task
        self.has_ordered = attempt.request.effect in GATED

    def fail(self, error: BaseException) -> None:
        """The link is lost: everything that waits to be sent fails."""
        sending, self.sending = self.sending, []
        for one in sending:
            task, one.task = one.task, None
            self.ready.append((task, None, error))

    def send_back(self, attempt: Attempt) -> None:
        """A node of this attempt came out of sync before it could leave."""
        task, attempt.task = attempt.task, None
        if attempt.direct:
            self._push(task, attempt.request, None)
        else:
            self.ready.append((task, None, None))

    # -- cancelled ---------------------------------------------------------------------------------------------

    def cancel(self, error: BaseException) -> None:
        """Throw this into every task that waits; their clean-up gets `CLEANUP_TIMEOUT`, less when called again."""
        if self.cancellation is None:
            self.cancellation = error
            self.deadline = self.now() + CLEANUP_TIMEOUT
            self.extension = LONGEST_EXTENSION
            self._cancel(self.root)
        else:
            self.extension = 0.0
            self.deadline = min(self.deadline, self.now() + SECOND_TIMEOUT)

    def end_sleeps(self, error: BaseException | None = None) -> None:
        """Let every sleep end at once, with this error if there is one; from any thread that has the turn."""
        for timer in tuple(self.timers):
            self._end(timer, self.now(), error)

    def drop(self) -> None:
        """End the procedure where it stands; nothing that its clean-up asks for is carried out."""
        self._end_tree()
        for task in self._waiting(self.root):
            self._drop_wait(task)
            self._release(task)
            task.finished = True
            with suppress(BaseException):
                discard(task.procedure)
            for coroutine, _ in reversed(task.stack):
                with suppress(BaseException):  # it raises, or awaits a step, where it is closed
                    coroutine.close()

    def _cancel(self, task: Task) -> None:
        if task.finished or task.exempt:
            return
        if not task.entered:
            self._drop_wait(task)
            discard(task.procedure)
            self._finish(task, error=self.cancellation)
        elif task.children:
            for child in tuple(task.children):
                self._cancel(child)
        else:
            task.exempt = True
            self._drop_wait(task)
            self.ready.append((task, None, self.cancellation))

    def _drop_wait(self, task: Task) -> None:
        """A task waits no more. A request in flight keeps its lane until its reply or its deadline."""
        wait, task.waits_for = task.waits_for, None
        if isinstance(wait, Timer):
            if wait in self.timers:
                self._remove(wait)
        elif wait is not None:
            wait.task = None
            if wait in self.sending:
                self.sending.remove(wait)
        self.ready = deque(one for one in self.ready if one[0] is not task)

    def _waiting(self, task: Task) -> list[Task]:
        if task.finished:
            return []
        return [task, *(leaf for child in task.children for leaf in self._waiting(child))]


def decode(request: Request[Any], answer: Response) -> Any:
    """The value of an answered request."""
    return answer if request.decode is None else request.decode(answer)


def _add_note(error: BaseException, other: BaseException | None) -> None:
    if other is None or other is error:
        return
    lines = [getattr(other, "summary", "") or str(other) or type(other).__name__]
    lines += getattr(other, "__notes__", ())
    for line in lines:
        if line not in getattr(error, "__notes__", ()):
            error.add_note(line)
