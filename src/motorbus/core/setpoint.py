"""What a motion request asks of each node, and when the node acts on it; the gate judges it before it leaves."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple


class Stays(Enum):
    """Marks a setpoint that moves nothing. The driver sets it; it is never derived from the numbers."""

    STILL = "still"
    """Hold the present position, or rest without torque: ends a movement; the gate always lets it pass."""
    ON = "on"
    """Hold the present position, or do nothing, with torque switched on."""


class Setpoint(NamedTuple):
    """What a motion request asks of one node, in API units, with the limits in force when the request was made.

    `quantity` is position or relative (rad); velocity (rad/s), load (fraction) or current (A), which the node follows
    until the next setpoint; speed (rad/s), cap (A) or time (a share of the longest), which only bound a movement; or
    torque (1: on). A limit is None where it is unknown; the gate refuses what it cannot judge.
    """

    node: int
    quantity: str
    value: float
    low: float | None = None
    high: float | None = None
    stays: Stays | None = None


def torque_on(node: int) -> Setpoint:
    """The setpoint of a request that only enables torque, or lets the node accept goals."""
    return Setpoint(node, "torque", 1.0, 1.0, 1.0, Stays.ON)


def torque_off(node: int) -> Setpoint:
    """The setpoint of a request that disables torque: the node rests, whatever its earlier goals."""
    return Setpoint(node, "torque", 0.0, 0.0, 0.0, Stays.STILL)


class Deferred:
    """Marks a request whose setpoints do not take effect on arrival, or that makes such setpoints take effect.

    Without `begins` its setpoints wait in `node` and replace those that waited there. With `begins` the setpoints that
    wait in `node` (None: in all nodes) take effect. `done`: the request was acknowledged; the driver sets it where
    devices acknowledge such a request.
    """

    __slots__ = ("begins", "done", "node")

    def __init__(self, node: int | None, *, begins: bool = False) -> None:
        self.node: Final = node
        self.begins: Final = begins
        self.done = False
