"""`motorbus read`: registers by name, or the telemetry, in API units and raw."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import App, Parameter

from motorbus.cli import faces, quantity, registers
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.cli.target import able, check_names, device, face, opened, table_of

if TYPE_CHECKING:
    from motorbus.core.family import State

app = App(
    name="read",
    usage="Usage: motorbus read BUS#ID [NAME...] [OPTIONS]",
    help_epilogue="""Values are in rad, rad/s, A, V, °C, s and fractions; `raw` is what stands on
the wire. `motorbus info BUS#ID --registers` lists the names.

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
    bus, family, (node,) = device(device_)
    check_names(family, names)
    with opened(bus, options, output) as opening:
        one = face(opening, node)
        if names:
            _registers(one, names, output)
        else:
            _telemetry(one, output)
    return Exit.OK


def _registers(one: Any, names: tuple[str, ...], output: Output) -> None:
    table = table_of(one)
    entries = [table[name] for name in names]
    rows = registers.facts(one, entries, one.read(*names))
    output.document("motorbus.read/1", {"id": one.node, "registers": rows})
    registers.show(f"#{one.node}", rows, output)


Told = dict[str, object]
"""What a device without telemetry tells of itself, each by its name."""
UNITS: Final = {
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


def sampled(one: Any) -> State | Told:
    """The telemetry of a device, or what else its family offers to watch. Raises RequestError for neither."""
    sample = faces.offer(one.bus.family.name, "sample")
    state: State | Told = sample(one) if sample is not None else able(one, "telemetry")()
    return state


def _telemetry(one: Any, output: Output) -> None:
    state, node = sampled(one), one.node
    if isinstance(state, dict):
        output.document("motorbus.telemetry/1", {"id": node, **state})
        words = {True: "yes", False: "no"}
        rows = [
            (name.replace("_", " "), words[value] if isinstance(value, bool) else value)
            for name, value in state.items()
        ]
        output.table(f"#{node}", ["", "value"], rows)
        return
    output.document("motorbus.telemetry/1", {"id": node, **state_facts(state)})
    told = {name: getattr(state, name) for name in UNITS if getattr(state, name) is not None}
    rows = [(name, quantity.shown(value, UNITS[name])) for name, value in told.items()]
    if state.moving is not None:
        rows.append(("moving", "yes" if state.moving else "no"))
    rows.append(("alarm", ", ".join(state.alarm) or "none"))
    output.table(f"#{node}", ["", "value"], rows)
