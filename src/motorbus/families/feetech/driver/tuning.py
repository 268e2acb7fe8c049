"""How strong, how stiff and how careful a servo is: torque limit, gains of its loops, protection; as verbs.

Which registers a servo has for this is a question of its map, and asking for what it lacks is refused by name. What
lies in EEPROM goes through the guarded sequence, after which the servo is limp, unless it holds that already
(see `write`); what lies in RAM acts at once and is gone after power-off. Registers 34 and 35 are gains of the current
loop on HLS and protection on STS: here they are found by what they are, never by where they are.
Source: FD 1.9.8.5; STS3215 memory table V3.6; HLS memory table; SCS memory table 1902.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.core.register import Register, RegisterMap, Storage, Value, shown
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.exchanges import Block, verified
from motorbus.families.feetech.driver.identity import writable
from motorbus.families.feetech.driver.motion import calmed
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.registers import read, read_raw, write_limp
from motorbus.families.feetech.driver.rest import asked_anew
from motorbus.families.feetech.table import CONTROL


class TorqueLimit(NamedTuple):
    """A torque limit that was set: a fraction of the stall torque, and the registers that hold it.

    `kept`: it survives power-off.
    """

    value: float
    registers: tuple[str, ...]
    kept: bool


class Gains(NamedTuple):
    """Gains of the loops as plain numbers, 0 to 254; None for what this servo lacks.

    `p`, `i`, `d` are of the position loop; `velocity_…` of the velocity loop, for velocity mode; `current_…` of the
    current loop (HLS). `live_…` are those of the position loop that act just now, loaded from `p`, `i`, `d` at
    power-up (HLS): they are tried out without EEPROM and without letting go.
    """

    p: int | None
    i: int | None
    d: int | None
    velocity_p: int | None
    velocity_i: int | None
    current_p: int | None
    current_i: int | None
    live_p: int | None
    live_i: int | None
    live_d: int | None


class Protection(NamedTuple):
    """What a servo protects itself from; None for what it lacks.

    `torque`        what is left of the torque after an overload, a fraction
    `threshold`     duty that counts as overload, a fraction, when it lasts for `time` (s)
    `current`       current that is too much (A), when it lasts for `current_time` (s)
    `max_temperature`, `max_voltage`, `min_voltage`   limits in °C and V
    `unload`        alarms that let the torque drop, by name
    `led`           alarms that let the light blink, by name
    """

    torque: float | None
    threshold: float | None
    time: float | None
    current: float | None
    current_time: float | None
    max_temperature: float | None
    max_voltage: float | None
    min_voltage: float | None
    unload: tuple[str, ...] | None
    led: tuple[str, ...] | None


GAINS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "p": "position_p",
        "i": "position_i",
        "d": "position_d",
        **{
            name: name
            for name in ("velocity_p", "velocity_i", "current_p", "current_i", "live_p", "live_i", "live_d")
        },
    }
)
"""Gain -> register."""
PROTECTION: Final[Mapping[str, str]] = MappingProxyType(
    {
        "torque": "protective_torque",
        "threshold": "overload_torque",
        "time": "overload_time",
        "current": "protection_current",
        "current_time": "overcurrent_time",
        "max_temperature": "max_temperature",
        "max_voltage": "max_voltage",
        "min_voltage": "min_voltage",
        "unload": "unload_mask",
        "led": "led_mask",
    }
)
"""Part of the protection -> register."""
_MASKS: Final = ("unload", "led")


# -- torque limit --------------------------------------------------------------------------------------------


async def torque_limit(node: Node) -> float:
    """What bounds its torque now, as a fraction of the stall torque (really of the duty)."""
    table = await writable(node)
    row = limiting(table)
    return float((await read(node, row.name))[row.name])


async def set_torque_limit(node: Node, limit: float, *, persistent: bool = False) -> TorqueLimit:
    """Bound its torque, 0 to 1 of the stall torque: at once and until power-off, with `persistent` for good.

    Servos without such a register in RAM (SCS, old SMS) have max_torque in EEPROM alone: there it is always for good,
    and the servo goes limp. A limit of 0 lets it hang, and a greater one after that would let it go for its old goal:
    so the goal becomes where it hangs first (velocity, duty or current 0 in those modes). Raises RequestError outside 0
    to 1, LimitExceeded for a servo that hangs outside its limits, VerificationFailed when it reads back different.
    """
    if isinstance(limit, bool) or not isinstance(limit, int | float) or not 0 <= limit <= 1:
        raise RequestError(
            f"{shown(limit)} is no torque limit",
            expected="a fraction of the stall torque, 0 to 1",
            advice="nothing was sent",
            node=node.node,
        )
    table = await writable(node)
    row = limiting(table)
    kept = persistent or row.storage is Storage.EEPROM
    names = tuple(dict.fromkeys((row.name, "max_torque"))) if kept else (row.name,)
    if limit and not kept and not (await read_raw(node, row.name))[row.name]:
        await calmed(node, await asked_anew(node))
    await _put(node, table, dict.fromkeys(names, limit))
    return TorqueLimit(limit, names, kept)


def limiting(table: RegisterMap) -> Register:
    """The row that bounds the torque at this moment."""
    return table[CONTROL[table.name].limit or "max_torque"]


# -- gains ---------------------------------------------------------------------------------------------------


async def gains(node: Node) -> Gains:
    """The gains of its loops."""
    table = await writable(node)
    rows = _rows(table, GAINS)
    found = await read_raw(node, *(row.name for row in rows.values()))
    return Gains(**{part: found[rows[part].name] if part in rows else None for part in GAINS})


async def set_gains(
    node: Node,
    *,
    p: int | None = None,
    i: int | None = None,
    d: int | None = None,
    velocity_p: int | None = None,
    velocity_i: int | None = None,
    current_p: int | None = None,
    current_i: int | None = None,
    live_p: int | None = None,
    live_i: int | None = None,
    live_d: int | None = None,
) -> None:
    """Set gains by the names that `Gains` has, as set_gains(p=32, d=32); None leaves one as it is.

    What lies in EEPROM is written for good by the guarded sequence, after which the servo is limp, unless it has these
    gains already (see `write`); the `live_…` ones act at once until power-off. Raises RequestError, with nothing sent,
    for a gain that this servo lacks (and names those it has) or out of range.
    """
    position, live = {"p": p, "i": i, "d": d}, {"live_p": live_p, "live_i": live_i, "live_d": live_d}
    velocity = {"velocity_p": velocity_p, "velocity_i": velocity_i}
    currents = {"current_p": current_p, "current_i": current_i}
    given = _given(node, {**position, **velocity, **currents, **live}, "gain")
    table = await writable(node)
    rows = _rows(table, GAINS, given, node)
    await _put(node, table, {rows[part].name: _number(part, value) for part, value in given.items()})


# -- protection ----------------------------------------------------------------------------------------------


async def protection(node: Node) -> Protection:
    """What it protects itself from, and when."""
    table = await writable(node)
    rows = _rows(table, PROTECTION)
    found = await read(node, *(row.name for row in rows.values()))
    values: dict[str, object] = dict.fromkeys(PROTECTION)
    for part, row in rows.items():
        value = found[row.name]
        values[part] = _names(row, int(value)) if part in _MASKS else float(value)
    return Protection(**values)  # type: ignore[arg-type]


async def set_protection(
    node: Node,
    *,
    torque: float | None = None,
    threshold: float | None = None,
    time: float | None = None,
    current: float | None = None,
    current_time: float | None = None,
    max_temperature: float | None = None,
    max_voltage: float | None = None,
    min_voltage: float | None = None,
    unload: Iterable[str] | None = None,
    led: Iterable[str] | None = None,
) -> None:
    """Set parts of the protection by the names that `Protection` has; None leaves one as it is.

    set_protection(torque=0.2, threshold=0.8, time=2.0, unload=("temperature", "overload")). All of it lies in EEPROM:
    the servo goes limp and stays so, unless it has all of that already (see `write`). Raises RequestError, with nothing
    sent, for a part that this servo lacks (and names those it has), out of range, for an alarm that it does not know,
    or for voltages that leave none between.
    """
    overload = {"torque": torque, "threshold": threshold, "time": time}
    too_much = {"current": current, "current_time": current_time, "max_temperature": max_temperature}
    rest = {"max_voltage": max_voltage, "min_voltage": min_voltage, "unload": unload, "led": led}
    given = _given(node, {**overload, **too_much, **rest}, "part of the protection")
    table = await writable(node)
    rows = _rows(table, PROTECTION, given, node)
    orders: dict[str, Value] = {}
    for part, value in given.items():
        orders[rows[part].name] = _mask(node, rows[part], value) if part in _MASKS else _number(part, value)
    await _sane(node, orders)
    await _put(node, table, orders)


def _names(row: Register, mask: int) -> tuple[str, ...]:
    return tuple(name for bit, name in row.bits.items() if mask >> bit & 1)


def _mask(node: Node, row: Register, names: object) -> int:
    wanted = [names] if isinstance(names, str) else list(names) if isinstance(names, Iterable) else [names]
    known = {name: bit for bit, name in row.bits.items() if not name.startswith("undefined")}
    unknown = [str(name) for name in wanted if name not in known]
    if unknown:
        raise RequestError(
            f"node {node.node}: {', '.join(unknown)}: no alarm of this servo",
            expected=f"any of {', '.join(known)}, or none",
            advice="nothing was sent",
            node=node.node,
        )
    return sum(1 << known[name] for name in set(wanted))


def _number(part: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RequestError(f"{part}: {shown(value)} is not a number", advice="nothing was sent")
    return value


async def _sane(node: Node, orders: Mapping[str, Value]) -> None:
    """A highest voltage that is not above the lowest would be an alarm for ever."""
    names = ("max_voltage", "min_voltage")
    if not any(name in orders for name in names):
        return
    held = await read(node, *names)
    high, low = (orders.get(name, held[name]) for name in names)
    if high <= low:
        raise RequestError(
            f"node {node.node}: a supply of at most {high:.1f} V and at least {low:.1f} V does not exist",
            expected="max_voltage above min_voltage",
            advice="nothing was written",
            node=node.node,
        )


# -- both ----------------------------------------------------------------------------------------------------


def _given(node: Node, values: Mapping[str, object], what: str) -> dict[str, object]:
    """What is to be set. Raises RequestError when there is nothing."""
    given = {part: value for part, value in values.items() if value is not None}
    if given:
        return given
    raise RequestError(
        f"node {node.node}: no {what} was named",
        expected=", ".join(values),
        advice="nothing was sent",
        node=node.node,
    )


def _rows(
    table: RegisterMap, names: Mapping[str, str], wanted: Iterable[str] = (), node: Node | None = None
) -> dict[str, Register]:
    """The rows of all parts that this map has. Raises RequestError when one that is wanted is not among them."""
    rows = {part: table[name] for part, name in names.items() if name in table}
    for part in wanted:
        if part not in rows:
            assert node is not None
            raise _lacks(node, table, part, rows)
    return rows


def _lacks(node: Node, table: RegisterMap, part: str, has: Iterable[str]) -> RequestError:
    return RequestError(
        f"node {node.node} has no register for {part!r}: its map {table.name} lacks it",
        expected=f"one of {', '.join(has)}",
        advice="nothing was sent",
        node=node.node,
    )


async def _put(node: Node, table: RegisterMap, values: Mapping[str, Value]) -> None:
    """Write by name; EEPROM is read back by the guarded sequence, RAM here."""
    await write_limp(node, values)
    for name, value in values.items():
        row = table[name]
        if row.storage is Storage.RAM:
            await verified(node, Block(row.address, row.encode(node.raw(row, value))))
