"""`motorbus read`: registers by name, or the telemetry, in API units and raw."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from motorbus.cli import quantity
from motorbus.cli.exits import Exit
from motorbus.cli.info import facts
from motorbus.cli.output import Output
from motorbus.cli.target import able, device, face, opened
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.core.entry import Table
    from motorbus.core.family import State

app = App(
    name="read",
    help_epilogue="""Values are in rad, rad/s, A, V, °C, s and fractions; `raw` is what stands on the wire.
`motorbus info BUS#ID --registers` lists the names.

Examples:

    motorbus read feetech:/dev/ttyACM0#3
    motorbus read feetech:/dev/ttyACM0#3 present_position present_voltage
    motorbus read feetech:sim#1 present_position --json""",
)


@app.default
def read(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *names: str,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Read registers, or the telemetry, of a device.

    Parameters
    ----------
    device_
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3
    names
        Registers by name; the telemetry when none is named.
    options
        Any option of the bus string, as a flag.
    """
    bus, node = device(device_)
    with opened(bus, options, output) as opening:
        one = face(opening, node)
        if names:
            _registers(one, names, output)
        else:
            _telemetry(able(one, "telemetry")(), node, output)
    return Exit.OK


def _registers(one: Any, names: tuple[str, ...], output: Output) -> None:
    table = table_of(one)
    entries = [table[name] for name in names]
    values = one.read(*names)
    rows = [facts(entry, values[entry.name]) for entry in entries]
    output.document("motorbus.read/1", {"id": one.node, "registers": rows})
    shown = [
        (entry.name, quantity.shown(values[entry.name], entry.unit), row["raw"], row["meaning"])
        for entry, row in zip(entries, rows, strict=True)
    ]
    output.table(f"#{one.node}", ["register", "value", ">raw", "meaning"], shown)


def table_of(one: Any) -> Table:
    """The register map of a device, by its own firmware. Raises RequestError when nobody knows it."""
    identity = one.identify()
    tables = one.bus.family.tables
    if identity.table not in tables:
        raise RequestError(
            f"#{one.node}: firmware {identity.firmware} is unknown, so its registers have no names",
            advice=f"`motorbus {one.bus.family.name}` has commands that take addresses",
        )
    found: Table = tables[identity.table]
    return found


UNITS = {
    "position": "rad",
    "velocity": "rad/s",
    "load": "fraction",
    "current": "A",
    "voltage": "V",
    "temperature": "°C",
}


def state_facts(state: State) -> dict[str, object]:
    """One sample as plain data; what the device does not tell is null."""
    return {**asdict(state), "alarm": list(state.alarm), "quality": state.quality.value}


def _telemetry(state: State, node: int, output: Output) -> None:
    output.document("motorbus.telemetry/1", {"id": node, **state_facts(state)})
    rows = [(name, quantity.shown(getattr(state, name), unit)) for name, unit in UNITS.items()]
    moving = "" if state.moving is None else ("yes" if state.moving else "no")
    rows += [("moving", moving), ("alarm", ", ".join(state.alarm) or "none")]
    output.table(f"#{node}", ["", "value"], rows)
