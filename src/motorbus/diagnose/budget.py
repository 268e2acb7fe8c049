"""Will it fit? The load of a CAN bus, counted to the bit, before anything is sent.

Whoever plans sixteen servos at 100 Hz wants to know beforehand whether the wire can carry them, and how many must be
under way at once when the adapter takes its time. Stuff bits are counted, not estimated: frames full of zeros have
more of them than random ones. Family-blind: it takes frames, whoever made them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from motorbus.core.can_bits import bits, least
from motorbus.core.can_frame import REMOTE_FLAG, CanFrame
from motorbus.errors import RequestError


class Transfer(NamedTuple):
    """One exchange of a loop with one node.

    `frames` is every frame it puts on the wire, request first, each given as all the frames that it may be: one
    where it is known exactly, the replies for all values where it is not.
    """

    node: int
    frames: tuple[Sequence[CanFrame], ...]
    name: str = ""


class Traffic(NamedTuple):
    """What comes beside the loop, `rate` frames per second of all senders together; `frames` is all it may be."""

    frames: Sequence[CanFrame]
    rate: float
    name: str = ""


@dataclass(frozen=True, slots=True)
class Span:
    """Least, mean and most over all the frames that may come."""

    least: float
    mean: float
    most: float

    def scaled(self, factor: float) -> Span:
        """Each of the three times `factor`."""
        return Span(self.least * factor, self.mean * factor, self.most * factor)


@dataclass(frozen=True, slots=True)
class Cost:
    """One transfer: the bits of all its frames, of each frame, and the bus time (s)."""

    node: int
    name: str
    bits: Span
    frames: tuple[Span, ...]
    time: Span


@dataclass(frozen=True, slots=True)
class Budget:
    """What a loop costs on a bus.

    `bitrate`          bit/s
    `transfers`        the cost of each transfer, in order
    `bits`             of one loop, stuff bits and interframe space included
    `unstuffed`        the same without stuff bits: the figure of a naive calculation
    `time`             bus time of one loop, s
    `besides`          fraction of the bus that other traffic takes
    `loop_rate`        loops per second that were asked about; 0: none
    `load`             fraction of the bus at that rate, other traffic included; above 1 is impossible
    `highest_rate`     loops per second that fill the bus; its `least` holds with the longest frames
    `sequential_rate`  loops per second when one exchange at a time is under way
    `in_flight`        exchanges that must be under way at once to keep the bus busy
    `latency`          of adapter and host, both ways together, s
    `turnaround`       of a device before it answers, s
    """

    bitrate: int
    transfers: tuple[Cost, ...]
    bits: Span
    unstuffed: int
    time: Span
    besides: Span
    loop_rate: float
    load: Span
    highest_rate: Span
    sequential_rate: float
    in_flight: float
    latency: float
    turnaround: float

    def fits(self) -> bool:
        """The bus carries it even if every frame has its most bits."""
        return self.load.most <= 1.0


def budget(
    cycle: Sequence[Transfer],
    bitrate: int,
    *,
    loop_rate: float = 0.0,
    latency: float = 0.0,
    turnaround: float = 0.0,
    besides: Sequence[Traffic] = (),
) -> Budget:
    """What one loop over these transfers costs at `bitrate` bit/s; the arguments are explained at `Budget`.

    Raises RequestError when there is nothing to count, or for a rate or a time that cannot be.
    """
    _check(cycle, bitrate, (loop_rate, latency, turnaround, *(one.rate for one in besides)))
    costs = tuple(_cost(transfer, bitrate) for transfer in cycle)
    total = _sum(cost.bits for cost in costs)
    time = total.scaled(1 / bitrate)
    others = _sum(_of(one.frames).scaled(one.rate / bitrate) for one in besides)
    load = _sum((time.scaled(loop_rate), others)) if loop_rate else Span(0.0, 0.0, 0.0)
    wait = sum(latency + turnaround for transfer in cycle if len(transfer.frames) > 1)
    return Budget(
        bitrate=bitrate,
        transfers=costs,
        bits=total,
        unstuffed=sum(max(map(_unstuffed, frames)) for transfer in cycle for frames in transfer.frames),
        time=time,
        besides=others,
        loop_rate=loop_rate,
        load=load,
        highest_rate=Span(*(_rate(*pair) for pair in _worst_first(time, others))),
        sequential_rate=1 / (time.mean + wait),
        in_flight=(time.mean + wait) / time.mean,
        latency=latency,
        turnaround=turnaround,
    )


def _unstuffed(frame: CanFrame) -> int:
    return least(0 if frame.id & REMOTE_FLAG else len(frame.data), frame.extended)


def _cost(transfer: Transfer, bitrate: int) -> Cost:
    frames = tuple(_of(frames) for frames in transfer.frames)
    total = _sum(frames)
    return Cost(transfer.node, transfer.name, total, frames, total.scaled(1 / bitrate))


def _of(frames: Sequence[CanFrame]) -> Span:
    found = [bits(frame) for frame in frames]
    return Span(min(found), math.fsum(found) / len(found), max(found))


def _sum(spans: Iterable[Span]) -> Span:
    known = list(spans)
    return Span(
        math.fsum(span.least for span in known),
        math.fsum(span.mean for span in known),
        math.fsum(span.most for span in known),
    )


def _worst_first(time: Span, others: Span) -> tuple[tuple[float, float], ...]:
    return (time.most, others.most), (time.mean, others.mean), (time.least, others.least)


def _rate(time: float, taken: float) -> float:
    return max(0.0, 1.0 - taken) / time


def _check(cycle: Sequence[Transfer], bitrate: int, not_negative: tuple[float, ...]) -> None:
    if not cycle or not all(transfer.frames and all(transfer.frames) for transfer in cycle):
        raise RequestError(
            "there is no frame to count", expected="at least one transfer, each with its frames"
        )
    if bitrate <= 0:
        raise RequestError(f"{bitrate} is no bit rate", expected="bit/s, more than 0")
    if not all(math.isfinite(value) and value >= 0 for value in not_negative):
        raise RequestError(
            "a rate or a time of the budget cannot be", expected="finite numbers, not negative, in Hz and s"
        )
