"""Servos in a control loop: one prepared read per servo, and targets."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from motorbus.core.request import Precondition, Request
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import gather
from motorbus.core.stream import PositionStream, read_positions
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.motion import limits, start, stop, target
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.requests import ask_presence, write_register


async def open_stream(servos: Sequence[Node], *, rate: int) -> PositionStream[Node]:
    """These servos for a control loop. Reads their limits and writes nothing; `rate` (bit/s) has no effect here.

    A target is checked against these limits. After a change of limits, mid point or sense of rotation it means
    something else and is refused. `start` makes the present position the target; the servos have no speed setting.
    Raises RequestError for no servo or a repeated one; else the first error of a servo.
    """

    async def read_limits(node: Node) -> tuple[float, float]:
        found = await limits(node)
        if node.at == -inf:  # the profile has no limits to read
            await ask_presence(node)
        return found

    found = await gather(*[read_limits(node) for node in servos])
    known = dict(zip(servos, found, strict=True))

    def goal(node: Node, to: float, precondition: Precondition) -> Request[None]:
        row, raw = node.table["goal_position"], target(node, to)
        setpoint = Setpoint(node.node, "position", float(row.to_value(raw)), *known[node])
        return write_register(node, row, raw, (setpoint,), precondition=precondition)

    async def start_one(node: Node, speed: float | None) -> None:
        if node.settings.must_start:
            await start(node)
        await stop(node)

    positions = [read_positions(node.node, position(node)) for node in servos]
    return PositionStream(servos, positions, goal, start_one, lambda node: node.limits != known[node])
