"""The registers of the device of an axis: each row with its value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from msgspec import Struct

from motorbus.core.register import Register, RegisterMap
from motorbus.errors import MotorbusError
from motorbus.motion.commands import ReadRegisters
from motorbus.motion.program import run
from motorbus.motion.robot import Robot

SAME: Final = ("name", "address", "unit", "choices", "bits", "readable", "source")


class RegisterRow(Struct, frozen=True):
    """A register. `low`, `high`, `default` and `value` are in `unit`; `effect` is that of a write."""

    name: str
    address: int
    unit: str
    step: float
    low: float
    high: float
    default: float | None
    choices: Mapping[int, str]
    bits: Mapping[int, str]
    storage: str
    readable: bool
    writable: bool
    effect: str
    source: str
    note: str
    value: float | None


class RegisterTable(Struct, frozen=True):
    """The register map of an axis; `error` says why values are missing."""

    axis: str
    title: str
    rows: tuple[RegisterRow, ...]
    error: str = ""


def read_table(robot: Robot, name: str) -> RegisterTable:
    """Read all registers of the device of an axis. Only reads are sent. Raises RequestError for an unknown axis."""
    axis = robot.axis(name)
    identity = robot.carry_out(run(axis.bus, axis.bus.driver.identify(axis.config.node)))
    table: RegisterMap | None = getattr(axis.device, "table", None)
    if table is None and (table := axis.bus.family.registers.get(identity.table)) is None:
        return RegisterTable(name, "", (), f"{axis.config.device} has no registers")
    values: dict[str, Any] = {}
    error = ""
    try:
        names = tuple(row.name for row in table.values() if row.readable)
        values = robot.execute(ReadRegisters(name, names))
    except MotorbusError as failure:
        error = failure.summary
    rows = tuple(_row(row, values.get(row.name)) for row in table.values())
    return RegisterTable(name, table.title, rows, error)


def _row(row: Register, value: Any) -> RegisterRow:
    same = {name: getattr(row, name) for name in SAME}
    return RegisterRow(
        **same,
        step=row.scale if row.unit else 1,
        low=row.to_value(row.low),
        high=row.to_value(row.high),
        default=None if row.default is None else row.to_value(row.default),
        storage=row.storage.value,
        writable=row.writable and not row.protected,
        effect=row.effect.name.lower(),
        note=" ".join(filter(None, (row.note, row.conflict))),
        value=None if value is None else float(value),
    )
