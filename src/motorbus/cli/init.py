"""`motorbus init`: the first machine file, from what answers on the buses. Nothing is written to any device."""

from __future__ import annotations

import re
from functools import partial
from math import ceil, floor, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.machine import FILE, MachineFile, is_address, machine_file, shown
from motorbus.cli.parameters import Flag, Silent
from motorbus.cli.ports import seen
from motorbus.cli.scan import listen
from motorbus.cli.target import face, nobody, opened, said, target
from motorbus.core import units
from motorbus.core.family import AxisDriver
from motorbus.errors import DeviceError, RequestError
from motorbus.motion.machine import AxisSpec, BusSpec, Machine
from motorbus.motion.machine.model import NAME

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output
    from motorbus.cli.target import Target
    from motorbus.core.family import Found, Identity

VELOCITY: Final = radians(45)
"""rad/s for a machine that nobody has seen move: slow enough to reach for the switch."""
ACCELERATION: Final = radians(180)
"""rad/s² for the same."""
LONGEST: Final = 25
"""Characters of the name of a bus; its axes have an id behind it, and 40 is the most for any name."""
STEP: Final = 0.1
"""degrees to which zero and limits are rounded, the limits inwards."""

app = App(
    name="init",
    usage="Usage: motorbus init [NAME=]BUS... [OPTIONS]",
    help_epilogue="""Scans the buses, asks each device what it is and how far it may go, and writes
a machine file: an axis for each device, with its zero in the middle of its
limits and slow velocities to begin with. Nothing is written to any device.
Look at the file before the first move: what a device allows, the machine
around it may not.

A bus is called by its family, or NAME where NAME=BUS says so; its axes are
NAME_1, NAME_2 and so on by their ids. BUS#1-6 asks those ids only, which is
quicker. A file that is there is replaced with --force only, and nothing of it
is kept. Simulated buses of `sim` are new in each command: nothing stays where
it went.

Examples:

    motorbus init feetech:/dev/ttyACM0
    motorbus init arm=feetech:COM7#1-6 gimbal=kst:can://socketcan/can0
    motorbus init arm=feetech:/dev/ttyACM0 --output bench.toml --name bench""",
)


class Wanted(NamedTuple):
    """A bus of the file to be: its name, and where it is, with its options and the ids that were named."""

    name: str
    target: Target


class Met(NamedTuple):
    """A device that answered and can be an axis; `limits` in rad, None where it has none."""

    node: int
    identity: Identity
    limits: tuple[float, float] | None
    able: frozenset[str]


@app.default
def init(
    *buses: Annotated[str, Parameter(name="BUS")],
    to: Annotated[str, Parameter(name="--output")] = "",
    name: str = "",
    force: Flag = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Write a machine file from what answers on the buses.

    Parameters
    ----------
    buses
        FAMILY:PORT, or NAME=FAMILY:PORT to call it something; BUS#1-6 for some ids only.
    to
        Where to write it; what --machine says, or ./motorbus.toml, when left out.
    name
        What people call the machine.
    force
        Replace a file that is there. Nothing of it is kept.
    options
        Any option of the bus string, as a flag; it is written into the file.
    """
    if not buses:
        raise _which_bus(output)
    path = Path(to or machine_file().told or FILE)
    wanted = _wanted(buses, options)
    _free(path, force)
    met = {one: _met(one, output) for one in wanted}
    machine = _machine(name, met)
    text = _commented(machine, met, output)
    _write(path, text, output, force=force)
    _show(path, machine, met, output)
    return Exit.OK


def _which_bus(output: Output) -> RequestError:
    """The error for no bus at all, once the ports that are there have been shown."""
    found = seen(output)
    port = found[0].stable or found[0].device if found else "/dev/ttyACM0"
    return RequestError(
        "which bus?",
        expected=f"FAMILY:PORT, as feetech:{port}",
        advice=f"`motorbus init feetech:{port}` asks who is there and writes {FILE}; nothing was sent",
    )


# -- what is wanted --------------------------------------------------------------------------------------------


def _wanted(texts: Iterable[str], options: Mapping[str, str]) -> list[Wanted]:
    """The buses to ask. Raises RequestError for what is no address, a name that cannot be, and a bus named twice."""
    from motorbus.session import prepare

    found: list[Wanted] = []
    for text in texts:
        name, address = _split(text)
        spot = target(address)
        spot = spot._replace(bus=_with(spot.bus, options))
        prepare(spot.bus, {})
        if any(spot.bus == other.target.bus for other in found):
            raise RequestError(f"{spot.bus} is named twice", advice="nothing was sent")
        taken = {other.name for other in found}
        _apart(name, taken)
        found.append(Wanted(name or _free_name(spot.family.name, taken), spot))
    return found


def _split(text: str) -> tuple[str, str]:
    """NAME=BUS or BUS -> the name, "" for none, and the address. Raises RequestError for what cannot be a name."""
    head = text.partition(":")[0]
    name, equals, _ = head.partition("=")
    address = text[len(name) + 1 :] if equals else text
    if equals and not (re.fullmatch(NAME, name) and len(name) <= LONGEST):
        raise RequestError(
            f"{text}: a bus cannot be called {name!r}",
            expected=f"a lower case letter, then lower case letters, digits, _ and -, {LONGEST} at most",
            advice="nothing was sent",
        )
    if not is_address(address):
        raise RequestError(
            f"{text!r} is not a bus address",
            expected="FAMILY:PORT, or NAME=FAMILY:PORT",
            advice="for example arm=feetech:/dev/ttyACM0; nothing was sent",
        )
    return name if equals else "", address


def _apart(name: str, taken: set[str]) -> None:
    """Raise RequestError for a name that another bus has, or that an axis on it would have."""
    if name in taken:
        raise RequestError(f"two buses cannot both be called {name}", advice="nothing was sent")
    for one, other in [(name, other) for other in taken] + [(other, name) for other in taken]:
        if other and re.fullmatch(rf"{re.escape(other)}_[0-9]+", one):
            raise RequestError(
                f"a bus called {one} has the name of an axis on {other}",
                expected="another name",
                advice="nothing was sent",
            )


def _with(bus: str, options: Mapping[str, str]) -> str:
    from motorbus.session import parse_address

    spot = parse_address(bus)
    return spot._replace(options={**spot.options, **said(options)}).bus


def _free_name(family: str, taken: set[str]) -> str:
    name = re.sub(r"[^a-z0-9_-]+", "_", family.lower())
    return next(one for one in (name, *(f"{name}_bus{n}" for n in range(2, 1000))) if one not in taken)


def _free(path: Path, force: bool) -> None:
    """Raise RequestError, before any port is opened, where the file could not be written."""
    if path.is_dir() or not path.absolute().parent.is_dir():
        why = "it is a folder" if path.is_dir() else f"there is no folder {path.parent}"
        raise RequestError(f"{path} cannot be written: {why}", advice="nothing was sent")
    if path.exists() and not force:
        raise RequestError(
            f"{path} is there already",
            expected="another file by --output, or --force",
            advice="--force replaces it and keeps nothing of it; nothing was sent",
        )


# -- who is there ----------------------------------------------------------------------------------------------


def _met(wanted: Wanted, output: Output) -> list[Met]:
    """Who answers on a bus and can be an axis. Raises NoReply when nobody does, DeviceError when nobody can."""
    bus, _, nodes = wanted.target
    answers: list[Found] = []
    with opened(bus, {}, output) as opening:
        with output.progress(f"scanning {wanted.name}") as bar:
            found = opening.run(
                opening.driver.scan(nodes, (opening.rate,)), report=partial(listen, found=answers, bar=bar)
            )
        if not found:
            raise nobody(bus)
        met = [one for one in (_asked(opening, device, output) for device in found) if one is not None]
    if not met:
        raise DeviceError(
            f"{bus}: {len(found)} answered, and of none is known how it moves", advice="no file was written"
        )
    return met


def _asked(bus: Bus, found: Found, output: Output) -> Met | None:
    """What an axis needs to know of a device; None, with a note, for one that cannot be an axis."""
    identity = found.identity
    able = bus.driver.axis(identity) if identity is not None and identity.table else AxisDriver()
    if identity is None or not able.names:
        what = f"{identity.model} with firmware {identity.firmware}" if identity is not None else "a device"
        output.note(f"note: #{found.node} is {what} of which nobody has said how it moves: it is left out")
        return None
    limits = bus.run(able.limits(face(bus, found.node))) if "limits" in able else None
    return Met(found.node, identity, limits, able.names)


# -- the file --------------------------------------------------------------------------------------------------


def _machine(name: str, met: Mapping[Wanted, list[Met]]) -> Machine:
    axes: dict[str, AxisSpec] = {}
    for bus, devices in met.items():
        by_number = "{:#x}" if bus.target.family.link.kind == "frames" else "{}"
        for one in devices:
            axes[f"{bus.name}_{one.node}"] = _axis(f"{bus.name}#{by_number.format(one.node)}", one.limits)
    buses = {bus.name: BusSpec(address=bus.target.bus) for bus in met}
    return Machine(name=name, buses=buses, axes=axes)


def _axis(device: str, limits: tuple[float, float] | None) -> AxisSpec:
    """An axis that turns with its device, at 0 in the middle of where that may go; limits are rounded inwards."""
    how: dict[str, Any] = {"max_velocity": VELOCITY, "max_acceleration": ACCELERATION, "unit": "deg"}
    if limits is None:
        return AxisSpec(device=device, **how)
    low, high = (end / units.DEGREE for end in limits)
    zero = round((low + high) / 2 / STEP) * STEP
    ends = ceil(round((low - zero) / STEP, 6)), floor(round((high - zero) / STEP, 6))
    if ends[0] >= ends[1]:
        return AxisSpec(device=device, zero=_degrees(zero), **how)
    return AxisSpec(
        device=device, zero=_degrees(zero), low=_degrees(ends[0] * STEP), high=_degrees(ends[1] * STEP), **how
    )


def _degrees(value: float) -> float:
    """As a file with so many degrees would be read."""
    return units.parse(f"{value:.1f} deg", "position")


def _commented(machine: Machine, met: Mapping[Wanted, list[Met]], output: Output) -> str:
    """The text of the file, with what each device is above its axis. It is read as the same machine."""
    text = machine.text()
    for bus, devices in met.items():
        for one in devices:
            head = f"\n[axis.{bus.name}_{one.node}]\n"
            about = "".join(f"\n# {line}" for line in _about(one))
            text = text.replace(head, f"{about}{head}", 1)
    if output.simulated:
        text = f"# Simulated devices were asked.\n{text}"
    assert Machine.parse(text) == machine
    return text


def _about(one: Met) -> list[str]:
    """What a device is, and what of it the axis cannot say; one line each, whatever the device calls itself."""
    known = one.identity
    lines = [f"{known.model}, firmware {known.firmware}" if known.firmware else known.model]
    if one.limits is None:
        lines.append("It has no limits of its own: add low and high.")
    if "position" not in one.able:
        lines.append("It does not know where it is: home it first, or say where it stands.")
        lines.append('Where it moves a slide: travel = "5 mm", its way for one turn, and unit = "mm".')
    return [re.sub(r"[^\x20-\x7e\xa0-\ud7ff]+", " ", line) for line in lines]


def _write(path: Path, text: str, output: Output, *, force: bool) -> None:
    replaced = path.exists()
    with usable(path, "written"), path.open("w" if force else "x", encoding="utf-8", newline="\n") as file:
        file.write(text)
    if replaced:
        output.note(f"note: {path} was there and is replaced; nothing of it is kept")


# -- what to say -----------------------------------------------------------------------------------------------


def _show(path: Path, machine: Machine, met: Mapping[Wanted, list[Met]], output: Output) -> None:
    able = {f"{bus.name}_{one.node}": one for bus, devices in met.items() for one in devices}
    steps = _steps(path, machine, able)
    facts = [
        {"name": name, "device": spec.device, "model": able[name].identity.model}
        | {"zero": spec.zero, "low": spec.low, "high": spec.high}
        for name, spec in machine.axes.items()
    ]
    buses = {name: spec.address for name, spec in machine.buses.items()}
    output.document("motorbus.init/1", {"file": str(path), "buses": buses, "axes": facts, "next": steps})
    rows = [
        (name, spec.device, able[name].identity.model, *_ends(spec)) for name, spec in machine.axes.items()
    ]
    output.table(f"Axes in {shown(path)}", ["axis", "device", "model", ">low", ">high"], rows)
    lines = [f"    {line}" for line in steps]
    output.text("\n".join([f"Look at {shown(path)}, above all at low and high. Then", "", *lines]))


def _ends(spec: AxisSpec) -> tuple[str, str]:
    return ("", "") if spec.low is None or spec.high is None else (spec.show(spec.low), spec.show(spec.high))


def _steps(path: Path, machine: Machine, able: Mapping[str, Met]) -> list[str]:
    """The next commands: look, power, a small move of the first axis, and keep where it stands."""
    found = MachineFile().path
    more = "" if found is not None and found.resolve() == path.resolve() else f" --machine {path}"
    first = next((name for name in machine.axes if "position" in able[name].able), next(iter(machine.axes)))
    switch = [f"motorbus torque on {first}{more}"] if "enable_torque" in able[first].able else []
    steps = [f"motorbus info {first}{more}", *switch, f"motorbus move {first}+=5deg{more}"]
    known = "position" in able[first].able
    return [*steps, f"motorbus pose --save first {first}{more}"] if known else steps
