"""What an order says of each device, so that it can be judged before it leaves, and when it is obeyed."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple


class Stays(Enum):
    """That an order makes nothing go anywhere; said by whoever made it so, and never found out from its numbers."""

    STILL = "still"
    """Stay where it stands, or rest: it ends a movement, and passes whatever happens."""
    ON = "on"
    """The same, or nothing at all, and torque comes on with it."""


class Goal(NamedTuple):
    """What a motion exchange orders of one node, in API units, with the limits in force when it was made.

    `quantity` is position (rad) or relative (rad); velocity (rad/s), load (fraction) or current (A), which are obeyed
    until something else is ordered; what only bounds a movement: speed (rad/s), cap (A), time (a share of the
    longest); or torque, which 1 switches on. A limit that is not known is None, and the gate refuses what it cannot
    judge. `stays` marks what makes it go nowhere.
    """

    node: int
    quantity: str
    value: float
    low: float | None = None
    high: float | None = None
    stays: Stays | None = None


def torque_on(node: int) -> Goal:
    """Torque, or leave to obey goals, and nothing else."""
    return Goal(node, "torque", 1.0, 1.0, 1.0, Stays.ON)


def torque_off(node: int) -> Goal:
    """No torque: it rests, whatever it was told before."""
    return Goal(node, "torque", 0.0, 0.0, 0.0, Stays.STILL)


class Later:
    """Marks an exchange whose goals are not obeyed when it arrives, or that lets such goals begin.

    Without `begins` what it brings waits in `node`, in place of what waited there. With it, what waits in `node` (None:
    in everyone) begins. `done`: it has been acknowledged, where anybody acknowledges it; set by whoever made it.
    """

    __slots__ = ("begins", "done", "node")

    def __init__(self, node: int | None, *, begins: bool = False) -> None:
        self.node: Final = node
        self.begins: Final = begins
        self.done = False
