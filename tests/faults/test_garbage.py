"""Row L9: something that never stops talking, at line rate, on each family's line. No call hangs, nothing piles up.

In the soak it is ten minutes of each kind of garbage, and a call every twentieth of a second. What processor time a
minute of it takes is told and not judged; that work does not grow faster than garbage is shown in
`test_work_on_garbage`. A wire carries no more than its rate, and the simulated one holds back what
it is given beyond that: so garbage fills what the answers leave of it, or it would pile up before it for ever.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from random import Random
from typing import Any

import pytest

from motorbus.core.family import SimulatedNode
from motorbus.core.operation import CanFrame, Data, Event
from motorbus.errors import MotorbusError
from motorbus.families.feetech import wire as feetech
from motorbus.families.stepper import wire as stepper
from motorbus.link.base import PerfectLine
from motorbus.link.memory import MemoryLink
from tests.conftest import Figures, Rounds
from tests.families.stepper.fault_rig import Rig as StepperRig
from tests.faults import off
from tests.faults.kst_kinds import KstRig, read_2
from tests.faults.rig import Rig, read_word
from tests.faults.slcan_rig import SlcanRig, TextLink

MOST = 4096
"""Bytes that a receiver may hold back."""
SEED = 1
MINUTES = 10
EVERY = 0.01
"""s between two pieces of garbage."""
PAUSE = 0.043
"""s between two calls, so that they begin at any moment of a piece."""
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
        due, next_ = self.inner.due(), float("inf") if off.faults_are_off else self.next
        return next_ if due is None else min(due, next_)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        out: list[tuple[float, Data]] = list(self.inner.advance(to))
        if self.next > to or off.faults_are_off:
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
    """A receiver, and the most bytes that it, or the reader before it, has held back; None where there are none."""

    def __init__(self, receiver: Any, held: Callable[[], int | None]) -> None:
        self.receiver = receiver
        self.most: int | None = None
        self._held = held

    @property
    def held(self) -> int:
        held: int = self.receiver.held
        return held

    def feed(self, data: Data) -> list[Event]:
        events: list[Event] = self.receiver.feed(data)
        held = self._held()
        if held is not None:
            self.most = max(self.most or 0, held)
        return events

    def flush(self) -> list[Event]:
        events: list[Event] = self.receiver.flush()
        return events


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
}


def servos() -> tuple[Any, Callable[[], object], Callable[[], int | None]]:
    rig = Rig(ids=(1,), options={"pace": True})
    return rig, lambda: read_word(rig), lambda: _receiver(rig).held


def can() -> tuple[Any, Callable[[], object], Callable[[], int | None]]:
    rig = KstRig()
    return rig, lambda: read_2(rig), lambda: None  # one frame is one event


def text() -> tuple[Any, Callable[[], object], Callable[[], int | None]]:
    rig = SlcanRig()
    assert isinstance(rig.link, TextLink)
    reader = rig.link.reader
    return rig, lambda: read_2(rig), lambda: len(reader._rest)


def controller() -> tuple[Any, Callable[[], object], Callable[[], int | None]]:
    rig = StepperRig(PerfectLine(), 1)
    rig.open()

    def output() -> None:
        if not rig.output():
            raise rig.errors[-1]

    return rig, output, lambda: _receiver(rig).held


def _receiver(rig: Any) -> Any:
    return rig.bus.turns.receiver.receiver


LINES = {
    "feetech": (servos, SERVO, 1.0),
    "kst": (can, CAN, 1.0),
    "kst by slcan": (text, TEXT, 1.0),
    "stepper": (controller, CONTROLLER, 8.0),
}
"""How each is made, its kinds of garbage, and how long (s) a call may take: tries, quiet times and probes."""
ALL = [(line, kind) for line, (_, kinds, _) in LINES.items() for kind in kinds]


def succeeds(act: Callable[[], object]) -> bool:
    """False when it fails honestly; what is wrong is an AssertionError."""
    try:
        act()
    except MotorbusError:
        return False
    return True


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("line", "kind"), ALL)
def test_l9_garbage_without_end_hangs_nothing(line: str, kind: str, rounds: Rounds, figures: Figures) -> None:
    make, kinds, longest = LINES[line]
    rig, act, held = make()
    link: MemoryLink = rig.link
    link.simulator = babble = Babble(link, kinds[kind])
    rig.bus.turns.receiver = watched = Watched(rig.bus.turns.receiver, held)
    seconds = rounds(MINUTES * 60, 1)
    end, took, calls, good = link.now() + seconds, 0.0, 0, 0
    before = time.process_time()
    while link.now() < end:
        began = link.now()
        good += succeeds(act)
        took = max(took, link.now() - began)
        calls += 1
        link.advance(PAUSE)
    used = time.process_time() - before
    assert babble.pieces > 10 * seconds
    assert babble.pieces + babble.full >= 0.99 * seconds / EVERY
    assert line == "kst" or (watched.most is not None and watched.most <= MOST)
    assert took <= longest
    assert max(link._free.values()) < link.now() + LONGEST_ANSWER, (
        "the wire of the rig holds back more and more"
    )
    babble.next = float("inf")
    link.advance(1.0)
    succeeds(act)
    act()
    figures(
        f"L9 {seconds / 60:.2g} minutes of garbage: {kind}",
        family=line, promise=6, pieces=babble.pieces, full=babble.full, calls=calls, succeeded=good,
        longest_s=round(took, 3), core_seconds_per_minute=round(used / seconds * 60, 2), seed=SEED,
        **({} if watched.most is None else {"most_bytes_held": watched.most}),
    )  # fmt: skip
