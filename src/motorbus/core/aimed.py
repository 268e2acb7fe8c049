"""Goal requests that a control loop sends in every cycle, each time with other goals.

`Aim` holds what these requests have in common. The `Goal` values of a request are computed when a caller first reads
them, so that a request costs little more than its bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from motorbus.core.operation import Effect, Exchange, Goal, Priority, Refusal, Response, TimeoutClass


class Aim:
    """The common part of goal requests: their nodes, the conversion of raw values to goals, and `refusal`.

    `refusal` is that of `Exchange`.
    """

    __slots__ = ("goals", "ordered", "refusal")

    def __init__(
        self, ordered: Sequence[int], goals: Callable[[Sequence[int]], tuple[Goal, ...]], refusal: Refusal
    ) -> None:
        self.ordered: Final = ordered
        self.goals: Final = goals
        self.refusal: Final = refusal


class Aimed(Exchange[None]):
    """A request that moves several nodes and has no reply; see `Exchange`.

    It is `sure`: each goal is a finite number within the limits that it carries, and no goal is an endless motion.
    """

    __slots__ = ("_goals", "_raws", "aim")

    aim: Aim  # type: ignore[misc]
    refusal: Refusal  # type: ignore[misc]
    sure = True
    replies = ()  # type: ignore[misc]  # the same for all requests, so it is a class attribute
    lane = 0  # type: ignore[misc]
    rank = Priority.CONTROL  # type: ignore[misc]
    effect = Effect.MOTION  # type: ignore[misc]
    timeout = TimeoutClass.REPLY  # type: ignore[misc]
    repeatable = False  # type: ignore[misc]
    tells_position = False  # type: ignore[misc]
    later = None  # type: ignore[misc]
    other = None
    whole = None
    course = None

    def __init__(self, request: bytes, aim: Aim, raws: Sequence[int]) -> None:
        self.request = request  # type: ignore[misc]
        self.aim = aim
        self.refusal = aim.refusal  # type: ignore[misc]
        self._raws = raws
        self._goals: tuple[Goal, ...] | None = None

    def under(self, aim: Aim) -> Aimed:
        """The same request with another aim."""
        return Aimed(self.request, aim, self._raws)  # type: ignore[arg-type]  # always bytes here

    @staticmethod
    def read(_: Response) -> None:
        """There is no reply to read."""

    @property  # type: ignore[misc]
    def goals(self) -> tuple[Goal, ...]:
        """The goal of each node, for the gate."""
        if self._goals is None:
            self._goals = self.aim.goals(self._raws)
        return self._goals

    @property
    def ordered(self) -> Sequence[int]:
        """The nodes of the goals."""
        return self.aim.ordered
