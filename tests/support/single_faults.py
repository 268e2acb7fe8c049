"""Every way in which one byte can go wrong between a host and a device, one after the other on one bus.

What must hold of each: the call that suffers it tells nothing false and ends by its own time, what is asked next comes
true, and what is asked after that comes true at its first try. And the fault has happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

from motorbus.core.request import Data
from motorbus.errors import MotorbusError
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.support.lines import ByteFault, ByteFaultLine
from tests.support.world import Bus

SPLIT = 0.0003
"""s between two pieces of what is one packet all the same."""
LATE = 0.03
"""s by which a byte and all behind it come too late for its exchange."""
EVERY = range(256)
EDGES = (0x00, 0x01, 0x02, 0x04, 0x80, 0xFE, 0xFF)
"""Values that mean something somewhere."""


class Struck(Protocol):
    """What suffers: a bus on a link whose line can be changed."""

    bus: Bus
    link: MemoryLink

    def put(self, line: Line) -> None:
        """Another line between host and device."""


class Striking(Line, Protocol):
    """A line with a fault in it; `fired` lists what has happened."""

    @property
    def fired(self) -> Sequence[object]: ...


R = TypeVar("R", bound=Struck)
F = TypeVar("F")


class Tally(NamedTuple):
    """How many faults there were, how many calls succeeded in spite of theirs, and how long the longest took (s).

    `misled` are those calls that did not because the device heard another sound request; of these, `false` told
    something that is not so.
    """

    faults: int
    succeeded: int
    longest: float
    misled: int = 0
    false: int = 0

    @property
    def told(self) -> dict[str, Any]:
        """For the table of figures."""
        told = {"faults": self.faults, "wrong": self.false, "succeeded": self.succeeded}
        return told | {"longest_s": round(self.longest, 4)}


class Overheard:
    """Carries as another line does; `said` is what the host has sent, `heard` what of it reached the device."""

    def __init__(self, line: Line) -> None:
        self.line = line
        self.said: list[Data] = []
        self.heard = b""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        deliveries = self.line.carry(sender, data, at)
        if sender is Side.HOST:
            self.said.append(data)
            self.heard += b"".join(one.data for one in deliveries if isinstance(one.data, bytes))
        return deliveries


class Bytewise:
    """Hands over what another line delivers to the host byte by byte, as a slow wire does: none overtakes another."""

    def __init__(self, line: Line, gap: float = 1e-5) -> None:
        self.line = line
        self.gap = gap
        self._last = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        return [piece for delivery in self.line.carry(sender, data, at) for piece in self._pieces(delivery)]

    def _pieces(self, delivery: Delivery) -> list[Delivery]:
        if delivery.to is Side.DEVICE or not isinstance(delivery.data, bytes):
            return [delivery]
        bytes_ = [delivery.data[index : index + 1] for index in range(len(delivery.data))]
        begin = max(delivery.at, self._last + self.gap)
        self._last = begin + (len(bytes_) - 1) * self.gap
        return [Delivery(begin + n * self.gap, delivery.to, byte) for n, byte in enumerate(bytes_)]


def every_fault(
    length: int, values: Iterable[int] = EVERY, to: Side = Side.HOST, places: Iterable[int] | None = None
) -> Iterator[ByteFault]:
    """At each byte: lost, there twice, changed, parted from those before it, late; before and behind it one more."""
    values = tuple(values)
    for byte in range(length + 1) if places is None else places:
        if byte < length:
            yield ByteFault(1, byte, "drop", to)
            yield ByteFault(1, byte, "duplicate", to)
            yield ByteFault(1, byte, "delay", to, seconds=SPLIT)
            yield ByteFault(1, byte, "delay", to, seconds=LATE)
            yield from (ByteFault(1, byte, "corrupt", to, value=value) for value in values if value)
        yield from (ByteFault(1, byte, "insert", to, value=value) for value in values)


def number_of(length: int, values: int = 256) -> int:
    """How many faults these are, 00 among the values."""
    return length * (4 + values - 1) + (length + 1) * values


def scripted(fault: Any) -> ByteFaultLine:
    """A line with this one fault."""
    return ByteFaultLine(fault)


def suffer(
    rig: R,
    act: Callable[[R], Any],
    faults: Iterable[F],
    *,
    line_of: Callable[[F], Striking] = scripted,
    settle: Callable[[R, F], object] = lambda rig, fault: rig.put(PerfectLine()),
    before: Callable[[R], Any] = lambda rig: None,
    wrap: Callable[[Line], Line] = lambda line: line,
    at_most: float = 1.0,
    misleading: Callable[[Overheard], bool] = lambda heard: False,
) -> Tally:
    """Every fault in turn. `act` raises AssertionError for what is false, MotorbusError when it fails honestly.

    `before` is done on a sound line before each call of `act`, which may take `at_most` s. Two calls follow each fault;
    `settle` is what is done before them, to the line above all.
    `misleading` says whether what a device heard is, by its own rules, another request than what was said: then, and
    only then, something false may be told.
    """
    faults = list(faults)
    succeeded = misled = false = 0
    longest = 0.0
    for fault in faults:
        try:
            before(rig)
            line = line_of(fault)
            rig.put(heard := Overheard(wrap(line)))
            began = rig.link.now()
            verdict = _verdict(rig, act)
            longest = max(longest, rig.link.now() - began)
            assert len(line.fired) == 1, "it did not happen"
            was_misled = verdict is not None and misleading(heard)
            if isinstance(verdict, AssertionError) and not was_misled:
                raise verdict
            succeeded += verdict is None
            misled += was_misled
            false += isinstance(verdict, AssertionError)
            settle(rig, fault)
            _recovers(rig, act, before)
        except BaseException as error:
            error.add_note(f"the fault was `{fault}`")
            raise
    assert longest <= at_most, "a call hung on"
    return Tally(len(faults), succeeded, longest, misled, false)


def _verdict(rig: R, act: Callable[[R], Any]) -> MotorbusError | AssertionError | None:
    try:
        act(rig)
    except (MotorbusError, AssertionError) as error:
        return error
    return None


def _recovers(rig: R, act: Callable[[R], Any], before: Callable[[R], Any]) -> None:
    before(rig)
    act(rig)
    before(rig)
    again = tried_again(rig.bus)
    act(rig)
    assert tried_again(rig.bus) == again, "the second call behind it is not right at its first try"


def tried_again(bus: Bus) -> int:
    """How often this bus has said something twice."""
    return sum(ledger.retries for ledger in bus.statistics.nodes.values())
