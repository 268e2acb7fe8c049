"""What an alarm means for this very servo: the bit, and the figures that raised it.

A 7.4 V servo on a 12 V supply sets its voltage alarm in every packet, which looks like trouble with the line, and the
name of the bit alone sends people to the cable. So the feedback is held against the limits that the servo itself has.
Source: FEETECH SDK; STS3215 memory table V3.6 (registers 13 to 15, 62, 63); lerobot#1010 for what people take it for.
"""

from __future__ import annotations

from typing import NamedTuple

from motorbus.core.family import State
from motorbus.core.register import RegisterMap
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.driver.feedback import state_exchange
from motorbus.families.feetech.driver.identity import known
from motorbus.families.feetech.driver.node import Node

_FIRST, _COUNT = 13, 3
"""Registers 13 to 15 bound temperature and voltage in every map."""
_PLAIN = {
    "sensor": "the position sensor fails: register 65 stays set until it works again",
    "current": "it drew more current than its protection allows, for too long",
    "angle": "its position is outside its limits",
    "overload": "it was overloaded for too long, and pushes with its protective torque only: recover_overload()",
}


class Bounds(NamedTuple):
    """What a servo bears: °C, and V from `low` to `high`."""

    temperature: float
    high: float
    low: float


async def alarms(node: Node) -> tuple[str, ...]:
    """Each alarm that is set, in words with the figures behind it; () when there is none. Changes nothing."""
    table = await known(node)
    state = await state_exchange(node, table)
    if not state.alarm:
        return ()
    bounds = await bounds_of(node, table)
    return in_words(state, bounds)


async def bounds_of(node: Node, table: RegisterMap) -> Bounds:
    """What this servo bears, as it is set now."""

    def take(data: bytes) -> Bounds:
        rows = (table["max_temperature"], table["max_voltage"], table["min_voltage"])
        return Bounds(*(float(row.to_value(row.decode(data[row.address - _FIRST :][:1]))) for row in rows))

    return await read_block(node, _FIRST, _COUNT, take)


def in_words(state: State, bounds: Bounds) -> tuple[str, ...]:
    """The alarms of a sample, each with what is known about it."""
    return tuple(f"{name}: {_words(name, state, bounds)}" for name in state.alarm)


def _words(name: str, state: State, bounds: Bounds) -> str:
    if name == "voltage":
        return _voltage(state.voltage, bounds)
    if name == "temperature" and state.temperature is not None:
        beyond = "above" if state.temperature > bounds.temperature else "within"
        return f"{state.temperature:.0f} °C inside, {beyond} its limit of {bounds.temperature:.0f} °C"
    return _PLAIN.get(name, "no source says what this bit means")


def _voltage(supply: float | None, bounds: Bounds) -> str:
    if not supply:
        return "it measures 0.0 V: known of servos that were given the phase register of another one"
    if supply > bounds.high:
        return f"supply {supply:.1f} V above limit {bounds.high:.1f} V: is the servo meant for this supply?"
    if supply < bounds.low:
        return f"supply {supply:.1f} V below limit {bounds.low:.1f} V: a weak supply, or a long or thin cable"
    return f"supply {supply:.1f} V within {bounds.low:.1f} to {bounds.high:.1f} V now: it may dip under load"
