"""What a receiver makes of a wire on which several talk at once, bit by bit.

The wire is one for all and idles high; whoever sends a 0 pulls it low, so a low bit of anyone wins. The receiver is
a plain UART: a falling edge begins a byte, each bit is looked at in its middle, and after the middle of the stop bit it
waits for the next falling edge. So two packets that begin within half a bit of each other are merged bit for bit, and
those that begin farther apart come out as bytes that neither has sent: fewer or more of them, and some with a stop bit
that is low.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Generic, NamedTuple, TypeVar

S = TypeVar("S")

BITS: Final = 10
"""Of a byte on the wire: start, eight data bits from the lowest on, stop."""
_OVERSAMPLING: Final = 16
"""A receiver looks at the wire so often in a bit; what is shorter it does not see."""


class Speech(NamedTuple, Generic[S]):
    """Bytes that one servo sends from `start` on (s), each bit of them for `bit` seconds."""

    start: float
    data: bytes
    bit: float
    servo: S

    @property
    def end(self) -> float:
        """When its last stop bit is over."""
        return self.start + BITS * self.bit * len(self.data)


class Received(NamedTuple):
    """A byte as the receiver takes it: when its start bit began (s), its value, and whether its stop bit was high."""

    at: float
    value: int
    framed: bool


def overlapping(speeches: Iterable[Speech[S]]) -> Iterator[list[Speech[S]]]:
    """Those that talk at once together, in order of time; who begins when another ends is on his own."""
    together: list[Speech[S]] = []
    end = 0.0
    for speech in sorted(speeches, key=lambda speech: speech.start):
        if together and speech.start > end - speech.bit / _OVERSAMPLING:
            yield together
            together = []
        end = max(end, speech.end) if together else speech.end
        together.append(speech)
    if together:
        yield together


def heard(speeches: Sequence[Speech[S]], bit: float, *, drop_unframed: bool = False) -> bytes:
    """What a receiver set to `bit` seconds per bit gets of all these together.

    A byte whose stop bit was low is delivered as it was sampled, which is what serial ports do unless a program asks
    for more; `drop_unframed` leaves it out.
    """
    if len(speeches) == 1:
        return speeches[0].data
    return bytes(one.value for one in received(speeches, bit) if one.framed or not drop_unframed)


def received(speeches: Iterable[Speech[S]], bit: float) -> Iterator[Received]:
    """Every byte that such a receiver finds on the wire, in order."""
    lows = _lows(speeches, bit / _OVERSAMPLING)
    begins = [begin for begin, _ in lows]

    def low(at: float) -> bool:
        index = bisect_right(begins, at) - 1
        return index >= 0 and at < lows[index][1]

    free = begins[0] - bit if begins else 0.0
    for begin in begins:
        if begin < free or not low(begin + bit / 2):
            continue  # it is busy with a byte; or this is no start bit but noise
        bits = (low(begin + (1.5 + place) * bit) for place in range(8))
        value = sum(1 << place for place, is_low in enumerate(bits) if not is_low)
        yield Received(begin, value, not low(begin + 9.5 * bit))
        free = begin + 9.5 * bit


def _lows(speeches: Iterable[Speech[S]], shortest: float) -> list[tuple[float, float]]:
    """When the wire is low, from whom ever; a gap too short to be seen is none."""
    merged: list[tuple[float, float]] = []
    for begin, end in sorted(low for speech in speeches for low in _pulses(speech)):
        if merged and begin <= merged[-1][1] + shortest:
            merged[-1] = merged[-1][0], max(end, merged[-1][1])
        else:
            merged.append((begin, end))
    return merged


def _pulses(speech: Speech[S]) -> Iterator[tuple[float, float]]:
    """When this one pulls the wire low."""
    for number, value in enumerate(speech.data):
        levels = value << 1 | 1 << BITS - 1
        for place in range(BITS):
            if not levels >> place & 1:
                begin = speech.start + (number * BITS + place) * speech.bit
                yield begin, begin + speech.bit
