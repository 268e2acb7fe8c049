"""Running procedures: a tree of coroutines, and what each of them waits for. No I/O and no clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from math import inf
from threading import local
from types import CoroutineType
from typing import Any, Final, Generic, TypeVar

from motorbus.bus import failures
from motorbus.bus.engine import Engine
from motorbus.bus.jobs import ExclusiveJob, Job, RateJob, RequestJob, Since
from motorbus.bus.positions import GATED
from motorbus.core.request import Notification, Priority, Request, Step
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
    catch,
    discard,
)
from motorbus.errors import MotorbusError, RequestError

T = TypeVar("T")
Notify = Callable[[object], None]

CLEANUP_TIMEOUT: Final = 2.0
"""s for the steps that a cancelled procedure still carries out."""
SECOND_TIMEOUT: Final = 0.25
"""s from a second cancellation on."""
LONG_SLEEP: Final = 0.5
"""s; a sleep of a clean-up from here on waits for a device to come to rest, and extends the timeout."""
LONGEST_EXTENSION: Final = 30.0
"""s by which such sleeps extend it."""
READS: Final = 2
"""Rounds of the reads that the interlock requires; the second where the first was doubtful."""


class _Stepping(local):
    """Whether this thread executes the code of a procedure."""

    active = False


_STEPPING: Final = _Stepping()


def check_outside() -> None:
    """Raise RequestError inside of a procedure: a call that waits there would wait for itself."""
    if _STEPPING.active:
        raise RequestError(
            "a bus or a device method was called inside of a procedure",
            expected="a step, or the driver function: `await feetech.Servo.position.function(servo)`",
            advice="nothing was sent",
        )


@contextmanager
def starting(*runnables: object) -> Iterator[None]:
    """Close these procedures if they are refused. Raises RequestError inside of another procedure."""
    try:
        check_outside()
        yield
    except BaseException:
        for one in runnables:
            discard(one)
        raise


class Timer(Job):
    """Waits for a moment, or for a notification."""

    def __init__(self, settled: Callable[[], None] | None, until: float) -> None:
        super().__init__(settled=settled)
        self.until = until
        self.listener: Callable[[Notification], None] | None = None


class Task:
    """One procedure, and the one thing that it waits for: a job, or its children.

    `started`: nothing more to start; it may still wait for exclusive use. `entered`: its code has begun.
    `joins_one`: the value of its only child is its value, not a tuple. `claims`: its end releases exclusive use.
    `checked`: the reads that the interlock requires precede its request. `exempt`: the cancellation was thrown into it,
    or must not be, as for the end of a guard and what that starts.
    """

    def __init__(self, procedure: Runnable[Any], parent: Task | None = None) -> None:
        self.procedure = procedure
        if not isinstance(procedure, Step | CoroutineType):
            raise RequestError(
                f"{procedure!r} is neither a procedure nor a step",
                expected="a coroutine of steps, or a step, as feetech.Servo.position.function(servo)",
                advice="nothing was sent",
            )
        self.coroutine = procedure.__await__() if isinstance(procedure, Step) else procedure
        self.owner: object = None if parent is None else parent.owner
        self.job: Job | None = None
        self.children: list[Task] = []
        self.joins_one = False
        self.claims = False
        self.checked = False
        self.started = self.entered = self.finished = False
        self.exempt: bool = parent is not None and parent.exempt
        self.value: Any = None
        self.error: BaseException | None = None


class TaskTree(Generic[T]):
    """Runs one procedure on the engine of one bus. `report` gets its events; it was called at `since`, else now.

    `settled` is called when something it waits for has ended, so that `advance` has something to do.
    """

    def __init__(
        self,
        engine: Engine,
        procedure: Runnable[T],
        *,
        now: Callable[[], float],
        report: Notify | None = None,
        settled: Callable[[], None] | None = None,
        since: Since | None = None,
    ) -> None:
        self.engine = engine
        self.now = now
        self.report = report
        self.settled = settled
        self.since = since or engine.since
        self.has_ordered = False
        """It has sent a motion, torque or stop request: from now on only stops after its next request end that."""
        self.cancellation: BaseException | None = None
        self.interruption: BaseException | None = None
        """Raised by one of several children, and no Exception: it cancels the others."""
        self.deadline = inf
        """s; from then on every step of the clean-up fails."""
        self.extension = 0.0
        """s by which sleeps of the clean-up may still extend `deadline`."""
        self.timers: list[Timer] = []
        self.root = Task(procedure)
        engine.end_sleeps.append(self.end_sleeps)

    # -- forward -----------------------------------------------------------------------------------------------

    def advance(self) -> bool:
        """Step every task that can go on; True when the procedure has ended."""
        now = self.now()
        for timer in tuple(self.timers):
            if timer.until <= now:
                self._end(timer, None if timer.listener is not None else now)
        if now >= self.deadline:
            for task in self._waiting(self.root):
                if isinstance(task.job, Timer) and task.job in self.timers:
                    self._end(task.job, error=failures.abandoned())
                elif task.job is not None:
                    self.engine.cancel(task.job)
        while self._step_tree(self.root):
            if self.interruption is not None and self.cancellation is None:
                self.cancel(self.interruption)
        return self.root.finished

    def next_moment(self) -> float:
        """The moment (s) at which `advance` has something to do by itself; inf when there is none."""
        if self.root.finished:
            return inf
        return min([self.deadline, *(timer.until for timer in self.timers)])

    def result(self) -> T:
        """What the procedure returned; raises its error, or the cancellation."""
        if (error := self.error()) is not None:
            raise error
        value: T = self.root.value
        return value

    def outcome(self) -> Any:
        """What the procedure returned, or its MotorbusError; raises any other error."""
        error = self.error()
        if error is None or isinstance(error, MotorbusError):
            return self.root.value if error is None else error
        raise error

    def foreign_error(self) -> BaseException | None:
        """The error that ended the procedure, once, if it is no MotorbusError: it ends other procedures, too."""
        error = self.root.error
        if self.cancellation is not None or isinstance(error, MotorbusError | None):
            return None
        self.cancellation = error
        return error

    def error(self) -> BaseException | None:
        """What `result` raises. Errors of the clean-up are notes of the cancellation."""
        if self.cancellation is None:
            return self.root.error
        _add_note(self.cancellation, self.root.error)
        return self.cancellation

    def _end(self, timer: Timer, value: Any = None, error: BaseException | None = None) -> None:
        self.timers.remove(timer)
        if timer.listener is not None:
            self.engine.notification_handlers.remove(timer.listener)
        timer.settle(value, error)

    def _step_tree(self, task: Task) -> bool:
        """Step this task or those below; True when something has moved."""
        if task.finished:
            return False
        if not task.started:
            task.started = True
            self._resume(task)
        elif task.job is not None:
            if not task.job.done:
                return False
            job, task.job = task.job, None
            self._resume(task, job.value, job.error)
        elif task.children and all(child.finished for child in task.children):
            self._join(task)
        else:
            moved = [self._step_tree(child) for child in task.children]
            return any(moved)
        return True

    def _resume(self, task: Task, value: Any = None, error: BaseException | None = None) -> None:
        task.entered = True
        outer, _STEPPING.active = _STEPPING.active, True
        try:
            step = task.coroutine.send(value) if error is None else task.coroutine.throw(error)
        except StopIteration as end:
            _STEPPING.active = outer
            self._finish(task, end.value)
        except BaseException as failure:
            _STEPPING.active = outer
            self._finish(task, error=failure)
        else:
            _STEPPING.active = outer
            self._begin(task, step)

    def _finish(self, task: Task, value: Any = None, error: BaseException | None = None) -> None:
        task.value, task.error, task.finished = value, error, True
        if error is not None and not isinstance(error, Exception) and task is not self.root:
            self.interruption = error
        if task is self.root and self.end_sleeps in self.engine.end_sleeps:
            self.engine.end_sleeps.remove(self.end_sleeps)
        if task.claims:
            self.engine.release(task.owner)

    def _join(self, task: Task) -> None:
        """All children have ended: their values, or the first error, go to the parent; a cancellation goes first."""
        children, task.children = task.children, []
        if self.cancellation is not None and not task.exempt:
            for child in children:
                _add_note(self.cancellation, child.error)
            task.exempt = True
            self._resume(task, error=self.cancellation)
            return
        errors = [child.error for child in children if child.error is not None]
        errors.sort(key=lambda error: isinstance(error, Exception))  # an interrupt is raised first
        if errors:
            for other in errors[1:]:
                if str(other) != str(errors[0]):
                    errors[0].add_note(f"also: {str(other) or type(other).__name__}")
            self._resume(task, error=errors[0])
        else:
            values = tuple(child.value for child in children)
            self._resume(task, values[0] if task.joins_one else values)

    # -- steps -------------------------------------------------------------------------------------------------

    def _begin(self, task: Task, step: Step[Any]) -> None:
        if isinstance(step, Request):
            self._begin_request(task, step)
        elif isinstance(step, Gather):
            task.joins_one = False
            try:
                task.children = [Task(procedure, task) for procedure in step.runnables]
            except RequestError as error:
                discard(step)
                self._resume(task, error=error)
                return
            if not task.children:
                task.job = Job()
                task.job.settle(())
        elif isinstance(step, Exclusive):
            child = Task(step.runnable, task)
            child.claims = child.owner is None  # what is nested belongs to the outermost
            child.owner = child.owner or child
            task.children, task.joins_one = [child], True
            child.started = True
            child.job = ExclusiveJob(child.owner, self.settled)
            self.engine.submit(child.job, self.now())
        elif isinstance(step, Shielded):
            child = Task(step.runnable, task)
            child.exempt = True
            task.children, task.joins_one = [child], True
        elif isinstance(step, Emit):
            self._report(task, step.event)
        elif isinstance(step, WaitFor):
            self._listen(task, step)
        elif isinstance(step, Sleep):
            task.job = timer = Timer(self.settled, self.now() + step.seconds)
            self.timers.append(timer)
            if LONG_SLEEP <= step.seconds <= self.extension:
                self.extension -= step.seconds
                self.deadline += step.seconds
        elif isinstance(step, SetBitrate):
            task.job = RateJob(step, task.owner, self.settled)
            self.engine.submit(task.job, self.now())
        else:
            self._resume(task, error=_not_a_step(step))

    def _begin_request(self, task: Task, request: Request[Any]) -> None:
        interlock = self.engine.interlock
        reads: Sequence[Runnable[Any]] = ()
        if (
            interlock is not None
            and request.effect in GATED
            and request.priority is not Priority.STOP
            and not task.checked
        ):
            reads = interlock.required_reads(request)
        if reads and interlock is not None:
            child = Task(_read_first(interlock.required_reads, reads, request), task)
            child.checked = True
            task.children, task.joins_one = [child], True
            return
        since = self.since
        if self.has_ordered:
            since = since._replace(stops=self.engine.positions.stops)
        self.has_ordered |= request.effect in GATED
        task.job = job = RequestJob(request, task.owner, self.settled, since)
        if self.now() >= self.deadline:
            job.settle(error=failures.abandoned())
        else:
            self.engine.submit(job, self.now())

    def _report(self, task: Task, event: object) -> None:
        """The report has been handed over before the next step; what it raises is raised in the task."""
        task.job = Job()
        try:
            if self.report is not None:
                self.report(event)
            elif isinstance(event, JournalEntry):
                raise _no_journal(event)
        except Exception as error:
            task.job.settle(error=error)
        task.job.settle()

    def _listen(self, task: Task, step: WaitFor) -> None:
        task.job = timer = Timer(self.settled, self.now() + step.until)

        def listen(notice: Notification) -> None:
            try:
                if step.match(notice):
                    self._end(timer, notice)
            except Exception as error:
                self._end(timer, error=error)

        timer.listener = listen
        self.engine.notification_handlers.append(listen)
        self.timers.append(timer)

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
        """Let every sleep end at once, with this error if there is one."""
        for timer in tuple(self.timers):
            self._end(timer, self.now(), error)

    def drop(self) -> None:
        """End the procedure where it stands; nothing that its clean-up asks for is carried out."""
        if self.end_sleeps in self.engine.end_sleeps:
            self.engine.end_sleeps.remove(self.end_sleeps)
        for task in self._waiting(self.root):
            self._cancel_job(task)
            if task.claims:
                self.engine.release(task.owner)
            task.finished = True
            discard(task.procedure)
            with suppress(RuntimeError):  # it awaits a step where it is closed
                task.coroutine.close()

    def _cancel(self, task: Task) -> None:
        if task.finished or task.exempt:
            return
        if not task.entered:
            self._cancel_job(task)
            discard(task.procedure)
            self._finish(task, error=self.cancellation)
        elif task.children and not all(child.finished for child in task.children):
            for child in task.children:
                self._cancel(child)
        elif task.children:
            self._join(task)
        else:
            task.exempt = True
            self._cancel_job(task)
            self._resume(task, error=self.cancellation)

    def _cancel_job(self, task: Task) -> None:
        job, task.job = task.job, None
        if isinstance(job, Timer) and job in self.timers:
            self._end(job)
        elif job is not None:
            self.engine.cancel(job)

    def _waiting(self, task: Task) -> list[Task]:
        if task.finished:
            return []
        return [task, *(leaf for child in task.children for leaf in self._waiting(child))]


async def _read_first(required: Callable[[Request[Any]], Any], reads: Any, request: Request[T]) -> T:
    """Carry out the reads that the interlock requires, again where they were doubtful, then the request."""
    try:
        for _ in range(READS):
            for read in reads:
                await catch(read)
            reads = required(request)
    finally:
        for read in reads:
            discard(read)  # those that never started
    return await request


def _add_note(error: BaseException, other: BaseException | None) -> None:
    if other is None or other is error:
        return
    lines = [getattr(other, "summary", "") or str(other) or type(other).__name__]
    lines += getattr(other, "__notes__", ())
    known = getattr(error, "__notes__", ())
    for line in lines:
        if line not in known:
            error.add_note(line)


def _not_a_step(step: object) -> RequestError:
    return RequestError(
        f"a procedure awaited {type(step).__name__}, which is no step",
        cause="asyncio.sleep(), futures and tasks need an event loop; a procedure runs without one",
        advice="await steps of motorbus only, such as Sleep(seconds)",
    )


def _no_journal(event: JournalEntry) -> RequestError:
    return RequestError(
        f"this bus keeps no journal, so it refuses {event.change}()",
        cause="a guarded change is recorded before it begins, so that a crash can be repaired",
        advice="open the bus with motorbus.open(), or give it a `report`; nothing was sent",
    )
