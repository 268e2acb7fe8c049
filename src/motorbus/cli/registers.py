"""`motorbus read`, `write`, `monitor`."""

from __future__ import annotations

from typing import Annotated, Any

from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.output import emit
from motorbus.cli.target import Common, Target, open_devices
from motorbus.core.family import Identity
from motorbus.core.register import Register, RegisterMap
from motorbus.errors import DeviceError


class Value(Struct, frozen=True):
    """A register: value in its unit, raw value, meaning of a code."""

    device: str
    register: str
    value: float | int | None
    unit: str = ""
    raw: int | None = None
    meaning: str = ""


def map_of(target: Target) -> RegisterMap:
    """The register map of a device, by its firmware. Raises DeviceError if it is unknown."""
    identity: Identity = target.device.identify()
    table = getattr(target.device, "table", None) or target.family.registers.get(identity.table)
    if table is None:
        raise DeviceError(
            f"{target.name}: {identity.model}, firmware {identity.firmware}: its registers are not known",
            node=target.node,
        )
    return table  # type: ignore[no-any-return]


def read(
    target: str,
    /,
    *registers: str,
    all: Annotated[bool, Parameter(help="Read every register.")] = False,
    raw: Annotated[bool, Parameter(help="Show raw values only.")] = False,
    common: Common = Common(),
) -> None:
    """Read registers of devices; without names the position, load, supply and other state.

    Examples:

        motorbus read feetech:/dev/ttyACM0#3
        motorbus read shoulder min_position_limit max_position_limit
        motorbus read feetech:/dev/ttyACM0#1-6 present_position --json
    """
    with open_devices(common, (target,)) as devices:
        emit([value for one in devices for value in read_values(one, registers, all=all)], common)


def read_values(target: Target, names: tuple[str, ...], *, all: bool = False) -> list[Value]:
    """The values of these registers of a device; () means its state."""
    table = map_of(target)
    rows = [table[name] for name in names]
    if not names:
        rows = [row for row in table.values() if row.readable and (all or row.name.startswith("present_"))]
    values = target.device.read(*[row.name for row in rows])
    return [_value(target, row, values[row.name]) for row in rows]


def _value(target: Target, row: Register, value: Any) -> Value:
    raw = round(value / row.scale) if row.unit else int(value)
    return Value(target.name, row.name, value, row.unit, raw, row.choices.get(raw, ""))
