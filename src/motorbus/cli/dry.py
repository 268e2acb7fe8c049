"""--dry-run: the same operation, with everything that would change something shown and withheld.

What only reads is carried out, because what would be sent depends on it (limits, register map, where a servo
stands). A read that follows a withheld write would find the old value; it is not carried out but taken to confirm
what was "written", so that a guarded sequence is shown to its end.
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any, Final, TypeVar

from motorbus.cli import faces
from motorbus.cli import frame as frames
from motorbus.cli.exits import Unforeseeable
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import ANY, Effect, Priority, Reply, Request, Response, Step
from motorbus.core.steps import (
    Emit,
    Exclusive,
    Gather,
    JournalEntry,
    SetBitrate,
    Shielded,
    Sleep,
    WaitFor,
    discard,
)
from motorbus.errors import MotorbusError
from motorbus.motion.safety import Gate

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output
    from motorbus.core.family import Explanation
    from motorbus.core.request import Data
    from motorbus.core.steps import Runnable

T = TypeVar("T")

_FRAMING: Final = ("checksum", "identifier", "length", "reserved")
_EVERYONE: Final = -1
"""Among the nodes that something was withheld from: what nobody answers may have been for each of them."""


class _AsWritten:
    """The answer to a read of what was withheld: equal to whatever it is compared with, and good for nothing else."""

    def __eq__(self, other: object) -> bool:
        return True

    __hash__ = None  # type: ignore[assignment]

    def __getattr__(self, name: str) -> Any:
        raise _unforeseeable()

    def _used(self, *_: object) -> Any:
        raise _unforeseeable()

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __mod__ = __rshift__ = __and__ = _used
    __lt__ = __le__ = __gt__ = __ge__ = __int__ = __float__ = __index__ = _used
    __abs__ = __len__ = __iter__ = __contains__ = __getitem__ = _used


def _unforeseeable() -> Unforeseeable:
    return Unforeseeable("what would be sent next depends on an answer that only a real run gets")


class DryBus:
    """Stands where a bus stands: reads by it, and keeps what it withheld in `frames`, in order.

    A CAN frame is kept as it stands in a run of bytes, see `CanFrame.flat()`. Nobody waits in a rehearsal, but its time
    passes, and what a family remembers of what it said goes into a copy of it.
    """

    def __init__(self, bus: Bus) -> None:
        self.driver = copy(bus.driver)
        self.family = bus.family
        self.link = bus.link
        self.frames: list[bytes] = []
        self._bus = bus
        self.interlock = (
            bus.interlock.rehearsing() if isinstance(bus.interlock, Gate) else bus.interlock or Gate()
        )
        self._written: set[int] = set()
        self._waited = 0.0
        self._read: dict[Data, Any] = {}
        self._report: Callable[[object], None] | None = None

    @property
    def latched(self) -> bool:
        """As of the bus itself."""
        return self._bus.latched

    @property
    def turn(self) -> AbstractContextManager[object]:
        """As of the bus itself."""
        return self._bus.turn

    @property
    def loss_count(self) -> int:
        """As of the bus itself."""
        return self._bus.loss_count

    def stop_count(self, node: int | None = None) -> int:
        """As of the bus itself."""
        return self._bus.stop_count(node)

    def apart(self) -> DryBus:
        """The same bus for another device: what is withheld here and from it hides nothing of the other.

        Who is addressed can be told from an exchange that is answered, and from no other.
        """
        other = DryBus(self._bus)
        other.frames = self.frames
        return other

    def run(self, operation: Runnable[T], report: Callable[[object], None] | None = None) -> T:
        """Carry out an operation, reading only. Raises as the operation does, LimitExceeded of the gate included.

        `report` gets its events but for journal records: nothing is about to be changed.
        """
        self._report = report or self._report
        answer: Any = self._step(operation) if isinstance(operation, Step) else self._all(operation)
        return answer  # type: ignore[no-any-return]

    def _all(self, operation: Any) -> object:
        answer: object = None
        error: MotorbusError | None = None
        while True:
            try:
                step = operation.throw(error) if error else operation.send(answer)
            except StopIteration as end:
                return end.value
            answer = error = None
            try:
                answer = self._step(step)
            except MotorbusError as failure:
                error = failure
            finally:
                discard(step)

    def _step(self, step: object) -> object:
        if isinstance(step, Request):
            return self._one(step)
        if isinstance(step, Exclusive | Shielded):
            return self.run(step.runnable)
        if isinstance(step, Gather):
            return [self.run(operation) for operation in step.runnables]
        if isinstance(step, SetBitrate) and (step.rate == 0 or self.family.link.kind == "bytes"):
            return self._bus.run(
                step
            )  # on CAN whoever speaks at another rate disturbs the bus: only ask there
        if isinstance(step, Sleep):
            self._waited += step.seconds
            return self.link.now() + self._waited
        if isinstance(step, WaitFor):
            self._waited += step.until
        if isinstance(step, Emit) and self._report is not None and not isinstance(step.event, JournalEntry):
            self._report(step.event)
        return None  # nobody has said anything; another rate: nothing is sent

    def _one(self, exchange: Request[Any]) -> object:
        if exchange.effect is Effect.NONE and exchange.priority is Priority.POLL:
            return self._foreseen(exchange) if self._follows(exchange) else self._told(exchange)
        for question in self._bus.required_reads(exchange):
            self._bus.run(question)
        with self._bus.turn:
            self.interlock.check(exchange, self._bus.now())
        self._written |= _answering(exchange) or {_EVERYONE}
        if exchange.effect is Effect.IDENTITY:  # from now on it would have another id, or another rate
            self._written.add(_EVERYONE)
        request = exchange.wire
        self.frames.append(request.flat() if isinstance(request, CanFrame) else request)
        return None

    def _told(self, exchange: Request[Any]) -> object:
        answer = self._bus.run(exchange)
        self._read[exchange.wire] = answer
        return answer

    def _foreseen(self, exchange: Request[Any]) -> object:
        """What it would read after what was withheld, where its family can say that."""
        foresee = faces.offer(self.family.name, "as_written")
        data = foresee(self.driver, self._read, self.frames, exchange.wire) if foresee else None
        if data == b"":
            return self._told(exchange)
        if data is None or exchange.expected is ANY or exchange.decode is None:
            return _AsWritten()
        reply = Reply(exchange.lane, exchange.expected[0].key, data)
        return exchange.decode(Response((reply,), (), self.link.now() + self._waited))

    def _follows(self, exchange: Request[Any]) -> bool:
        """Does it ask somebody whom something was withheld from?"""
        asked = _answering(exchange) | {_EVERYONE} if self._written else set()
        return bool(asked & self._written)


def _answering(exchange: Request[Any]) -> set[int]:
    return set() if exchange.expected is ANY else {due.node for due in exchange.expected}


def rehearse(dry: DryBus, work: Callable[[], T], output: Output) -> T | None:
    """Run `work` on this bus and show what was withheld, as far as it can be foreseen."""
    result = None
    try:
        result = work()
    except Unforeseeable as error:
        output.note(f"note: {error.summary}; what is shown is as far as it can be foreseen")
    show(dry, output)
    return result


def show(dry: DryBus, output: Output) -> None:
    """Print what was withheld, each frame explained; that there was nothing, where that is so."""
    explained = [(one, _meaning(one)) for frame in dry.frames for one in dry.driver.decode(frame)]
    facts = [{**frames.facts(one.data, dry.family), "meaning": meaning} for one, meaning in explained]
    output.document("motorbus.dry-run/1", {"withheld": facts})
    if not explained:
        output.text("nothing that changes anything would be sent")
    for one, meaning in explained:
        output.text(f"would send {frames.shown(one.data, dry.family)}\n           {meaning}")


def _meaning(one: Explanation) -> str:
    """What a frame of ours says; who it could come from besides, and how it is framed, is left to `decode`."""
    names = [part.name for part in one.parts]
    start = names.index("instruction") + 1 if "instruction" in names else 0
    parts = [_said(part.name, part.meaning) for part in one.parts[start:] if part.name not in _FRAMING]
    return "; ".join([one.title.partition(" (or ")[0], *parts])


def _said(name: str, meaning: str) -> str:
    """A field and what it says; one that says its own name, as "node 37", is not named twice."""
    return meaning if meaning.partition(" ")[0] == name else f"{name} {meaning}"
