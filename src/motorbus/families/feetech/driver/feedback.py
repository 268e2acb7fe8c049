"""Position, velocity, load, current, voltage, temperature, telemetry and health.

The feedback block, registers 56 to 70, has the same layout in every map. A request for one quantity of an identified
servo is kept and may be run again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from motorbus.core.family import Health, State
from motorbus.core.register import Register, RegisterMap
from motorbus.core.request import ExactDecoder
from motorbus.core.steps import Runnable
from motorbus.errors import DeviceError
from motorbus.families.feetech.driver.identity import known, unknown_map
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import DATA, PRESENT, SOUND, TORQUE_ENABLE, read_block
from motorbus.families.feetech.protocol import HEADER, OVERHEAD

T = TypeVar("T")

FEEDBACK: Final = 15  # bytes of registers 56 to 70
ON: Final = 1  # of the torque switch; any other value is limp


def telemetry(node: Node) -> Runnable[State]:
    """One sample: position, velocity, load, current, voltage, temperature, moving, alarm; None for what is unknown."""
    if node.table is None or node.settings is None:
        return _identify_then(node, telemetry)
    return read_block(node, PRESENT, FEEDBACK, lambda data: state_of(node, data))


def state_of(node: Node, data: bytes, first: int = PRESENT) -> State:
    """The sample in these registers, which begin with `first`."""
    table = node.table
    assert table is not None

    def value(name: str) -> float | None:
        if name not in table or not table[name].unit:
            return None
        return float(node.value(table[name], raw_in(table, name, data, first)))

    settings = node.known.last
    tells_current = settings is not None and settings.tells_current
    return State(
        at=node.known.at,
        position=value("present_position"),
        velocity=value("present_velocity"),
        load=value("present_load"),
        current=value("present_current") if tells_current else None,
        voltage=value("present_voltage"),
        temperature=value("present_temperature"),
        moving=bool(raw_in(table, "moving", data, first) & 1),
        alarm=node.alarm,
    )


def raw_in(table: RegisterMap, name: str, data: bytes, first: int) -> int:
    """The raw value of a row in these registers, which begin with `first`."""
    row = table[name]
    return row.decode(data[row.address - first : row.address - first + row.size])


def health(node: Node) -> Runnable[Health]:
    """Torque and one sample, in one READ of registers 40 to 70.

    `blank`: acceleration and goal velocity have their power-up values.
    """
    if node.table is None or node.settings is None:
        return _identify_then(node, health)
    table = node.table
    names = [name for name in ("goal_velocity", node.traits.acceleration) if name]

    def take(data: bytes) -> Health:
        raws = [raw_in(table, name, data, TORQUE_ENABLE) for name in names]
        blank = raws == [table[name].default or 0 for name in names]
        return Health(state_of(node, data, TORQUE_ENABLE), torque=data[0] == ON, blank=blank)

    return read_block(node, TORQUE_ENABLE, PRESENT + FEEDBACK - TORQUE_ENABLE, take)


def _quantity(name: str, text: str) -> Callable[[Node], Runnable[float]]:
    """The function that reads this row."""
    what = name.removeprefix("present_")

    def read(node: Node) -> Runnable[float]:
        kept = node.known.kept.get(name)
        if kept is not None:
            return kept
        if node.table is None or node.settings is None:
            return _identify_then(node, read)
        if name not in node.table or not node.table[name].unit:
            error = DeviceError(f"node {node.node}: its {what} has no known unit", advice="read_raw()")
            raise error if node.is_writable else unknown_map(node)
        row = node.table[name]
        request = read_block(
            node, row.address, row.size, lambda data: float(node.value(row, row.decode(data)))
        )
        request.decode_exact = _exact(node, row)
        node.known.kept[name] = request
        return request

    read.__name__ = read.__qualname__ = what
    read.__doc__ = text
    return read


def _exact(node: Node, row: Register) -> ExactDecoder[float] | None:
    """Decode one whole reply without an alarm, whose value is not negative; None where the homing offset counts."""
    known, settings = node.known, node.settings
    if settings is not None and settings.shift and row.name == "present_position":
        return None
    size, order = OVERHEAD + row.size, row.order
    head = HEADER + bytes((node.node, row.size + 2, 0))
    scale, sign = float(node.value(row, 1)), 1 << (8 * row.size if row.sign_bit is None else row.sign_bit)

    def decode(data: bytes, at: float) -> float | None:
        if len(data) != size or not data.startswith(head) or sum(data) & 0xFF != SOUND:
            return None
        raw = int.from_bytes(data[DATA:-1], order)
        if raw >= sign or known.settings is not settings:
            return None
        known.at, known.alarm = at, ()
        return raw * scale

    return decode


position = _quantity(
    "present_position",
    "Present position (rad), without the homing offset in every mode. Raises DeviceError for an unknown map.",
)
velocity = _quantity("present_velocity", "Present velocity (rad/s). Raises DeviceError for an unknown map.")
load = _quantity("present_load", "Duty of the bridge, -1 to 1; it is not the torque.")
current = _quantity(
    "present_current",
    "Current (A): of the supply, on HLS of the motor phase. Raises DeviceError where it is unknown.",
)
voltage = _quantity("present_voltage", "Supply voltage (V).")
temperature = _quantity("present_temperature", "Temperature (°C).")


async def _identify_then(node: Node, read: Callable[[Node], Runnable[T]]) -> T:
    await known(node)
    return await read(node)
