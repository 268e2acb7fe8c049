"""A `core.family.PositionStream`: servos in a loop.

Whoever has this has devices that several families' loops, moves and teaching can lead. All that a cycle needs is asked
beforehand, once: a cycle then asks for positions and orders goals, and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, isfinite
from typing import Final

from motorbus.core.family import Positions
from motorbus.core.request import Request
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import gather
from motorbus.errors import LimitExceeded, RequestError

from .driver import Node, enable_torque, limits, position, write_row
from .table import TABLE

_GOAL: Final = TABLE["goal_position"]
_VELOCITY: Final = TABLE["move_velocity"]


async def train(servos: Sequence[Node], *, rate: int) -> Train:
    """These servos, ready to be led; their limits are read and nothing is written. `rate` changes nothing here."""
    await gather(*[limits(node) for node in servos])
    return Train(servos)


class Train:
    """Made by `train`. Each servo has a lane, so all exchanges of a cycle may be in flight at once."""

    def __init__(self, servos: Sequence[Node]) -> None:
        self._servos: Final = {node.node: node for node in servos}
        self.nodes: Final = tuple(self._servos)
        self.positions: Final = tuple(_position(node) for node in servos)

    def goals(self, to: Mapping[int, float]) -> Sequence[Request[None]]:
        """One frame for each. Raises LimitExceeded for what is no number or fits no register."""
        return [_order(self._servo(id), value) for id, value in to.items()]

    async def begin(self, speeds: Mapping[int, float]) -> None:
        """Torque on where it stands, and as quick (rad/s) as it may be. Everyone is visited before an error is raised.

        What one cannot be told exactly is rounded up: who follows goals must not fall behind them.
        """
        await gather(*[_begin(node, speeds.get(id)) for id, node in self._servos.items()])

    def _servo(self, id: int) -> Node:
        if id in self._servos:
            return self._servos[id]
        raise RequestError(f"node {id} is not led here", expected=f"one of {self.nodes}")


def _position(node: Node) -> Request[Positions]:
    one = position(node)
    read = one.decode
    assert read is not None
    return one.with_decoder(lambda answer: Positions({node.node: read(answer)}, (), answer.at))


def _order(node: Node, to: float) -> Request[None]:
    known = node.limits
    if known is None:
        raise _written(node)
    raw = _GOAL.to_raw(to) if isfinite(to) else _GOAL.high + 1
    if not _GOAL.low <= raw <= _GOAL.high:
        raise LimitExceeded(
            f"node {node.node}: {to} is no position",
            advice="give a number in rad; nothing was sent",
            node=node.node,
        )
    goal = Setpoint(node.node, "position", float(_GOAL.to_value(raw)), *known)
    return write_row(
        node, _GOAL, raw, goal, precondition=lambda _: None if node.limits == known else _written(node)
    )


def _written(node: Node) -> RequestError:
    return RequestError(
        f"the settings of node {node.node} were written since it was led, and goals may mean something else",
        advice="end the loop and begin another; nothing was sent",
        node=node.node,
    )


async def _begin(node: Node, speed: float | None) -> None:
    await enable_torque(node)
    raw = _VELOCITY.high if speed is None else ceil(speed / _VELOCITY.scale)
    await write_row(node, _VELOCITY, min(max(raw, _VELOCITY.low), _VELOCITY.high))
