"""Row L9: what is done with garbage grows as the garbage does, and no faster. Work is counted, not timed.

It is counted in lines of the product that are executed and in bytes that were held back and are looked at once more. A
receiver that looks again and again at all that it has heard would do sixteen times as much for four times the garbage.
What a regular expression does within one line is not seen; that is why it comes byte by byte and all at once as well.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from random import Random
from types import FrameType
from typing import Any

import pytest

from motorbus.core.operation import Data
from motorbus.families import feetech, kst, stepper
from motorbus.link.can_text import SlcanReader
from tests.conftest import Figures, Rounds
from tests.faults.cutting import ours
from tests.faults.off import are_off
from tests.faults.test_garbage import CAN, CONTROLLER, SERVO, TEXT

FEW = 1_600
"""Bytes; more than anybody holds back."""
MORE = 4
MOST = 4.5
"""So many times the work, at most, for so many times the garbage."""
CHANCE = 0.01
"""Lines for each byte, below which it is chance how many there are: what is looked through at once by one call costs
lines only where noise looks like a packet, some hundred in 400 000 bytes."""
Garbage = Callable[[Random], list[Data]]
READERS: dict[str, tuple[Callable[[], Any], dict[str, Garbage]]] = {
    "feetech": (feetech.FAMILY.receiver, SERVO),
    "kst": (kst.FAMILY.receiver, CAN),
    "kst by slcan": (SlcanReader, TEXT),
    "stepper": (stepper.FAMILY.receiver, CONTROLLER),
}
ALL = [(line, kind) for line, (_, kinds) in READERS.items() for kind in kinds]


class Work:
    """Counts the executed lines of the product, while it is in force."""

    def __init__(self) -> None:
        self.lines = 0

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        if not ours(frame.f_code.co_filename):
            return None
        self.lines += event == "line"
        return self


def made(garbage: Garbage, size: int) -> list[Data]:
    """So many bytes of it at least, in the pieces in which it comes."""
    random, found, total = Random(3), list[Data](), 0
    while total < size and not are_off():
        piece = garbage(random)
        found += piece
        total += sum(map(len, piece))
    return found


def as_it_comes(pieces: list[Data]) -> Iterator[Data]:
    yield from pieces


def byte_by_byte(pieces: list[Data]) -> Iterator[Data]:
    for piece in pieces:
        if isinstance(piece, bytes):
            yield from (piece[at : at + 1] for at in range(len(piece)))
        else:
            yield piece


def all_at_once(pieces: list[Data]) -> Iterator[Data]:
    if all(isinstance(piece, bytes) for piece in pieces):
        yield b"".join(pieces)  # type: ignore[arg-type]
    else:
        yield from pieces


def held(reader: Any) -> int:
    """How many bytes wait for more."""
    return len(reader._rest) if hasattr(reader, "_rest") else getattr(reader, "held", 0)


def work(reader: Any, pieces: list[Data], cut: Callable[[list[Data]], Iterator[Data]]) -> int:
    """What is done with these."""
    counted, again = Work(), 0
    for piece in cut(pieces):
        again += held(reader)
        before = sys.gettrace()
        sys.settrace(counted)
        try:
            reader.feed(piece)
        finally:
            sys.settrace(before)
    return counted.lines + again


@pytest.mark.parametrize("cut", [as_it_comes, byte_by_byte, all_at_once], ids=lambda cut: cut.__name__)
@pytest.mark.parametrize(("line", "kind"), ALL)
def test_l9_four_times_the_garbage_is_four_times_the_work(
    line: str, kind: str, cut: Callable[[list[Data]], Iterator[Data]], rounds: Rounds, figures: Figures
) -> None:
    make, kinds = READERS[line]
    size = max(FEW, rounds(100_000, FEW))
    few, many = made(kinds[kind], size), made(kinds[kind], MORE * size)
    heard = sum(map(len, many))
    assert heard >= MORE * size
    once, more = work(make(), few, cut), work(make(), many, cut)
    assert once
    assert more / heard <= max(MOST / MORE * once / sum(map(len, few)), CHANCE)
    figures(
        f"L9 work on {MORE} times the garbage, {kind}, {cut.__name__.replace('_', ' ')}",
        family=line, promise=6, bytes=heard, most_work_per_byte=round(more / heard, 2),
        most_growth=round(more / heard * sum(map(len, few)) / once * MORE, 3),
    )  # fmt: skip


class Hoarder:
    """A receiver that keeps all it has heard, and looks through it every time."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> None:
        self._rest += data


def test_l9_work_that_grows_faster_is_seen() -> None:
    few, many = made(TEXT["random"], FEW), made(TEXT["random"], MORE * FEW)
    assert work(Hoarder(), many, as_it_comes) > 2 * MOST * work(Hoarder(), few, as_it_comes)
