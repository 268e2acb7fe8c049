"""`motorbus doctor`: find out why it does not work; writes nothing to a device."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter
from msgspec import Struct, structs

from motorbus.cli.common import Common, Writing
from motorbus.cli.output import confirm, emit, escape, note
from motorbus.cli.target import bus_address, is_address, load_machine
from motorbus.doctor import bundle as bundles
from motorbus.doctor import examine, page
from motorbus.doctor.explain import explain as explain_text
from motorbus.doctor.findings import DeviceHealth, Report, sort
from motorbus.doctor.trial import move_axes
from motorbus.errors import LinkLost, MotorbusError, NoReply, PortBusy, PortNotFound, RequestError
from motorbus.link.serial import ports
from motorbus.motion.robot import Robot

ERRORS: Final[Mapping[str, type[MotorbusError]]] = {
    "port-missing": PortNotFound,
    "port-lost": LinkLost,
    "port-busy": PortBusy,
    "brltty": PortBusy,
    "bus-silent": NoReply,
    "can-silent": NoReply,
    "device-missing": NoReply,
    "machine-file": RequestError,
}
"""The error at the end by the code of the first finding, for the exit code of the other commands."""


class Devices(Struct, frozen=True):
    """The table of the devices that answer."""

    devices: dict[str, DeviceHealth]


def doctor(
    target: Annotated[str, Parameter(name="BUS|MACHINE")] = "",
    /,
    *,
    loop: Annotated[float, Parameter(help="Measure whether a loop reaches RATE Hz.")] = 0.0,
    move: Annotated[bool, Parameter(help="Move each axis by 3 deg and back; asks first.")] = False,
    explain: Annotated[
        str, Parameter(help="Explain a traceback or log; - is stdin.", allow_leading_hyphen=True)
    ] = "",
    html: Annotated[Path | None, Parameter(help="Write a page.")] = None,
    bundle: Annotated[Path | None, Parameter(help="Write a zip for an issue.")] = None,
    yes: Annotated[bool, Parameter(name=["--yes", "-y"], help="Do not ask before --move.")] = False,
    common: Common = Common(),
) -> None:
    """Find out why it does not work; writes nothing to a device.

    Examples:

        motorbus doctor feetech:/dev/ttyACM0
        motorbus doctor motorbus.toml --loop 100
        motorbus doctor --explain traceback.txt
        motorbus doctor --html report.html --bundle issue.zip
    """
    if not 0 <= loop <= 10_000:
        raise RequestError(f"--loop {loop:g}", expected="above 0 to 10000 Hz")
    trace: examine.Trace = {}
    if explain:
        text = sys.stdin.read() if explain == "-" else Path(explain).read_text("utf-8", errors="replace")
        report = Report(explain, tuple(explain_text(text)))
    else:
        report = _examine(target, loop, common, trace)
        if move and not report.count("error"):
            report = _move(report, target, yes, common)
    if html is not None:
        html.write_text(page.html(report, made=f"{datetime.now():%Y-%m-%d %H:%M}"), encoding="utf-8")
    if bundle is not None:
        bundles.write(bundle, report, trace)
    if common.json:
        emit(report, common)
    else:
        print("\n".join(escape(line, 600) for line in page.lines(report)))
        if report.devices:
            print()
            emit(Devices({page.short(name, report): one for name, one in report.devices.items()}), common)
        if report.simulated and report.devices:
            note("simulated")
    if report.count("error") and not explain:
        first = report.findings[0]
        kind, summary = ERRORS.get(first.code, MotorbusError), f"{first.where}: {first.evidence}"
        raise kind(summary, cause=first.cause, advice=first.action)


def _examine(target: str, rate: float, common: Common, trace: examine.Trace) -> Report:
    if target.endswith(".toml"):
        return examine.examine_machine(target, trace, rate)
    word = target or common.bus
    if is_address(word):
        return examine.examine_bus(bus_address(word, common), trace, rate)
    if word or Path(common.machine).exists():
        return examine.examine_machine(common.machine, trace, rate, word)
    names = ", ".join(one.device for one in ports())
    advice = f"ports: {names}" if names else "no serial port is there: plug the adapter in"
    raise RequestError("no bus", expected="FAMILY:PORT, or a machine file", advice=advice)


def _move(report: Report, target: str, yes: bool, common: Common) -> Report:
    confirm("move each axis by 3 deg and back", Writing(yes=yes))
    if is_address(target or common.bus):
        ids = "+".join(name.rpartition("#")[2] for name in report.devices)
        robot = Robot.at(f"{bus_address(target, common).partition('#')[0]}#{ids}")
    else:
        machine = load_machine(Common(machine=target) if target.endswith(".toml") else common)
        assert machine is not None
        robot = Robot(machine)
    with robot:
        return structs.replace(report, findings=tuple(sort([*report.findings, *move_axes(robot)])))
