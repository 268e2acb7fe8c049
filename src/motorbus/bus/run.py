"""One operation under way: steps its generators, hands their wishes to turns, brings the results back.

Both pumps drive a `Run` in the same way: `advance()` until it says it is finished, letting time pass in between.
A started operation is never closed. When its caller is interrupted, the interruption is thrown in, the clean-up
steps the operation then yields are carried out under a deadline of their own, and the interruption is raised again.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import inf
from typing import Any, Generic, TypeVar

from motorbus.bus import verdict
from motorbus.bus.interruption import foremost, interrupts
from motorbus.bus.known import moves
from motorbus.bus.look import questions
from motorbus.bus.ticket import Claim, Flight, Listener, Retune, Ticket, Timer
from motorbus.bus.turns import GATED, Turns
from motorbus.core.operation import (
    Alone,
    Exchange,
    Journal,
    Listen,
    Operation,
    Pause,
    Report,
    Runnable,
    Step,
    Together,
    Tune,
    outcome,
)
from motorbus.errors import RequestError

T = TypeVar("T")

CLEAN_UP = 2.0  # s for the clean-up steps of an interrupted operation
HURRY = 0.25  # s when it is interrupted once more
LOOKS = 2  # the second one where the first was doubtful
LONG = 0.5  # s; a pause of a clean-up from here on is no polling: something must come to rest, and it gets its time
PATIENCE = 30.0  # s that such pauses may add at most

Notify = Callable[[object], None]


class Branch:
    """One generator and the one thing it waits for: a ticket, or its children."""

    __slots__ = (
        "alone",
        "children",
        "claim",
        "error",
        "finished",
        "generator",
        "looked",
        "owner",
        "started",
        "thrown",
        "ticket",
        "value",
    )

    def __init__(
        self, operation: Runnable[Any], parent: Branch | None, alone: bool = False, looked: bool = False
    ) -> None:
        self.generator: Operation[Any] = iter(operation) if isinstance(operation, Exchange) else operation
        self.alone = alone
        self.looked = looked
        self.claim: Claim | None = None
        self.owner: object = parent.owner if parent is not None and parent.owner is not None else None
        if alone and self.owner is None:
            self.owner = self  # the outermost one owns the bus; what is nested in it belongs to it
        self.ticket: Ticket | None = None
        self.children: list[Branch] = []
        self.started = self.finished = False
        # what is begun to clean up is not cut off again
        self.thrown: bool = parent is not None and parent.thrown
        self.value: Any = None
        self.error: BaseException | None = None


class Run(Generic[T]):
    """Carries out one operation on one bus. Not for two threads at once."""

    def __init__(
        self,
        turns: Turns,
        operation: Runnable[T],
        *,
        now: Callable[[], float],
        report: Notify | None = None,
        wake: Callable[[], None] | None = None,
    ) -> None:
        self.turns = turns
        self.now = now
        self.report = report
        self.wake = wake
        self.losses = turns.losses
        self.around = sys.exception()  # what its caller was dealing with already is no interruption of this
        self.interruption: BaseException | None = None
        self.noted: set[str] = set()
        self.thrown = False
        self.deadline = inf
        self.patience = 0.0
        self.root = Branch(operation, None)

    # -- forward --------------------------------------------------------------------------------------------

    def advance(self) -> bool:
        """Step everything that can go on; True when the operation has ended."""
        if self.now() >= self.deadline:
            self._give_up()
        while self._pass(self.root):
            pass
        return self.root.finished

    def _pass(self, branch: Branch) -> bool:
        """One look at this branch and below; True when something moved."""
        if branch.finished:
            return False
        if not branch.started:
            branch.started = True
            self._step(branch)
            return True
        if branch.ticket is not None:
            if not branch.ticket.done:
                return False
            self._step(branch, *self._settled(branch))
            return True
        moved = [self._pass(child) for child in branch.children]
        if any(moved) and self.interruption is None:
            _heed(branch.children)
        if _all_finished(branch):
            self._join(branch)
            return True
        return any(moved)

    def _settled(self, branch: Branch) -> tuple[Any, BaseException | None]:
        ticket, branch.ticket = branch.ticket, None
        assert ticket is not None
        if ticket.error is not None:
            return None, ticket.error
        if not isinstance(ticket, Flight):
            return ticket.value, None
        try:
            return taken(self.turns, ticket.exchange, ticket.value), None
        except Exception as error:  # the driver's own verdict on the answer belongs to the driver's generator
            return None, error

    def _step(self, branch: Branch, value: Any = None, error: BaseException | None = None) -> None:
        try:
            generator = branch.generator
            wish = generator.send(value) if error is None else generator.throw(error)
        except StopIteration as end:
            self._finish(branch, end.value, None)
        except BaseException as failure:
            if _alive(branch.generator):  # an interrupt fell into the lines above, not into the operation
                raise
            self._finish(branch, None, failure)
        else:
            self._grant(branch, wish)

    def _grant(self, branch: Branch, wish: Step) -> None:
        if isinstance(wish, Exchange):
            if not branch.looked and wish.effect in GATED and questions(self.turns, wish):
                branch.children = [Branch(_looked(self.turns, wish), branch, looked=True)]
            else:
                self._await(branch, Flight(wish, branch.owner, self.wake))
        elif isinstance(wish, Together):
            branch.children = [Branch(operation, branch) for operation in wish.operations]
            if not branch.children:
                done = Ticket()
                done.finish([])
                branch.ticket = done
        elif isinstance(wish, Alone):
            child = Branch(wish.operation, branch, alone=True)
            child.started = True
            child.claim = Claim(child.owner, self.wake)
            branch.children = [child]
            self._await(child, child.claim)
        elif isinstance(wish, Report):
            self._notify(branch, wish.event)
        else:
            self._await(branch, self._ticket(branch.owner, wish))

    def _ticket(self, owner: object, wish: Pause | Listen | Tune) -> Ticket:
        if isinstance(wish, Tune):
            return Retune(wish, owner, self.wake)
        if isinstance(wish, Listen):
            listener = Listener(wish, owner, self.wake)
            listener.deadline = self.now() + wish.until
            return listener
        timer = Timer(owner, self.wake)
        timer.deadline = self.now() + wish.seconds
        if LONG <= wish.seconds <= self.patience:
            self.patience -= wish.seconds
            self.deadline += wish.seconds
        return timer

    def _await(self, branch: Branch, ticket: Ticket) -> None:
        try:
            branch.ticket = ticket
            self._submit(ticket)
        except BaseException:
            # Nobody would settle it, and all that cleans up would wait for it.
            self._abandon(branch)
            raise

    def _submit(self, ticket: Ticket) -> None:
        if self.now() >= self.deadline:
            ticket.finish(error=verdict.cancelled())
            return
        with self.turns.lock:  # or another thread may lose the port, and find it, between these lines
            if self.losses != self.turns.losses and isinstance(ticket, Flight) and moves(ticket.exchange):
                ticket.finish(error=verdict.outlived(ticket.exchange))
                return
            self.turns.submit(ticket, self.now())

    def _notify(self, branch: Branch, event: object) -> None:
        try:
            branch.ticket = done = Ticket()  # first: a listener that uses the bus may come by here again
            self._deliver(event, done)
        except BaseException:
            branch.ticket = None
            raise

    def _deliver(self, event: object, done: Ticket) -> None:
        if self.report is None and isinstance(event, Journal):
            done.finish(error=_no_journal(event))
            return
        try:
            if self.report is not None:
                self.report(event)
        except Exception as error:  # what the listener raises is the operation's to clean up after
            done.finish(error=error)
        done.finish()

    def _finish(self, branch: Branch, value: Any, error: BaseException | None) -> None:
        branch.value, branch.error = value, error
        if branch.claim is not None:
            with self.turns.lock:
                self.turns.release(branch.claim)
        branch.finished = True

    def _join(self, branch: Branch) -> None:
        """All children have ended: their results, or the first error, go to the parent.

        If there was an interruption that goes instead, once; again where it fell into what the parent waited for.
        """
        if self.interruption is not None and not (branch.thrown and branch.children):
            self._tell(branch, self.interruption)
            return
        children, branch.children = branch.children, []
        errors = [child.error for child in children if child.error is not None]
        errors.sort(key=interrupts, reverse=True)  # who retries after an error must not do so after those
        if errors:
            said = {str(errors[0])}  # several that were cut off by one thing say the same
            for other in errors[1:]:
                if other is not self.interruption and str(other) not in said:
                    said.add(str(other))
                    errors[0].add_note(f"also: {str(other) or type(other).__name__}")
            self._step(branch, error=errors[0])
        elif len(children) == 1 and (children[0].alone or children[0].looked):
            self._step(branch, children[0].value)
        else:
            self._step(branch, [child.value for child in children])

    # -- interrupted ----------------------------------------------------------------------------------------

    def interrupt(self, interruption: BaseException) -> None:
        """The caller must go: throw this into everything that waits, in order, and let it clean up."""
        if self.interruption is None:
            self.interruption = interruption
            self.deadline = self.now() + CLEAN_UP
            self.patience = PATIENCE
        else:
            self.interruption = foremost(self.interruption, interruption)
            self.patience = 0.0
            self.deadline = min(self.deadline, self.now() + HURRY)
        if not self.thrown:  # or a second interruption fell into the throwing of the first
            self._throw(self.root, self.interruption)
            self.thrown = True

    def _throw(self, branch: Branch, interruption: BaseException) -> None:
        if branch.finished or branch.thrown:
            return
        if not branch.started:
            branch.started = True
            self._finish(branch, None, interruption)
            branch.generator.close()  # it has not begun, so it has nothing to clean up
            return
        if not _all_finished(branch):
            for child in branch.children:
                self._throw(child, interruption)
            return
        self._tell(branch, interruption)

    def _tell(self, branch: Branch, interruption: BaseException) -> None:
        """Throw it into this one, whose children have ended: nobody takes their values; what went wrong is not lost."""
        told: BaseException | None = interruption
        for child in branch.children:
            failed = child.value if child.thrown and isinstance(child.value, Exception) else None
            self._note(interruption, child.error or failed)
            if child.error is not interruption and interrupts(child.error):
                told = child.error  # a second one, which fell into its cleaning up
        branch.children = []
        self._abandon(branch)
        branch.thrown = True
        self._step(branch, error=told)

    def _note(self, interruption: BaseException, error: BaseException | None) -> None:
        if error is None or error is interruption:
            return
        name = str(error) or type(error).__name__
        said = {name: getattr(error, "summary", "") or name}
        said.update((note, note) for note in getattr(error, "__notes__", ()))
        for whole, text in said.items():
            if whole not in self.noted:  # several that were cut off by one thing say the same
                interruption.add_note(text)
                self.noted.add(whole)

    def _abandon(self, branch: Branch) -> None:
        if branch.ticket is not None:
            with self.turns.lock:
                self.turns.abandon(branch.ticket)
            branch.ticket = None  # not before: one more interrupt would leave it to nobody

    def _give_up(self) -> None:
        """The clean-up took too long: whatever it still waits for fails at once."""
        for branch in _waiting(self.root):
            if branch.ticket is not None:
                with self.turns.lock:
                    self.turns.abandon(branch.ticket)

    def result(self) -> T:
        """What the operation returned; raises what it raised, or the interruption it was cut by."""
        if (told := self.told()) is not None:
            raise told
        value: T = self.root.value
        return value

    def told(self) -> BaseException | None:
        """What that will raise; what the cleaning up failed with goes along as a note: a motor may still turn."""
        if self.interruption is None:
            return self.root.error
        told = foremost(self.interruption, self.root.error)
        self._note(told, self.root.error)
        return told


def taken(turns: Turns, exchange: Exchange[T], answer: Any) -> Any:
    """What the driver reads from an answer; one that it does not take for a refusal says that a stop is accepted."""
    value = answer if exchange.read is None else exchange.read(answer)
    if exchange.effect in GATED and exchange.replies:
        with turns.lock:
            turns.known.accept(exchange, answer)
    return value


def _looked(turns: Turns, wish: Exchange[T]) -> Operation[T]:
    """Ask what must be known before this order can be judged, once more where the answer is doubtful, then give it."""
    for _ in range(LOOKS):
        for question in questions(turns, wish):
            yield from outcome(question)
    return (yield from wish)


def _heed(children: list[Branch]) -> None:
    """Raise the interruption that fell into one: those beside it may wait for what it will never do."""
    for child in children:
        if child.error is not None and interrupts(child.error):
            raise child.error


def _all_finished(branch: Branch) -> bool:
    return all(child.finished for child in branch.children)


def _alive(generator: Operation[Any]) -> bool:
    return getattr(generator, "gi_frame", None) is not None


def _waiting(branch: Branch) -> list[Branch]:
    if branch.finished:
        return []
    return [branch, *(leaf for child in branch.children for leaf in _waiting(child))]


def _no_journal(event: Journal) -> RequestError:
    return RequestError(
        f"this bus keeps no journal, so it refuses {event.change}()",
        cause="a guarded change must be on disk before it begins, or a crash in the middle could not be mended",
        advice="open the bus with motorbus.open(), or give it a `report`; nothing was sent",
    )
