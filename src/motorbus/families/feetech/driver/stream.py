"""Servos in a control loop: group reads of positions, and goals in one packet.

Small goals follow each other so fast that a servo is to follow each as quickly as it can: without acceleration, at the
maximum velocity or that of its axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from motorbus.core.family import Positions
from motorbus.core.register import is_number, shown
from motorbus.core.request import Request
from motorbus.core.steps import catch
from motorbus.core.stream import read_positions
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.feetech.driver import feedback
from motorbus.families.feetech.driver.access import blocks_of
from motorbus.families.feetech.driver.goals import position_goal, speed_at_least
from motorbus.families.feetech.driver.group import (
    GoalWriter,
    can_sync_read,
    collect,
    divided,
    known_row,
    positions_request,
    prepare_all,
)
from motorbus.families.feetech.driver.identity import read_settings
from motorbus.families.feetech.driver.motion import enable_torque
from motorbus.families.feetech.driver.node import Node, as_nodes
from motorbus.families.feetech.driver.requests import PRESENT, confirmed


async def open_stream(servos: Sequence[Node], *, rate: int) -> ServoStream:
    """These servos for a control loop; writes nothing. `rate` has no effect: the bus tells its own.

    A servo that answers READ and not SYNC READ is read by itself (`ReadsAlone`). Raises the first error of a servo that
    cannot be read, with a note for each other; DeviceError for an unknown map; RequestError in another mode than
    position, and without limits.
    """
    nodes = as_nodes(servos)
    errors = await prepare_all(nodes)
    raise_first(list(errors.values()))
    for node in nodes:
        known_row(node, "goal_position")
        position_goal(node, 0.0)
    if any(node.known.reads_alone is None for node in nodes if node.traits.sync_read):
        await collect(nodes, PRESENT, 2, errors)
        raise_first(list(errors.values()))
    able = [node for node in nodes if can_sync_read(node)]
    able = able if len(able) > 1 else []
    positions = [positions_request(part) for part in await divided(able, 2)]
    for node in nodes:
        if node not in able:
            request = feedback.position(node)
            assert isinstance(request, Request)
            positions.append(read_positions(node.node, request))
    return ServoStream(nodes, positions)


class ServoStream:
    """Servos in a loop; a `core.family.PositionStream`, made by `open_stream`."""

    def __init__(self, servos: Sequence[Node], positions: Sequence[Request[Positions]]) -> None:
        self.nodes: Final = tuple(node.node for node in servos)
        self.positions: Final = tuple(positions)
        self._servos: Final = {node.node: node for node in servos}
        self._writer: GoalWriter | None = None
        self._ids: tuple[int, ...] = ()

    def goals(self, to: Mapping[int, float]) -> Sequence[Request[None]]:
        """Goal positions (rad) of some or all servos, in one packet.

        Raises LimitExceeded for what no register holds, RequestError for a servo that is none of these or in another
        mode, or whose settings were written and not read since.
        """
        if self._writer is None or self._ids != tuple(to) or not self._writer.holds():
            self._ids = tuple(to)
            self._writer = GoalWriter([self._servo(id) for id in self._ids])
        return [self._writer(list(to.values()))]

    async def start(self, speeds: Mapping[int, float]) -> None:
        """Torque on without a jump, one after the other, without acceleration and at most at these speeds (rad/s).

        Speeds are rounded up to what a register can tell. All servos are visited, then the first error is raised,
        with a note for each other. Errors as `enable_torque`; RequestError for an impossible speed, with nothing sent.
        """
        for id, speed in speeds.items():
            self._servo(id)
            if not (is_number(speed) and speed > 0):
                what = f"node {id}: {shown(speed)} is no speed"
                raise RequestError(what, expected="above 0, in rad/s", node=id)
        results = [await catch(_start(node, speeds.get(id))) for id, node in self._servos.items()]
        raise_first([result for result in results if isinstance(result, MotorbusError)])

    def _servo(self, id: int) -> Node:
        if id in self._servos:
            return self._servos[id]
        known = ", ".join(map(str, self.nodes))
        raise RequestError(f"node {shown(id)} is not in this stream", expected=f"one of {known}")


async def _start(node: Node, speed: float | None) -> None:
    await read_settings(node)
    position_goal(node, 0.0)  # in another mode a velocity would be an order to turn
    await enable_torque(node)
    position_goal(node, 0.0)
    raws = [(node.row("goal_velocity"), speed_at_least(node, speed))]
    raws += [(node.row(name), 0) for name in (node.traits.acceleration, node.traits.time) if name]
    for block in blocks_of(node, raws):
        await confirmed(node, block)


def raise_first(errors: Sequence[MotorbusError]) -> None:
    """Raise the first of these, with a note for each other; nothing where there is none."""
    for other in errors[1:]:
        errors[0].add_note(f"and: {other}")
    if errors:
        raise errors[0]
