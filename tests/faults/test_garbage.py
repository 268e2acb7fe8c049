"""Row L9: something that never stops talking, at line rate, on each family's line. No call hangs, nothing piles up.

In the soak it is ten minutes of each kind of garbage, and a call every twentieth of a second but for a long pause now
and then. What a reader holds back is looked at after every piece that it was fed. What processor time a minute of it
takes, with the simulated line and without, is told and not judged; that work does not grow faster than garbage is shown
in `test_work_on_garbage`. A wire carries no more than its rate, and the simulated one holds back what
it is given beyond that: so garbage fills what the answers leave of it, or it would pile up before it for ever.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from random import Random
from typing import Any, NamedTuple

import pytest

from motorbus.core.family import SimulatedNode
from motorbus.core.operation import CanFrame, Data, Event
from motorbus.errors import MotorbusError
from motorbus.families.feetech import wire as feetech
from motorbus.families.feetech.wire.stream import Stream
from motorbus.families.stepper import wire as stepper
from motorbus.families.stepper.wire import receiver as stepper_receiver
from motorbus.families.stepper.wire.frames import DUMP
from motorbus.link import slcan
from motorbus.link.base import PerfectLine
from motorbus.link.memory import MemoryLink
from tests.conftest import Figures, Rounds
from tests.faults.slcan_rig import SlowSlcanRig
from tests.support.catalogue.kst import KstRig, read_2
from tests.support.rigs.feetech import Rig, read_word
from tests.support.rigs.stepper import Rig as StepperRig

MOST = 4096
"""Bytes that a reader may hold back, as is promised; what each of them says of itself is less, and that is asserted."""
SEED = 1
MINUTES = 10
EVERY = 0.01
"""s between two pieces of garbage."""
PAUSE = 0.043
"""s between two calls, so that they begin at any moment of a piece."""
LONG_PAUSE, OFTEN = 0.5, 10
"""s, and every how many calls: on the slowest line more comes in it than its reader may hold, and nobody's answer."""
LONGEST_ANSWER = 0.3
"""s; the dump of a controller, and two pieces of garbage."""
POOL = 500
"""Pieces that are made beforehand and come again and again, for what is to be timed is not how they are made."""


class Babble:
    """A simulator on whose line something else talks: `garbage` makes what comes every hundredth of a second.

    `pieces` were said, and in place of some more the wire was `full` of answers for as long.
    """

    def __init__(self, link: MemoryLink, garbage: Callable[[Random], list[Data]]) -> None:
        self.link = link
        self.inner: Any = link.simulator
        random = Random(SEED)
        self.pool = [garbage(random) for _ in range(POOL)]
        self.pieces = self.full = 0
        self.next = link.now()

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        return self.inner.nodes  # type: ignore[no-any-return]

    def tune(self, rate: int) -> None:
        self.inner.tune(rate)

    def receive(self, data: Data, at: float) -> None:
        self.inner.receive(data, at)

    def due(self) -> float:
        due, next_ = self.inner.due(), self.next
        return next_ if due is None else min(due, next_)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        out: list[tuple[float, Data]] = list(self.inner.advance(to))
        if self.next > to:
            return out
        while self.next <= to:
            if max(self.link._free.values()) > self.next + EVERY:
                self.full += 1
            else:
                out += [(self.next, data) for data in self.pool[self.pieces % POOL]]
                self.pieces += 1
            self.next += EVERY
        return sorted(out, key=lambda item: item[0])


class Watched:
    """A reader, and the most bytes that it held back after anything it was fed."""

    def __init__(self, reader: Any) -> None:
        self.reader = reader
        self.most = 0

    @property
    def held(self) -> int:
        """How many bytes wait for more."""
        count: int = len(self.reader._rest) if hasattr(self.reader, "_rest") else self.reader.held
        return count

    def feed(self, data: Any) -> list[Any]:
        found: list[Any] = self.reader.feed(data)
        self.most = max(self.most, self.held)
        return found

    def flush(self) -> list[Event]:
        events: list[Event] = self.reader.flush()
        return events


class Wire:
    """What of the processor's time the simulated line takes, and whether garbage has come since a call began."""

    def __init__(self, link: MemoryLink, babble: Babble) -> None:
        self.link = link
        self.garbage = {id(data) for piece in babble.pool for data in piece}
        self.seconds = 0.0
        self.began = 0.0
        self.came = False
        for name in ("_read_virtual", "advance"):
            vars(link)[name] = self._timed(getattr(link, name))

    def _timed(self, act: Callable[[float], Any]) -> Callable[[float], Any]:
        def timed(moment: float) -> Any:
            before = time.process_time()
            found = act(moment)
            self.seconds += time.process_time() - before
            if self.link.now() > self.began:  # else it was there before the call
                self.came = self.came or any(id(data) in self.garbage for data in found or ())
            return found

        return timed

    def call(self) -> None:
        """A call begins."""
        self.began, self.came = self.link.now(), False


def one(data: Callable[[Random], bytes]) -> Callable[[Random], list[Data]]:
    return lambda random: [data(random)]


def frames(make: Callable[[Random], CanFrame]) -> Callable[[Random], list[Data]]:
    """40 frames of 8 bytes fill a hundredth of a second at 500 kbit/s."""
    return lambda random: [make(random) for _ in range(40)]


SERVO: dict[str, Callable[[Random], list[Data]]] = {
    "random": one(lambda random: random.randbytes(1000)),
    "FF": one(lambda random: b"\xff" * 1000),
    "FF AA": one(lambda random: b"\xff\xaa" * 500),
    "frames of another node": one(lambda random: feetech.encode_status(77, 0, b"\x01\x02") * 125),
    "its own frames, of another length": one(lambda random: feetech.encode_status(1, 0, b"\x01") * 142),
    "beginnings of its longest frames": lambda random: [b"\xff\xff\x01\xff" + bytes(82)] * 11,
}
CAN: dict[str, Callable[[Random], list[Data]]] = {
    "frames of any identifier": frames(lambda random: CanFrame(random.randrange(0x800), random.randbytes(8))),
    "replies of another node": frames(lambda random: CanFrame(0x5A9, b"\x4b\x02\x60\0\x01\x02\0\0")),
    "replies that are none": frames(lambda random: CanFrame(0x5A5, b"\xe0" + random.randbytes(7))),
    "reports": frames(lambda random: CanFrame(0x5A5, random.randbytes(4))),
    "its own replies, about another object": frames(
        lambda random: CanFrame(0x5A5, b"\x4b\x05\x60\0\x01\x02\0\0")
    ),
}
TEXT: dict[str, Callable[[Random], list[Data]]] = {
    "random": one(lambda random: random.randbytes(120)),
    "digits without end": one(lambda random: b"0123456789ABCDEF" * 7),
    "ends of lines": one(lambda random: b"\r" * 120),
    "refusals": one(lambda random: b"\a" * 120),
    "frames of another node": one(lambda random: b"t5A984B02600001020000\r" * 5),
}
CONTROLLER: dict[str, Callable[[Random], list[Data]]] = {
    "random": one(lambda random: random.randbytes(10)),
    "FF": one(lambda random: b"\xff" * 10),
    "FF AA": one(lambda random: b"\xff\xaa" * 5),
    "notices": one(lambda random: stepper.NOTICE * 5),
    "replies to something else": one(lambda random: bytes.fromhex("FFAA030D0000" * 2)),
    "beginnings of dumps": one(lambda random: stepper.HEADER + bytes((DUMP.code,)) + bytes(7)),
}


def servos() -> tuple[Any, Callable[[], object]]:
    rig = Rig(ids=(1,), options={"pace": True})
    return rig, lambda: read_word(rig)


def can() -> tuple[Any, Callable[[], object]]:
    rig = KstRig()
    return rig, lambda: read_2(rig)


def text() -> tuple[Any, Callable[[], object]]:
    rig = SlowSlcanRig()
    return rig, lambda: read_2(rig)


def controller() -> tuple[Any, Callable[[], object]]:
    rig = StepperRig(PerfectLine(), 1)
    rig.open()

    def output() -> None:
        if not rig.output():
            raise rig.errors[-1]

    return rig, output


class Way(NamedTuple):
    """How a line is made, its kinds of garbage, how long (s) a call may take (tries, quiet times and probes), and how
    many bytes its reader may hold back, by what is written in its file."""

    make: Callable[[], tuple[Any, Callable[[], object]]]
    kinds: dict[str, Callable[[Random], list[Data]]]
    longest: float
    holds: int


LINES = {
    "feetech": Way(servos, SERVO, 1.0, 258),
    "kst": Way(can, CAN, 1.0, 0),
    "kst by slcan": Way(text, TEXT, 1.0, 512),
    "stepper": Way(controller, CONTROLLER, 8.0, 225),
}
ALL = [(line, kind) for line, way in LINES.items() for kind in way.kinds]
FILLING = {
    ("feetech", "random"): 10,
    ("feetech", "FF"): 2,
    ("feetech", "beginnings of its longest frames"): 250,
    ("kst by slcan", "random"): 400,
    ("kst by slcan", "digits without end"): 400,
    ("stepper", "FF"): 1,
    ("stepper", "FF AA"): 4,
    ("stepper", "beginnings of dumps"): 200,
}
"""So many bytes at least the reader has to hold back at some time."""


def succeeds(act: Callable[[], object]) -> bool:
    """False when it fails honestly; what is wrong is an AssertionError."""
    try:
        act()
    except MotorbusError:
        return False
    return True


def watched(rig: Any) -> Watched:
    """The reader of this line, from here on watched."""
    place, name = (rig.link, "reader") if hasattr(rig.link, "reader") else (rig.bus.turns, "receiver")
    reader = Watched(getattr(place, name))
    setattr(place, name, reader)
    return reader


def endured(line: str, kind: str, seconds: float) -> dict[str, float]:
    """So many seconds of it, and calls meanwhile; the figures. Whatever must not be is an AssertionError."""
    way = LINES[line]
    rig, act = way.make()
    link: MemoryLink = rig.link
    link.simulator = babble = Babble(link, way.kinds[kind])
    reader, wire = watched(rig), Wire(link, babble)
    start, took, calls, good, during = link.now(), 0.0, 0, 0, 0
    before = time.process_time()
    while link.now() < start + seconds:
        wire.call()
        good += succeeds(act)
        took = max(took, link.now() - wire.began)
        during += wire.came
        link.advance(PAUSE if calls % OFTEN else LONG_PAUSE)
        calls += 1
    used, minutes = time.process_time() - before, (link.now() - start) / 60
    assert babble.pieces > 10 * seconds
    assert babble.pieces + babble.full >= 0.99 * seconds / EVERY
    assert during > calls / 2, "hardly any call had garbage to do with"
    assert reader.most >= FILLING.get((line, kind), 0), "its bound was not tried"
    assert reader.most <= way.holds <= MOST, "the reader has held back more than it may"
    assert took <= way.longest
    assert max(link._free.values()) < link.now() + LONGEST_ANSWER, (
        "the wire of the rig holds back more and more"
    )
    babble.next = float("inf")
    link.advance(1.0)
    succeeds(act)
    act()
    return {
        "pieces": babble.pieces,
        "full": babble.full,
        "calls": calls,
        "with_garbage_in_them": during,
        "succeeded": good,
        "longest_s": round(took, 3),
        "core_seconds_per_minute": round((used - wire.seconds) / minutes, 2),
        "of_the_simulated_line": round(wire.seconds / minutes, 2),
        **({"most_bytes_held": reader.most} if way.holds else {}),
    }


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("line", "kind"), ALL)
def test_l9_garbage_without_end_hangs_nothing(line: str, kind: str, rounds: Rounds, figures: Figures) -> None:
    seconds = rounds(MINUTES * 60, 1)
    told = endured(line, kind, seconds)
    figures(f"L9 {seconds / 60:.2g} minutes of garbage: {kind}", family=line, seed=SEED, **told)


BOUNDS: dict[str, tuple[str, object, str, object]] = {
    "feetech": ("beginnings of its longest frames", Stream, "_size", lambda stream, data, start: 10**9),
    "kst by slcan": ("digits without end", slcan, "LONGEST", 10**9),
    "stepper": ("beginnings of dumps", stepper_receiver, "DUMP_LENGTH", 10**9),
}
"""A kind of garbage, and what of the product bounds what is held back of it: where it is, its name, and no bound."""


@pytest.mark.parametrize("line", BOUNDS)
def test_l9_a_reader_without_a_bound_is_noticed(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, place, name, unbounded = BOUNDS[line]
    monkeypatch.setattr(place, name, unbounded)
    with pytest.raises(AssertionError, match="the reader has held back more than it may"):
        endured(line, kind, 1)
