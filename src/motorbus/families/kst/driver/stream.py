"""Servos in a control loop: one prepared read per servo, and targets.

Each servo has a lane, so all frames of a cycle may be in flight at once. A target is checked against the limits read
before; after a change of limits, mid point or sense of rotation it means something else and is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Final

from motorbus.core.family import Positions
from motorbus.core.register import shown
from motorbus.core.request import Request, Stops
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import gather
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.motion import limits, start, stop, target
from motorbus.families.kst.driver.node import Node, check_above_zero
from motorbus.families.kst.driver.requests import ask_presence, write_register


async def open_stream(servos: Sequence[Node], *, rate: int) -> PositionStream:
    """These servos for a control loop. Reads their limits and writes nothing; `rate` (bit/s) has no effect here.

    Raises RequestError for no servo or a repeated one; else the first error of a servo.
    """
    if len({node.node for node in servos}) != len(servos) or not servos:
        raise RequestError("an id is named twice" if servos else "no servo is named", expected="each id once")

    async def read_limits(node: Node) -> tuple[float, float]:
        found = await limits(node)
        if node.at == -inf:  # the profile has no limits to read
            await ask_presence(node)
        return found

    found = await gather(*map(read_limits, servos))
    return PositionStream(dict(zip(servos, found, strict=True)))


class PositionStream:
    """Servos of a control loop; see `core.family.PositionStream`. Made by `open_stream`."""

    def __init__(self, servos: Mapping[Node, tuple[float, float]]) -> None:
        self.nodes: Final = tuple(node.node for node in servos)
        self.positions: Final = tuple(map(_read_positions, servos))
        self._servos: Final = {node.node: (node, known) for node, known in servos.items()}

    def goals(self, to: Mapping[int, float]) -> Sequence[Request[None]]:
        """A request with a target (rad) for each of these servos.

        Raises LimitExceeded outside the profile, RequestError for another servo, or one whose limits may have changed.
        """
        return [self._goal(id, value) for id, value in to.items()]

    async def begin(self, speeds: Mapping[int, float]) -> None:
        """Start each servo where the profile has that rule, and hold it. `speeds` (rad/s) are only checked."""
        for id, speed in speeds.items():
            check_above_zero("speed", speed, "rad/s", node=self._servo(id)[0].node)

        async def begin_one(node: Node) -> None:
            if node.settings.must_start:
                await start(node)
            await stop(node)

        await gather(*[begin_one(node) for node, _ in self._servos.values()])

    def _servo(self, id: int) -> tuple[Node, tuple[float, float]]:
        if id not in self._servos:
            expected = f"one of {', '.join(map(str, self.nodes))}"
            raise RequestError(f"node {shown(id)} is not in this loop", expected=expected)
        return self._servos[id]

    def _goal(self, id: int, to: float) -> Request[None]:
        node, known = self._servo(id)
        row = node.table["goal_position"]

        def precondition(_: Stops | None = None) -> MotorbusError | None:
            if node.limits is known or node.limits == known:
                return None
            return RequestError(
                f"limits, mid point or sense of rotation of node {node.node} were written since this loop began",
                advice="end the loop and begin another",
                node=node.node,
            )

        if error := precondition():
            raise error
        raw = target(node, to)
        goal = Setpoint(node.node, "position", float(row.to_value(raw)), *known)
        return write_register(node, row, raw, (goal,), precondition=precondition)


def _read_positions(node: Node) -> Request[Positions]:
    one = position(node)
    decode = one.decode
    assert decode is not None
    return one.with_decoder(lambda answer: Positions({node.node: decode(answer)}, (), answer.at))
