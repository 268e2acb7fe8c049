"""What simulated motors really did, whatever the host made of it: the plants' own movements, kept as they change.

A simulated motor is a function of time. Here each function is noted with the moment from which on it held, so later
every question about the past has an exact answer.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from math import inf
from typing import Any, NamedTuple

from motorbus.core.family import Simulator

COARSE, FINE = 0.004, 0.0001
"""s between two looks at where a motor was, and at the moment that was searched."""
STIRRED = 0.01
"""Counts; less is no movement. A pulse of a stepper is a count."""


class Went(NamedTuple):
    """One motor: its way (in its own counts), and when it first and last moved, and had done 1 % and 99 % (s)."""

    way: float
    first: float
    last: float
    one: float
    most: float


class Truth:
    """The movements of one simulated motor: `where(at)` on the clock of its bus."""

    def __init__(self) -> None:
        self._since: list[float] = []
        self._pieces: list[Callable[[float], float]] = []
        self._kept: object = None

    def keep(self, at: float, key: object, piece: Callable[[float], float]) -> None:
        """From this moment on the motor moves like that; nothing is kept when that is what it did before."""
        if key is not self._kept:
            self._kept = key
            self._since.append(at)
            self._pieces.append(piece)

    def where(self, at: float) -> float:
        """Where it was, in its own counts."""
        return self._pieces[max(0, bisect_right(self._since, at) - 1)](at)

    def went(self, begin: float, end: float) -> Went:
        """What it did between two moments at which it stood still."""
        start, goal = self.where(begin), self.where(end)
        way = goal - start
        first = self._crossed(begin, end, lambda at: abs(self.where(at) - start) > STIRRED)
        last = self._crossed(end, begin, lambda at: abs(self.where(at) - goal) > STIRRED)
        one = self._crossed(begin, end, lambda at: abs(self.where(at) - start) >= 0.01 * abs(way))
        most = self._crossed(end, begin, lambda at: abs(self.where(at) - goal) >= 0.01 * abs(way))
        return Went(way, first, last, one, most)

    def _crossed(self, since: float, until: float, there: Callable[[float], bool]) -> float:
        """The first moment, going from `since` towards `until`, at which it is so; `since` when it never is."""
        sign = 1.0 if until > since else -1.0
        for step in range(int(abs(until - since) / COARSE) + 1):
            at = since + sign * COARSE * (step + 1)
            if there(at):
                fine = (
                    since + sign * (COARSE * step + FINE * number)
                    for number in range(round(COARSE / FINE) + 1)
                )
                return next((one for one in fine if there(one)), at)
        return since


def watched(simulators: Mapping[str, Simulator]) -> dict[tuple[str, int], Truth]:
    """Keep the movements of all motors of these simulated buses from now on; by bus and id."""
    return {(bus, node): truth for bus, one in simulators.items() for node, truth in listened(one).items()}


def listened(simulator: Simulator) -> dict[int, Truth]:
    """Keep the movements of all motors of a simulated bus from now on, by id: look after each thing that happens."""
    truths = {node: Truth() for node in simulator.nodes}
    inner: Any = simulator
    receive, advance = inner.receive, inner.advance

    def look(at: float) -> None:
        for node, truth in truths.items():
            truth.keep(at, *_piece(simulator.nodes[node]))

    def received(data: Any, at: float) -> None:
        receive(data, at)
        look(at)

    def advanced(to: float) -> Any:
        told = advance(to)
        look(to)
        return told

    look(0.0)
    inner.receive, inner.advance = received, advanced
    return truths


def _piece(node: Any) -> tuple[object, Callable[[float], float]]:
    """What moves it now, and where that is at a moment."""
    if hasattr(node, "shaft"):
        return node.shaft.motion, node.shaft.motion.position
    if hasattr(node, "machine"):
        machine, start = node.machine, node.machine.base + node.offset
        move, since, until = machine.motion, machine.since, machine.until
        if move is None:
            return "rest", lambda at: start
        return move, lambda at: start + move.sign * move.done((inf if at >= until else at) - since)
    return node.motion, node.motion.position
