"""Prepared group operations: exchanges that a control loop makes once, or in microseconds, and runs each cycle.

They need servos that are prepared (limits, mode and units known), and ask nobody anything themselves. Maps and byte
orders may be mixed: present and goal position have the same place and size in all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set, Sized
from functools import partial
from typing import Final, Literal

from motorbus.core.family import Positions
from motorbus.core.register import Register, shown
from motorbus.core.request import ExactDecoder, Request, Response
from motorbus.core.steps import catch
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.feetech.driver.exchanges import DOUBTS, Block, places, read_block, settings_of_now
from motorbus.families.feetech.driver.gauge import Packets, measure
from motorbus.families.feetech.driver.group import AIR, RATE, distinct, sync_exchange, sync_writes, trains
from motorbus.families.feetech.driver.identity import unknown_map
from motorbus.families.feetech.driver.node import CHANGES, Node, Settings
from motorbus.families.feetech.driver.orders import position_goal

_made: Final = tuple.__new__


def sync_read_positions(servos: Sequence[Node], *, rate: int = RATE, air: float = AIR) -> Request[Positions]:
    """The present positions of all of these in one exchange, which may be kept and run again.

    Raises RequestError when a servo is not prepared, or knows no SYNC READ (an exchange that can be kept is one packet:
    `read_positions` takes as many as it needs), or when the replies would need more than `air` s at `rate` bit/s (give
    a greater `air`, or divide the servos); DeviceError when the register map of one is unknown. A single servo that is
    silent raises NoReply when run.
    """
    nodes = distinct(servos)
    rows = {node.node: known_row(node, "present_position") for node in nodes}
    for node in nodes:
        refuse_without_sync_read(node)
    row = next(iter(rows.values()))
    if len(list(trains(nodes, row.size, rate, air))) > 1:
        raise RequestError(
            f"the replies of {len(nodes)} servos need more than {air * 1000:.3g} ms of air at {rate} bit/s, and a "
            "stop would have to wait as long",
            advice="divide the servos, or give a greater `air`; nothing was sent",
        )
    gauges = _Gauges({node.node: _Gauge(node, rows[node.node]) for node in nodes})
    return sync_exchange(nodes, row.address, row.size, gauges.read, gauges.places, gauges.whole)


def position_reads(servos: Sequence[Node], *, rate: int = RATE, air: float = AIR) -> list[Request[Positions]]:
    """The exchanges that bring the present positions of all of these, which may be kept and run again.

    SYNC READs that keep each train of replies within `air` s for those who answer them, a READ for each other.
    """
    nodes = distinct(servos)
    size = max(known_row(node, "present_position").size for node in nodes)
    able = [node for node in nodes if node.control.sync_read]
    found = [sync_read_positions(part, rate=rate, air=air) for part in trains(able, size, rate, air)]
    return found + [_alone(node) for node in nodes if not node.control.sync_read]


async def read_positions(servos: Sequence[Node], *, rate: int = RATE, air: float = AIR) -> Positions:
    """The present positions of all of these, of whatever map; made anew for each cycle.

    Who does not answer is missing from the values, and costs the others nothing. Raises RequestError when a servo is
    not prepared, DeviceError when the register map of one is unknown.
    """
    values: dict[int, float] = {}
    at = float("-inf")
    for request in position_reads(servos, rate=rate, air=air):
        found = await catch(request)
        if isinstance(found, DOUBTS):
            continue
        if isinstance(found, MotorbusError):
            raise found
        values.update(found.values)
        at = max(at, found.at)
    ids = [servo.node for servo in servos]
    return Positions(
        {id: values[id] for id in ids if id in values}, tuple(id for id in ids if id not in values), at
    )


def _alone(node: Node) -> Request[Positions]:
    row = known_row(node, "present_position")
    gauge = _Gauge(node, row)

    def take(data: bytes) -> Positions:
        return Positions({node.node: gauge.value(data)}, (), node.at)

    return read_block(node, row.address, row.size, take)


def refuse_without_sync_read(node: Node) -> None:
    """Raise RequestError for a servo that knows no SYNC READ."""
    if node.control.sync_read:
        return
    raise RequestError(
        f"node {node.node} knows no SYNC READ, so one packet cannot bring its position",
        expected="servos of another map than scs and scs2",
        advice="use read_positions(), which asks such servos one by one; nothing was sent",
        node=node.node,
    )


class _Gauge:
    """Reports the position of one servo, by the settings that it has when it is asked; as `Node.value`, and quicker.

    What has been made of those `settings` is kept as long as they are the same. A code below `_plain` is its own raw
    value.
    """

    __slots__ = ("_factor", "_order", "_plain", "_scale", "end", "node", "row", "settings")

    def __init__(self, node: Node, row: Register) -> None:
        self.node = node
        self.row = row
        self.end = 5 + row.size
        self._order: Final[Literal["little", "big"]] = "little" if row.order == "little" else "big"
        self._plain: Final = 1 << (8 * row.size - 1 if row.sign_bit is None else row.sign_bit)
        self._scale: Final = row.scale
        self.settings: Settings | None = None
        self._factor = 0.0

    def settle(self, settings: Settings) -> None:
        """Make of them what is needed."""
        self._factor = settings.factors["present_position"]
        self.settings = settings

    def value(self, data: bytes) -> float:
        """In rad. Raises RequestError when its settings have been written and not read since."""
        settings = self.node.settings
        if settings is None:
            raise _unsettled(self.node)
        if settings is not self.settings:
            self.settle(settings)
        raw = int.from_bytes(data, self._order)
        if raw >= self._plain:
            raw = self.row.decode(data)
        if settings.shift:
            raw = settings.compensated(raw)
        return raw * self._scale * self._factor


def _unsettled(node: Node) -> RequestError:
    return RequestError(
        f"node {node.node} has told where it is, and nobody knows by now in which unit, or from which zero",
        expected="the settings that it had when this reading was made, or others that have been read",
        cause="an EEPROM register of it was written since, here or by another task",
        advice="prepare() it, then read again",
        node=node.node,
    )


class _Gauges:
    """Those of several servos that one exchange asks. What was read last is kept, for the gate asks the same again."""

    __slots__ = ("_gauges", "_last", "_places", "_seen")

    def __init__(self, gauges: Mapping[int, _Gauge]) -> None:
        self._gauges = gauges
        self._seen: object = None  # `CHANGES.now` when all had the settings by which they were read last
        self._last: tuple[Response | float, dict[int, float]] | None = (
            None  # which one or when, and what it said
        )
        self._places = partial(places, {id: gauge.node for id, gauge in gauges.items()})

    def read(self, answer: Response) -> Positions:
        """Where they are. Raises RequestError as `_Gauge.value`."""
        found: dict[int, float] = {}
        gauges, at = self._gauges, answer.at
        for _, _, frame in answer.replies:
            id = frame[2]
            gauge = gauges[id]
            gauge.node.heard(frame[4], at)
            found[id] = gauge.value(frame[5 : gauge.end])
        self._last = answer, found.copy()  # what is given away may be changed by who gets it
        return Positions(found, answer.missing, at)

    def places(self, answer: Response) -> Mapping[int, float]:
        """The same as `Request.reports_position` says it: by the settings that they have now, where those are known."""
        last = self._last
        if last is not None and (last[0] is answer or last[0] is answer.at) and self._settled():
            return last[1]
        return self._places(answer)

    def whole(self, count: int) -> ExactDecoder[Positions] | None:
        """`read` for status packets with so many bytes of data, by the settings that the servos have now."""
        found = [measure(gauge.node, gauge.row) for gauge in self._gauges.values()]
        how = [one for one in found if one is not None]
        if len(how) < len(found) or len({one.order for one in how}) > 1:
            return None
        nodes, made_by = [one.node for one in how], [one.settings for one in how]
        for gauge, settings in zip(self._gauges.values(), made_by, strict=True):
            gauge.settle(settings)
        self._seen = None
        packets = Packets([node.node for node in nodes], count, how[0].order)
        are_sound, unpack, plain = packets.are_sound, packets.unpack, min(one.plain for one in how)
        scales = [(one.node.node, one.scale, one.factor) for one in how]
        blank = dict.fromkeys((one.node.node for one in how), 0.0)
        seen: object = None  # `CHANGES.now` when they were found to have those settings

        def whole(data: bytes, at: float) -> Positions | None:
            nonlocal seen
            if not are_sound(data):
                return None
            if (now := CHANGES.now) is not seen:
                if list(map(settings_of_now, nodes)) != made_by:
                    return None
                seen = now
            values = blank.copy()  # of the right size, which one that grows has not
            for (id, scale, factor), raw in zip(scales, unpack(data)):  # noqa: B905 - they are as many
                if raw >= plain:
                    return None
                values[id] = raw * scale * factor
            for node in nodes:
                node.at = at
                node.alarm = ()
            self._last = at, values.copy()
            return _made(Positions, (values, (), at))

        return whole

    def _settled(self) -> bool:
        """Whether all have the settings by which they were read last."""
        now = CHANGES.now
        if now is self._seen:
            return True
        for gauge in self._gauges.values():
            settings = gauge.node.settings
            if settings is not gauge.settings:
                if settings != gauge.settings:
                    return False
                gauge.settings = settings  # the same, read once more: that is seen at once from now on
        self._seen = now
        return True


def sync_write_positions(servos: Sequence[Node], positions: Sequence[float]) -> Request[None]:
    """Goal positions in rad for all of these, in one packet that nobody acknowledges.

    Raises RequestError when a servo is not prepared, is not in position mode, or there are too many for a packet;
    DeviceError when the map of one is not known; LimitExceeded when a position is not a finite number. The
    gate judges the limits.
    """
    nodes = distinct(servos)
    check_ordered(positions)
    if len(positions) != len(nodes):
        raise RequestError(f"{len(positions)} positions for {len(nodes)} servos", advice="nothing was sent")
    blocks = [_goal(node, to) for node, to in zip(nodes, positions, strict=True)]
    return one_packet(list(sync_writes(nodes, blocks)), len(nodes))


def one_packet(requests: Sequence[Request[None]], servos: int) -> Request[None]:
    """The only one of these. Raises RequestError where it took several."""
    if len(requests) > 1:
        raise RequestError(
            f"one packet cannot carry the goals of {servos} servos",
            advice="divide them; nothing was sent",
        )
    return requests[0]


def check_ordered(values: object) -> None:
    """Raise RequestError for what has no order, as a mapping by id, and for what is no collection."""
    if isinstance(values, list | tuple):
        return
    unordered = isinstance(values, Mapping | Set | str | bytes)
    if unordered or not (isinstance(values, Iterable) and isinstance(values, Sized)):
        raise RequestError(
            f"{shown(values)} is no row of values, one for each servo",
            expected="a list, in the order of the servos",
            advice="name each servo with its values in sync_write(); nothing was sent",
        )


def _goal(node: Node, to: float) -> Block:
    row = known_row(node, "goal_position")
    raw, order = position_goal(node, row, to)
    return Block(row.address, row.encode(raw), row.effect, (order,))


def known_row(node: Node, name: str) -> Register:
    """A row of its map. Raises RequestError when it is not prepared, DeviceError when its map is not known."""
    if node.table is None or node.settings is None:
        raise RequestError(
            f"node {node.node} is not prepared: its limits and units are not known",
            advice="call prepare() on each servo once before the loop, or run prepare_all(); nothing was sent",
            node=node.node,
        )
    if not node.table[name].unit:
        raise unknown_map(node, "cannot tell its position in a unit")
    return node.table[name]
