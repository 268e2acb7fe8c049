"""Whom an emergency stop must reach, and where each of them was last seen.

A node is known once it has answered or has been ordered to move. Where it was seen counts only while that is fresh
and nothing has set it moving since: holding a device at a place it has left would be an order to go back.
"""

from __future__ import annotations

from typing import Any

from motorbus.core.family import Family
from motorbus.core.operation import ANY, Answer, Effect, Exchange, Rank

FRESH = 0.02  # s; an older position is not where a moving device is
MOVING = (Effect.TORQUE, Effect.MOTION)


class Known(dict[int, Answer | None]):
    """Nodes with their last answer that told a position.

    `rate` is the bit rate at which one was last heard. `frames` stop everybody known, without a position: they are
    made when a node becomes known, for the case that a stop cannot make new ones.
    """

    def __init__(self, family: Family, rate: int) -> None:
        super().__init__()
        self.family = family
        self.rate = rate
        self.frames = family.stop({})

    def hear(self, node: int, position: Answer | None, rate: int) -> None:
        """This node has answered, or has been ordered to move (None)."""
        self.rate = rate
        if node not in self:
            self[node] = position
            self.frames = self.family.stop(dict.fromkeys(self))
        elif position is not None:
            self[node] = position

    def order(self, exchange: Exchange[Any], rate: int) -> None:
        """An exchange leaves that may set something moving: whom it orders is known, and is not where it was."""
        for goal in exchange.goals:
            self.hear(goal.node, None, rate)
        if exchange.effect not in MOVING or exchange.rank is Rank.STOP:
            return
        dues = () if exchange.replies is ANY else exchange.replies
        nodes = {due.node for due in dues} | {goal.node for goal in exchange.goals}
        for node in nodes & set(self) if nodes else list(self):  # one that names nobody may move everybody
            self[node] = None

    def fresh(self, now: float) -> dict[int, Answer | None]:
        """Everybody, with the last position if that is fresh, else None."""
        return {
            node: answer if answer is not None and now - answer.at < FRESH else None
            for node, answer in self.items()
        }
