"""Why a servo does not move: its settings and its alarms, with the figures behind them. Reads only.

A 7.4 V servo on a 12 V supply sets its voltage alarm in every packet, which looks like line trouble (lerobot#1010). All
settings named here are acknowledged by a servo that never moves. The EEPROM lock is none of them (feetech-cli).
Source: FEETECH SDK hls.py; HLS memory table; STS3215 memory table V3.6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, TypeAlias

from motorbus.core.family import State
from motorbus.families.feetech.driver import feedback
from motorbus.families.feetech.driver.goals import BOUNDED, shown_mode
from motorbus.families.feetech.driver.identity import known, read_settings
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import read_block
from motorbus.families.feetech.traits import Mode

REGISTERS: Final = 71  # bytes of registers 0 to 70
MEANING: Final = {
    "sensor": "the position sensor fails",
    "current": "it drew more current than its protection allows, for too long",
    "angle": "its position is outside its limits",
    "overload": "it was overloaded for too long and pushes with its protective torque only: recover_overload()",
}

Raw: TypeAlias = Callable[[str], int]  # raw value of a row; 1 where the map has no such row


async def alarms(node: Node) -> tuple[str, ...]:
    """Each alarm that is set, with the figures behind it; () for none."""
    await known(node)
    state = await feedback.telemetry(node)
    return _explain(node, state, await _read_all(node)) if state.alarm else ()


async def why_not_moving(node: Node) -> tuple[str, ...]:
    """The settings and alarms that keep this servo from obeying a goal in its mode, each with a fix; () for none.

    Raises DeviceError for an unknown map. No register tells of an obstacle or a heavy load.
    """
    await read_settings(node)
    raw = await _read_all(node)
    state = await feedback.telemetry(node)
    return (*_reasons(node, raw), *_explain(node, state, raw))


def _reasons(node: Node, raw: Raw) -> Iterator[str]:
    """The settings that keep it from moving."""
    mode, traits, settings = node.known_mode, node.traits, node.settings
    assert settings is not None
    low, high = settings.raw_limits
    if mode is None:
        yield f"its operating mode {shown_mode(node)} is not documented: set_mode('position')"
    if mode is Mode.PWM and not traits.duty:
        yield "the duty register of its PWM mode is not published: set_mode('position')"
    if mode is Mode.POSITION and low >= high and not settings.many_turns:
        yield f"its position limits {low} to {high} (raw) leave no range: write limits that do"
    if mode is Mode.VELOCITY and raw("goal_velocity") == 0:
        yield "its goal velocity is 0: set_velocity() gives one"
    if mode is Mode.PWM and traits.duty and raw(traits.duty) == 0:
        yield "its duty is 0: set_duty() gives one"
    if traits.current and raw(traits.current) == 0:
        if mode is Mode.CURRENT:
            yield "its goal current is 0: set_current() gives one"
        if mode in BOUNDED:
            yield "goal_torque is 0, so its current is bounded to 0 A: enable_torque() sets its protection current"
            if settings.protection_current == 0:
                yield "its protection current is 0 as well: write(protection_current=…)"
    if raw("torque_enable") != 1:
        yield "its torque is off: enable_torque()"
    if traits.limit and raw(traits.limit) == 0:
        yield "torque_limit is 0: cap_torque(1.0)"
    if raw("max_torque") == 0:
        yield "max_torque is 0, which bounds its torque: write(max_torque=1.0)"


async def _read_all(node: Node) -> Raw:
    """Read registers 0 to 70."""
    table = await known(node)
    data = await read_block(node, 0, REGISTERS, bytes)

    def raw(name: str) -> int:
        return feedback.raw_in(table, name, data, 0) if name in table else 1

    return raw


def _explain(node: Node, state: State, raw: Raw) -> tuple[str, ...]:
    def value(name: str) -> float:
        assert node.table is not None
        return float(node.table[name].to_value(raw(name)))

    def explain(name: str) -> str:
        if name == "temperature" and state.temperature is not None:
            return f"{state.temperature:.0f} °C, its limit is {value('max_temperature'):.0f} °C"
        if name == "voltage":
            return _explain_voltage(state.voltage, value("min_voltage"), value("max_voltage"))
        return MEANING.get(name, "no source explains this bit")

    return tuple(f"{name}: {explain(name)}" for name in state.alarm)


def _explain_voltage(supply: float | None, low: float, high: float) -> str:
    if not supply:
        return "it measures 0.0 V: known of servos with the phase register of another one"
    if supply > high:
        return f"supply {supply:.1f} V above limit {high:.1f} V: is the servo meant for this supply?"
    if supply < low:
        return f"supply {supply:.1f} V below limit {low:.1f} V: a weak supply, or a long or thin cable"
    return f"supply {supply:.1f} V within {low:.1f} to {high:.1f} V now: it may dip under load"
