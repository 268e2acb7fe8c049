"""Does this link take its bit time? Then a reply that comes sooner than frames can travel answers an older request.

A link may say so by itself. A CAN adapter says nothing: behind it may be a real bus, or a simulator that answers at
once. It shows: when so many replies in a row have taken their time, the next one that does not is suspect. It is put
aside until the deadline; if the true one follows, it was a copy, and if twice running nothing follows, the link has
no bit time. (Once, the true one may have been lost.)
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from motorbus.core.can_bits import bits, least
from motorbus.core.family import Family
from motorbus.core.operation import ANY, CanFrame, Exchange, Rank, Timeout

SHOWN = 32  # replies in a row, none of them too early
MISSED = 2  # replies in a row that were put aside and had none behind them
EARLY = 0.9  # of the least time; clocks differ, and so do bit rates by their tolerance
MARGIN = {  # s; a busy host may run this late without a reply counting as missing
    Timeout.SCAN: 0.002,  # silence is the usual answer here, and a second pass follows
    Timeout.REPLY: 0.02,
    Timeout.STORE: 0.02,
}
SETTLE = 1.5  # byte times after a reply that came in pieces, for the byte that would be one too many
DIRECT = 0.001  # s; a link of less latency has no adapter that holds bytes back


class Pace:
    """What is known of one link; `certain` where it says itself that it takes bit time."""

    __slots__ = ("certain", "missed", "seen")

    def __init__(self, certain: bool) -> None:
        self.certain = certain
        self.seen = 0
        self.missed = 0

    @property
    def refuted(self) -> bool:
        """A reply was there sooner than it could travel, and it was the true one."""
        return self.seen < 0

    def refute(self) -> None:
        """Replies need no time here: none is ever suspect again."""
        if not self.certain:
            self.seen = -1

    def suspects(self, took: float, least: float) -> bool:
        """A reply took so long (s) where `least` is what its bits take: is it one to be put aside?"""
        early = took < EARLY * least
        if self.certain or self.refuted:
            return early and self.certain
        if early and self.seen < SHOWN:
            self.refute()
            return False
        if not early:
            self.seen += 1
            self.missed = 0
        return early

    def nothing_behind(self) -> bool:
        """No reply came behind one that was put aside; True when that shows that it was the true one."""
        self.missed += 1
        if self.missed >= MISSED:
            self.refute()
        return self.refuted


def least_time(exchange: Exchange[Any], family: Family, rate: int, without: Collection[int] = ()) -> float:
    """s: the least time in which an answer can be here; a family's air time of frames may count the most bits.

    `without` are nodes that nobody waits for: they may be silent, and then the others are here sooner.
    """
    request, dues = exchange.request, exchange.replies
    if without and dues is not ANY:
        dues = tuple(due for due in dues if due.node not in without)
        exchange = Exchange(request, dues, timeout=exchange.timeout)
    if not isinstance(request, CanFrame) or dues is ANY:
        return family.air_time(exchange, rate)
    return (bits(request) + sum(least(due.length, request.extended) for due in dues)) / rate


def patience(exchange: Exchange[Any], family: Family, latency: float) -> float:
    """s from when all frames can have passed until what has not come counts as missing.

    Where silence is the usual answer a family may wait for what adapters hold back. On a line without one a device gets
    as long as for any other answer, and the host no margin: one that is late looks once more before it calls anybody
    silent.
    """
    thinks = family.turnaround(exchange)
    if exchange.timeout is Timeout.SCAN and latency < DIRECT:
        usual = family.turnaround(Exchange(exchange.request, exchange.replies))
        if usual < thinks:
            return usual + latency
    return thinks + latency + MARGIN[Timeout.SCAN if exchange.rank is Rank.STOP else exchange.timeout]


def byte_time(exchange: Exchange[Any], family: Family, rate: int) -> float:
    """s that one byte of this exchange takes, on average."""
    dues = () if exchange.replies is ANY else exchange.replies
    size = len(exchange.request) + sum(due.length for due in dues)
    return family.air_time(exchange, rate) / size
