"""Rows L10 and L11: a reply is the same in whatever pieces it comes, and so are several that come in one.

A reply of n bytes has 2^(n-1) ways; all of them for up to ten bytes, and chance for longer ones (`test_lines.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, pairwise
from typing import Any

import pytest

from motorbus.core.operation import Data, Event
from motorbus.families.feetech import FAMILY as FEETECH
from motorbus.families.feetech import wire as feetech
from motorbus.families.stepper import FAMILY as STEPPER
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.slcan import SlcanCodec
from tests.support.rigs.feetech import Rig, ping, read_word
from tests.support.single_faults import tried_again

WORD = feetech.encode_status(1, 0, b"\x12\x34")
REPLIES: dict[str, tuple[Callable[[], Any], bytes]] = {
    "feetech, 6 bytes": (FEETECH.receiver, feetech.encode_status(1, 0)),
    "feetech, 8 bytes": (FEETECH.receiver, WORD),
    "feetech, 10 bytes": (FEETECH.receiver, feetech.encode_status(1, 0x20, b"\xff\xff\x01\x04")),
    "feetech, noise before": (FEETECH.receiver, b"\xff\x00" + WORD),
    "stepper, 6 bytes": (STEPPER.receiver, bytes.fromhex("FFAA000B0301")),
    "stepper, a notice and a reply": (STEPPER.receiver, bytes.fromhex("EEDDFFAA000B0301")),
    "slcan, a short frame": (SlcanCodec, b"t5A51AB\r"),
}


def ways(data: bytes) -> Iterator[list[bytes]]:
    """Every way to cut it."""
    places = range(1, len(data))
    for count in range(len(data)):
        for cuts in combinations(places, count):
            yield [data[a:b] for a, b in zip((0, *cuts), (*cuts, len(data)), strict=True)]


def told(make: Callable[[], Any], pieces: list[bytes]) -> list[Event]:
    """What a receiver makes of these pieces; noise counts by its bytes, for it may be told in pieces too."""
    receiver = make()
    events = [event for piece in pieces for event in receiver.feed(piece)]
    return events + (list(receiver.flush()) if hasattr(receiver, "flush") else [])


@pytest.mark.parametrize("name", REPLIES)
def test_l10_every_way_to_cut_a_reply_gives_the_same_events(name: str) -> None:
    make, data = REPLIES[name]
    whole = [event for event in told(make, [data]) if type(event).__name__ != "Noise"]
    assert whole
    number = 0
    for pieces in ways(data):
        number += 1
        assert [event for event in told(make, pieces) if type(event).__name__ != "Noise"] == whole
    assert number == 2 ** (len(data) - 1)


class Cut(PerfectLine):
    """Hands the next reply over in these pieces, some time (s) apart."""

    def __init__(self) -> None:
        self.pieces: tuple[int, ...] = ()
        self.apart = 0.0
        self.fired = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST or not isinstance(data, bytes):
            return super().carry(sender, data, at)
        self.fired += 1
        ends = (0, *(place for place in self.pieces if place < len(data)), len(data))
        pieces = [data[a:b] for a, b in pairwise(ends)]
        return [Delivery(at + number * self.apart, Side.HOST, piece) for number, piece in enumerate(pieces)]


@pytest.mark.parametrize("apart", [0.0, 1e-5, 1e-3])
@pytest.mark.parametrize(("exchange", "length"), [(ping, 6), (read_word, 9)])
def test_l10_every_way_to_cut_a_reply_is_the_same_reply_to_a_bus(
    exchange: Callable[[Rig], None], length: int, apart: float
) -> None:
    line = Cut()
    rig = Rig(line, ids=(1,))
    line.apart = apart
    number = 0
    for count in range(length):
        for line.pieces in combinations(range(1, length), count):
            exchange(rig)
            number += 1
    assert number == line.fired == 2 ** (length - 1)
    assert tried_again(rig.bus) == 0


def test_l11_answers_in_one_piece_with_noise_between_are_each_heard_once() -> None:
    replies = [feetech.encode_status(id, 0, bytes((id, 2 * id))) for id in range(1, 20)]
    noise = (b"", b"\xff", b"\xff\xff", b"\x00", b"\xff\xff\xfe", b"\xff\x55\xaa")
    joined = b"".join(noise[number % len(noise)] + reply for number, reply in enumerate(replies))
    heard = [event.data for event in told(FEETECH.receiver, [joined]) if type(event).__name__ == "Reply"]
    assert heard == replies
