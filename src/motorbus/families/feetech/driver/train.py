"""Several servos of one bus, led in a loop: all is known beforehand, and a cycle asks only what it wants to know.

Small goals come so often here that they are all the movement there is. So a servo is to follow each as quickly as it
can: no acceleration to heed, and the greatest velocity that its axis allows. In these registers 0 is a special number;
see `pace`. A goal is reckoned by the settings that its servo has at that moment, and does not leave once they are
others. Goal and present position have the same place in every map, so one packet serves servos of all maps.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from motorbus.core.family import Positions
from motorbus.core.register import is_number, shown
from motorbus.core.request import Effect, Request
from motorbus.core.steps import catch
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import changed_since, confirmed, unanswered
from motorbus.families.feetech.driver.group import AIR, distinct, prepare_all
from motorbus.families.feetech.driver.identity import known, writable
from motorbus.families.feetech.driver.loop import known_row, position_reads
from motorbus.families.feetech.driver.motion import enable_torque
from motorbus.families.feetech.driver.mould import mould
from motorbus.families.feetech.driver.node import CHANGES, MANY_TURNS, Node
from motorbus.families.feetech.driver.orders import Order, blocks, no_limits, position_goal
from motorbus.families.feetech.driver.pace import speed_at_least
from motorbus.families.feetech.driver.rest import asked_anew
from motorbus.families.feetech.table import Mode


async def train(servos: Sequence[Node], *, rate: int, air: float = AIR) -> Train:
    """These servos, ready to be asked and told in a loop; those not known yet are read, and nothing is written.

    `rate` is that of the bus in bit/s: replies of one exchange take at most `air` s. Raises the first error of a servo
    that cannot be read, with a note for each other; DeviceError when a register map is unknown, RequestError in other
    than position mode, and when both limits are 0 and nobody has published what that means.
    """
    nodes = distinct(servos)
    errors = await prepare_all(nodes, rate=rate, air=air)
    raise_first(errors.values())
    for node in nodes:
        _refuse_unless_led_by_position(node)
    return Train(nodes, position_reads(nodes, rate=rate, air=air))


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position it can be told, rad; read from the servo unless known.

    Raises DeviceError when its map is unknown, RequestError when both are 0 and nobody has published what that means.
    """
    await writable(node)
    if node.limits is None:
        raise no_limits(node)
    return node.limits


async def travel(node: Node) -> tuple[float, float] | None:
    """Lowest and highest position, rad, that its encoder and its registers can express, whatever its limits are.

    None in other than position mode, and when its map is not known.
    """
    met = node.settings is not None
    table = await known(node)
    settings = node.settings
    if not met:
        node.forget_settings()  # they are read anew when the servo is used
    if not node.writable or settings is None or settings.mode is not Mode.POSITION:
        return None
    count = table["goal_position"].scale * settings.factors["goal_position"]
    if settings.many_turns:
        return -MANY_TURNS * count, MANY_TURNS * count
    return 0.0, settings.turn * count


def raise_first(errors: Iterable[MotorbusError]) -> None:
    """Raise the first of these, with a note for each other; nothing where there is none."""
    found = list(errors)
    for other in found[1:]:
        found[0].add_note(f"and: {other}")
    if found:
        raise found[0]


class Train:
    """Servos in a loop; a `core.family.PositionStream`. Made by `train`."""

    def __init__(self, servos: Sequence[Node], positions: Sequence[Request[Positions]]) -> None:
        self.nodes: Final = tuple(node.node for node in servos)
        self.positions: Final = tuple(positions)
        self._servos: Final = {node.node: node for node in servos}
        self._packets: tuple[_Packet, ...] = ()
        self._ids: tuple[int, ...] = ()

    def goals(self, to: Mapping[int, float]) -> Sequence[Request[None]]:
        """Goal positions (rad) for some or all of them, in one packet as long as there are at most 83.

        Raises LimitExceeded for what is no finite number or fits no register, RequestError for a servo that is none of
        these, has been put into another mode, or whose settings were written since and not read again.
        """
        if self._ids != tuple(to) or not all(packet.holds() for packet in self._packets):
            self._packets = tuple(_packets([self._servo(id) for id in to]))
            self._ids = tuple(to)
        return [packet.exchange(to) for packet in self._packets]

    async def start(self, speeds: Mapping[int, float]) -> None:
        """Torque on without a jump, one after the other, and nothing set that would hold back who follows goals.

        A servo is bound by its speed (rad/s, above 0), rounded up to what its register can say; one without is as
        quick as it can be. That stays so until power-off or the next order with a velocity. Every servo is visited;
        the first error is raised then, with a note for each other. Errors as `enable_torque`, and RequestError for a
        speed that is none, before anything is sent.
        """
        for id, speed in speeds.items():
            _check_speed(self._servo(id), speed)
        errors = []
        for id, node in self._servos.items():
            failure = await catch(_start(node, speeds.get(id)))
            if failure is not None:
                errors.append(failure)
        raise_first(errors)

    def _servo(self, id: int) -> Node:
        try:
            return self._servos[id]
        except KeyError:
            raise RequestError(
                f"node {shown(id)} is none of those that are led here",
                expected=f"one of {', '.join(map(str, self.nodes))}",
                advice="nothing was sent",
            ) from None


# -- start ---------------------------------------------------------------------------------------------------


async def _start(node: Node, speed: float | None) -> None:
    """In any other than position mode the greatest velocity would be an order to turn: so that is looked at anew."""
    table = await asked_anew(node)
    _refuse_unless_led_by_position(node)
    await enable_torque(node)
    _refuse_unless_led_by_position(node)
    orders = [Order(table["goal_velocity"], speed_at_least(node, table, speed))]
    orders += [
        Order(table[name], 0) for name in (node.control.acceleration, node.control.time) if name
    ]  # 0: as quickly as it can, and not by time but by velocity
    for block in blocks(node, orders):
        await confirmed(node, block)


def _refuse_unless_led_by_position(node: Node) -> None:
    position_goal(node, known_row(node, "goal_position"), 0.0)


def _check_speed(node: Node, speed: float) -> None:
    if not (is_number(speed) and speed > 0):
        raise RequestError(
            f"node {node.node}: {shown(speed)} is no speed",
            expected="a finite number above 0, in rad/s",
            advice="leave it out for the maximum; nothing was sent",
            node=node.node,
        )


# -- goals ---------------------------------------------------------------------------------------------------


class _Packet:
    """One SYNC WRITE of goal positions to servos in whose maps the goal has the same place."""

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._nodes = nodes
        self._rows = [known_row(node, "goal_position") for node in nodes]
        for node, row in zip(nodes, self._rows, strict=True):
            position_goal(node, row, 0.0)  # raises where it heeds no goal position
        self._under = [(node, node.settings) for node in nodes]
        self._seen: object = None  # `CHANGES.now` when they were found to be those
        self._mould = mould(nodes, [[row] for row in self._rows])

    def holds(self) -> bool:
        """Whether the settings of all are those that it was made by."""
        now = CHANGES.now
        if now is self._seen:
            return True
        for node, settings in self._under:
            if node.settings is not settings:
                return False
        self._seen = now
        return True

    def exchange(self, to: Mapping[int, float]) -> Request[None]:
        """The packet with these goals (rad)."""
        goals = [to[node.node] for node in self._nodes]
        cast = None if self._mould is None else self._mould.cast(goals)
        return cast or self._judged(goals)

    def _judged(self, goals: Sequence[float]) -> Request[None]:
        """The same, as `position_goal` says: a whole number, what is none, or a goal outside the limits."""
        items, orders = [], []
        for node, row, goal in zip(self._nodes, self._rows, goals, strict=True):
            raw, order = position_goal(node, row, goal)
            items.append((node.node, row.encode(raw)))
            orders.append(order)
        request = wire.sync_write(self._rows[0].address, items)
        return unanswered(request, Effect.MOTION, tuple(orders), refusal=changed_since(self._under))


def _packets(nodes: Sequence[Node]) -> Iterator[_Packet]:
    """As few packets as can carry a goal for each of these."""
    places: dict[tuple[int, int], list[Node]] = {}
    for node in nodes:
        row = known_row(node, "goal_position")
        places.setdefault((row.address, row.size), []).append(node)
    for (_, size), group in places.items():
        capacity = wire.sync_write_capacity(size)
        for start in range(0, len(group), capacity):
            yield _Packet(group[start : start + capacity])
