"""Everything that several servos feel, in one exchange that is kept: for a control loop that looks at more than places.

The feedback block of each comes whole, registers 56 to 70. A plain packet of a servo that is as it was when the
exchange was made is taken apart by what was found out then; of every other, `state_of` says what it means.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import index
from struct import Struct
from typing import Final, NamedTuple

from motorbus.core.family import Quality, State
from motorbus.core.register import Coding, shown
from motorbus.core.request import ExactDecoder, Request, Response
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.exchanges import PRESENT
from motorbus.families.feetech.driver.feedback import FEEDBACK, state_of
from motorbus.families.feetech.driver.gauge import Packets, measure
from motorbus.families.feetech.driver.group import AIR, RATE, block_of_each, distinct, sync_exchange, trains
from motorbus.families.feetech.driver.loop import known_row, refuse_without_sync_read
from motorbus.families.feetech.driver.node import Node, Settings

QUANTITIES: Final = (
    "present_position",
    "present_velocity",
    "present_load",
    "present_current",
    "present_voltage",
    "present_temperature",
)
"""In the order of the fields of `State`."""


class States(NamedTuple):
    """What all felt who answered, by id, the ids of those who did not, and when (s on the link's clock)."""

    values: dict[int, State]
    missing: tuple[int, ...]
    at: float


def sync_read_states(servos: Sequence[Node], *, rate: int = RATE, air: float = AIR) -> Request[States]:
    """One sample of everything of all of these, as `telemetry` tells it, in one exchange that may be kept.

    In API units: rad, rad/s, fraction of the duty, A, V, °C. Raises as `sync_read_positions`.
    """
    nodes = {node.node: node for node in _askable(servos, FEEDBACK, rate, air)}

    def read(answer: Response) -> States:
        found = {}
        for reply in answer.replies:
            frame = reply.data
            node = nodes[frame[2]]
            node.heard(frame[4], answer.at)
            assert node.table is not None
            found[node.node] = state_of(node, node.table, frame[5 : 5 + FEEDBACK])
        return States(found, answer.missing, answer.at)

    return sync_exchange(
        list(nodes.values()), PRESENT, FEEDBACK, read, whole=lambda count: _whole(list(nodes.values()), count)
    )


def sync_read_raw(
    address: int, count: int, servos: Sequence[Node], *, rate: int = RATE, air: float = AIR
) -> Request[dict[int, bytes]]:
    """The bytes of `count` registers from `address` on of all of these, by id, in one exchange that may be kept.

    Who does not answer is missing. Raises as `sync_read_positions`, and for what is no whole number of either.
    """
    first, size = _whole_number(address, "address"), _whole_number(count, "count")
    return block_of_each(_askable(servos, size, rate, air), first, size, kept=True)


def _whole_number(value: int, what: str) -> int:
    try:
        if not isinstance(value, bool):
            return index(value)
    except TypeError:
        pass
    raise RequestError(
        f"{what}: {shown(value)} is not a whole number",
        expected="as sync_read_raw(56, 15, servos)",
        advice="registers with names are read by sync_read(); nothing was sent",
    )


def _askable(servos: Sequence[Node], count: int, rate: int, air: float) -> list[Node]:
    """These, when one SYNC READ of so many bytes may ask them."""
    nodes = distinct(servos)
    for node in nodes:
        known_row(node, "present_position")
        refuse_without_sync_read(node)
    if len(list(trains(nodes, count, rate, air))) > 1:
        raise RequestError(
            f"the replies of {len(nodes)} servos need more than {air * 1000:.3g} ms of air at {rate} bit/s, and a "
            "stop would have to wait as long",
            advice="divide the servos, or give a greater `air`; nothing was sent",
        )
    return nodes


class _Reading(NamedTuple):
    """How one quantity is made of a packet: which of its raw values, how that is decoded, and its unit."""

    which: int
    plain: int
    sign: int
    scale: float
    factor: float


class _Seat(NamedTuple):
    node: Node
    part: slice
    settings: Settings
    readings: tuple[_Reading | None, ...]


def _whole(nodes: Sequence[Node], count: int) -> ExactDecoder[States] | None:
    packets = Packets([node.node for node in nodes], count)
    seats = [_seat(node, part) for node, part in zip(nodes, packets.parts, strict=True)]
    known = [seat for seat in seats if seat is not None]
    if len(known) < len(seats):
        return None
    unpack = Struct(f"<5xHHHBB2xB2xH{count - FEEDBACK + 1}x").unpack
    are_sound, fresh = packets.are_sound, Quality.FRESH

    def whole(data: bytes, at: float) -> States | None:
        if not are_sound(data):
            return None
        values = {}
        for node, part, settings, readings in known:
            if node.settings is not settings:
                return None
            raws = unpack(data[part])
            told: list[float | None] = []
            for reading in readings:
                if reading is None:
                    told.append(None)
                    continue
                which, plain, sign, scale, factor = reading
                raw = raws[which]
                if raw >= plain:
                    if not sign:
                        return None
                    size = raw & sign - 1
                    raw = -size if raw & sign else size
                told.append(raw * scale * factor)
            position, velocity, load, current, voltage, temperature = told
            values[node.node] = State(
                at, position, velocity, load, current, voltage, temperature, raws[5] & 1 == 1, (), fresh
            )
            node.at = at
            node.alarm = ()
        return States(values, (), at)

    return whole


_PLACES: Final = {56: 0, 58: 1, 60: 2, 62: 3, 63: 4, 66: 5, 69: 6}
"""Which raw value of a packet is that of the register at this address."""


def _seat(node: Node, part: slice) -> _Seat | None:
    """What is found out once of a servo; None where its packets are to be read one by one."""
    assert node.table is not None
    assert node.settings is not None
    readings: list[_Reading | None] = []
    for name in QUANTITIES:
        row = node.table.get(name)
        untold = (
            row is None or not row.unit or (name == "present_current" and not node.settings.tells_current)
        )
        if untold or row is None:
            readings.append(None)
            continue
        how = measure(node, row)
        if (
            how is None
            or how.order != "little"
            or row.address not in _PLACES
            or row.coding is Coding.TWOS_COMPLEMENT
        ):
            return None
        sign = 0 if row.sign_bit is None else 1 << row.sign_bit
        readings.append(_Reading(_PLACES[row.address], how.plain, sign, how.scale, how.factor))
    return _Seat(node, part, node.settings, tuple(readings))
