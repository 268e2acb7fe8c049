"""An order that a control loop gives again and again, every time with other goals.

Most of it is said by what it is for: who is ordered, by which registers, under which settings. That is its `Aim`, and
the same every time. What its goals are in words is asked by whoever must look closely, and made only then; so an order
costs hardly more than its bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from motorbus.core.operation import Answer, Effect, Exchange, Goal, Rank, Refusal, Timeout


class Aim:
    """What all orders have in common that are made in one mould: the nodes they are for, how the goals are made of raw
    values, and why one must not leave after all; see `Exchange`. They are all as long: `air` is a rate of the bus
    (bit/s), and the time (s) that one of them took on the wire at that rate, once a bus has found that out."""

    __slots__ = ("air", "goals", "ordered", "refusal")

    def __init__(
        self, ordered: Sequence[int], goals: Callable[[Sequence[int]], tuple[Goal, ...]], refusal: Refusal
    ) -> None:
        self.ordered: Final = ordered
        self.goals: Final = goals
        self.refusal: Final = refusal
        self.air: tuple[int | None, float] = None, 0.0  # None is the rate of no bus


class Aimed(Exchange[None]):
    """A request to several nodes that none of them answers, and that moves them; see `Exchange`.

    It is `sure`: each of its goals is a finite number within the limits that it brings, and none goes on without an
    end.
    """

    __slots__ = ("_goals", "_raws", "aim")

    aim: Aim
    refusal: Refusal  # type: ignore[misc]
    sure = True
    replies = ()  # type: ignore[misc]  # the same of all, so it is said once
    lane = 0  # type: ignore[misc]
    rank = Rank.CONTROL  # type: ignore[misc]
    effect = Effect.MOTION  # type: ignore[misc]
    timeout = Timeout.REPLY  # type: ignore[misc]
    repeatable = False  # type: ignore[misc]
    tells_position = False  # type: ignore[misc]
    later = None  # type: ignore[misc]
    other = None  # type: ignore[misc]
    whole = None  # type: ignore[misc]
    course = None

    def __init__(self, request: bytes, aim: Aim, raws: Sequence[int]) -> None:
        self.request = request  # type: ignore[misc]
        self.aim = aim
        self.refusal = aim.refusal  # type: ignore[misc]
        self._raws = raws
        self._goals: tuple[Goal, ...] | None = None

    def under(self, aim: Aim) -> Aimed:
        """The same order under another aim."""
        return Aimed(self.request, aim, self._raws)  # type: ignore[arg-type]  # bytes, as it was made of

    @staticmethod  # type: ignore[misc]
    def read(_: Answer) -> None:
        """Nobody answers, so there is nothing to read."""

    @property  # type: ignore[misc]
    def goals(self) -> tuple[Goal, ...]:
        """What it orders, per node, for the gate."""
        if self._goals is None:
            self._goals = self.aim.goals(self._raws)
        return self._goals

    @property
    def ordered(self) -> Sequence[int]:
        """The nodes of its goals."""
        return self.aim.ordered
