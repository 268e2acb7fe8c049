"""Position, velocity, load, current, voltage, temperature, telemetry and health.

The feedback block, registers 56 to 70, has the same layout in every map. A request for one quantity of an identified
servo is kept and may be run again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from motorbus.core.family import Health, State
from motorbus.core.register import RegisterMap
from motorbus.core.request import Request
from motorbus.core.steps import Runnable
from motorbus.errors import DeviceError
from motorbus.families.feetech.driver.identity import known, unknown_map
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import PRESENT, TORQUE_ENABLE, read_block

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

    tells_current = node.settings is not None and node.settings.tells_current
    return State(
        at=node.at,
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


def position(node: Node) -> Runnable[float]:
    """Present position (rad), without the homing offset in every mode. Raises DeviceError for an unknown map."""
    return _quantity(node, "present_position")


def velocity(node: Node) -> Runnable[float]:
    """Present velocity (rad/s). Raises DeviceError for an unknown map."""
    return _quantity(node, "present_velocity")


def load(node: Node) -> Runnable[float]:
    """Duty of the bridge, -1 to 1; it is not the torque."""
    return _quantity(node, "present_load")


def current(node: Node) -> Runnable[float]:
    """Current (A): of the supply, on HLS of the motor phase. Raises DeviceError where it is unknown."""
    return _quantity(node, "present_current")


def voltage(node: Node) -> Runnable[float]:
    """Supply voltage (V)."""
    return _quantity(node, "present_voltage")


def temperature(node: Node) -> Runnable[float]:
    """Temperature (°C)."""
    return _quantity(node, "present_temperature")


def _quantity(node: Node, name: str) -> Runnable[float]:
    kept = node.kept.get(name)
    if kept is not None and kept[0] is node.settings:
        return kept[1]
    if node.table is None or node.settings is None:
        return _identify_then(node, lambda same: _quantity(same, name))
    if name not in node.table or not node.table[name].unit:
        raise _unknown(node, name.replace("_", " "))
    row = node.table[name]

    def take(data: bytes) -> float:
        return float(node.value(row, row.decode(data)))

    request: Request[float] = read_block(node, row.address, row.size, take, kept=True)
    node.kept[name] = node.settings, request
    return request


async def _identify_then(node: Node, read: Callable[[Node], Runnable[T]]) -> T:
    await known(node)
    return await read(node)


def _unknown(node: Node, what: str) -> DeviceError:
    if not node.is_writable:
        return unknown_map(node)
    return DeviceError(f"node {node.node}: its {what} has no known unit", advice="read_raw()", node=node.node)
