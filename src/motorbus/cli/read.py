"""`motorbus read`: registers by name, or the telemetry, in API units and raw."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import App, Parameter

from motorbus.cli import faces, quantity, registers
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.machine import axes_called, machine
from motorbus.cli.output import Output
from motorbus.cli.target import able, check_names, device, face, opened, table_of

if TYPE_CHECKING:
    from motorbus.core.family import State
    from motorbus.motion.machine import AxisSpec

app = App(
    name="read",
    usage="Usage: motorbus read BUS#ID [NAME...] [OPTIONS]",
    help_epilogue="""Values are in rad, rad/s, A, V, °C, s and fractions; `raw` is what stands on
the wire. All of it is the device's, also where that is called by the name of
an axis: its angles are not those of the axis, whose own position stands beside
the telemetry. `motorbus info BUS#ID --registers` lists the names.

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
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3, or an axis
    names
        Registers by name; the telemetry when none is named.
    options
        Any option of the bus string, as a flag.
    """
    bus, family, (node,) = device(device_)
    axis = axes_called((device_,)).get((bus, node), "")
    check_names(family, names)
    with opened(bus, options, output) as opening:
        one = face(opening, node)
        if names:
            _registers(one, names, axis, output)
        else:
            _telemetry(one, axis, output)
    return Exit.OK


def _registers(one: Any, names: tuple[str, ...], axis: str, output: Output) -> None:
    table = table_of(one)
    entries = [table[name] for name in names]
    values, refused = registers.read_each(one, names)
    if len(refused) == len(names):
        raise refused[names[0]]
    rows = registers.facts(one, [entry for entry in entries if entry.name in values], values)
    named = {"axis": axis} if axis else {}
    document = {"id": one.node, **named, "registers": rows, **registers.refusals(refused)}
    output.document("motorbus.read/1", document)
    registers.show(titled(one.node, axis), rows, output)
    if refused:
        raise Partial("; ".join(error.summary for error in refused.values()))


def titled(node: int, axis: str) -> str:
    """A device in a title; one that was called by its axis, as the device of that."""
    return f"#{node}, the device of {axis}" if axis else f"#{node}"


def own_position(spec: AxisSpec, state: object) -> float | None:
    """Where the axis is (rad, m) whose device told this; None where that tells no position."""
    at = getattr(state, "position", None)
    return None if at is None else spec.from_device(at)


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
    facts = {**state._asdict(), "alarm": list(state.alarm), "quality": state.quality.value}
    refused = facts.pop("refused")
    return {**facts, "refused": list(refused)} if refused else facts


def sampled(one: Any) -> State | Told:
    """The telemetry of a device, or what else its family offers to watch. Raises RequestError for neither."""
    sample = faces.offer(one.bus.family.name, "sample")
    state: State | Told = sample(one) if sample is not None else able(one, "telemetry")()
    return state


def _telemetry(one: Any, axis: str, output: Output) -> None:
    state, node = sampled(one), one.node
    spec = machine().axes[axis] if axis else None
    at = own_position(spec, state) if spec is not None else None
    named = {"axis": axis, "axis_position": at} if axis else {}
    if isinstance(state, dict):
        output.document("motorbus.telemetry/1", {"id": node, **named, **state})
        words = {True: "yes", False: "no"}
        rows = [
            (name.replace("_", " "), words[value] if isinstance(value, bool) else value)
            for name, value in state.items()
        ]
        output.table(titled(node, axis), ["", "value"], rows)
        return
    output.document("motorbus.telemetry/1", {"id": node, **named, **state_facts(state)})
    told = {name: getattr(state, name) for name in UNITS if getattr(state, name) is not None}
    rows = [(f"{axis} at", spec.show(at))] if spec is not None and at is not None else []
    rows += [(name, quantity.shown(value, UNITS[name])) for name, value in told.items()]
    if state.moving is not None:
        rows.append(("moving", "yes" if state.moving else "no"))
    rows.append(("alarm", ", ".join(state.alarm) or "none"))
    rows += [("refused", error) for error in state.refused]
    output.table(titled(node, axis), ["", "value"], rows)
