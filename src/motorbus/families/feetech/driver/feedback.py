"""What a servo feels: one READ of its feedback block, or one quantity of it.

The block from 56 to 70 comes whole in 21 bytes, which is hardly more than one quantity costs. Each quantity is a
verb of its own too; once the servo is known it is a single exchange that can be kept and run again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeVar

from motorbus.core.family import State
from motorbus.core.register import Register, RegisterMap
from motorbus.core.request import Request
from motorbus.core.steps import Runnable
from motorbus.errors import DeviceError, VerificationFailed
from motorbus.families.feetech.driver.exchanges import PRESENT, read_block
from motorbus.families.feetech.driver.gauge import quantity
from motorbus.families.feetech.driver.identity import known, unknown_map
from motorbus.families.feetech.driver.node import Node

T = TypeVar("T")

FEEDBACK: Final = 15
"""Bytes of the feedback block, registers 56 to 70."""
READINGS: Final = 8
"""Maximum number of readings of a confirmed position."""


def telemetry(node: Node) -> Runnable[State]:
    """One sample of everything: position, velocity, load, current, voltage, temperature, moving, alarm.

    In API units (rad, rad/s, fraction of the duty, A, V, °C); the position as `position` tells it. What the servo does
    not measure, or what cannot be told without knowing its register map, is None.
    """
    if node.table is None or node.settings is None:
        return _identify_then(node, telemetry)
    return state_exchange(node, node.table)


def state_exchange(node: Node, table: RegisterMap) -> Request[State]:
    """As `telemetry`, of a servo that is known."""

    def take(data: bytes) -> State:
        return state_of(node, table, data)

    return read_block(node, PRESENT, FEEDBACK, take)


def state_of(node: Node, table: RegisterMap, data: bytes) -> State:
    """What the bytes of the feedback block say."""

    def value(name: str) -> float | None:
        if name not in table or not table[name].unit:
            return None
        row = table[name]
        return float(node.value(row, _raw(row, data)))

    moving = table["moving"]
    tells_current = node.settings is not None and node.settings.tells_current
    return State(
        at=node.at,
        position=value("present_position"),
        velocity=value("present_velocity"),
        load=value("present_load"),
        current=value("present_current") if tells_current else None,
        voltage=value("present_voltage"),
        temperature=value("present_temperature"),
        moving=bool(_raw(moving, data) & 1),
        alarm=node.alarm,
    )


async def _identify_then(node: Node, say: Callable[[Node], Runnable[T]]) -> T:
    await known(node)
    return await say(node)


def _raw(row: Register, data: bytes) -> int:
    return row.decode(data[row.address - PRESENT : row.address - PRESENT + row.size])


def position(node: Node, *, confirmed: bool = False) -> Runnable[float]:
    """Present position, rad, with the homing offset taken out in every mode: the servo does so in position mode only.

    `confirmed` reads until two readings in a row are the same, for a shaft at rest: the sum of a reply has 8 bits only.
    Raises DeviceError when the register map is not known, VerificationFailed when no two of eight are the same.
    """
    kept = node.kept.get("present_position")
    if kept is not None and kept[0] is node.settings and not confirmed:
        return kept[1]
    if confirmed:
        return _confirmed_position(node)
    return _quantity(node, "present_position")


async def _confirmed_position(node: Node) -> float:
    """Read until two consecutive readings are equal.

    An 8-bit sum accepts about one in some hundred packets with two damaged bytes. A second reading that is also
    damaged, also accepted and equal is improbable.
    """
    last = position = None
    for _ in range(READINGS):
        last, position = position, await _quantity(node, "present_position")
        if position == last:
            return position
    raise VerificationFailed(
        f"node {node.node}: of {READINGS} readings of the position no two consecutive ones are equal, "
        f"the last two are {last} and {position} rad",
        expected="two consecutive readings that are equal",
        cause="the shaft moves or vibrates, or the line is very bad",
        advice="wait until the shaft is at rest; read a moving value without `confirmed`",
        node=node.node,
    )


def velocity(node: Node) -> Runnable[float]:
    """Present velocity, rad/s. Raises DeviceError when the register map is not known."""
    return _quantity(node, "present_velocity")


def load(node: Node) -> Runnable[float]:
    """Duty of the power stage as a fraction, -1 to 1; it is not the torque."""
    return _quantity(node, "present_load")


def current(node: Node) -> Runnable[float]:
    """Current, A: of the supply, on HLS of the motor's phase.

    Raises DeviceError when the register map is not known, or nobody has published whether it tells its current.
    """
    return _quantity(node, "present_current")


def voltage(node: Node) -> Runnable[float]:
    """Supply voltage, V."""
    return _quantity(node, "present_voltage")


def temperature(node: Node) -> Runnable[float]:
    """Temperature inside, °C."""
    return _quantity(node, "present_temperature")


def _quantity(node: Node, name: str) -> Runnable[float]:
    """One row: an exchange when the servo is known, which is kept, else an operation that asks it first."""
    kept = node.kept.get(name)
    if kept is not None and kept[0] is node.settings:
        return kept[1]
    if node.table is None or node.settings is None:
        return _identify_then(node, lambda same: _quantity(same, name))
    if name not in node.table or not (row := node.table[name]).unit:
        raise _untold(node, name.replace("_", " "))

    def take(data: bytes) -> float:
        return float(node.value(row, row.decode(data)))

    request = read_block(node, row.address, row.size, take, whole=lambda count: quantity(node, row, count))
    node.kept[name] = node.settings, request
    return request


def _untold(node: Node, what: str) -> DeviceError:
    """The error for a quantity that this servo does not tell in a unit."""
    if node.identity is not None and node.identity.table:
        return DeviceError(
            f"node {node.node} is {node.identity.model}: nobody has published whether it tells its {what}, and in "
            "what unit",
            expected=f"a servo whose register map has it; {node.identity.table} does not, or in doubt",
            advice="read_raw() gives the bare number where there is one",
            node=node.node,
        )
    return unknown_map(node, f"cannot tell its {what} in a unit")
