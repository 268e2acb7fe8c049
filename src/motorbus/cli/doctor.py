"""`motorbus doctor`: find out why it does not work; writes nothing."""

from __future__ import annotations

import sys
from datetime import datetime
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from msgspec import structs

from motorbus import __version__
from motorbus.cli.common import Common, Writing
from motorbus.cli.output import confirm, emit, escape, note
from motorbus.cli.target import bus_address, is_address, load_machine
from motorbus.doctor import bundle as bundles
from motorbus.doctor import examine, page
from motorbus.doctor.explain import explain as explain_text
from motorbus.doctor.findings import Report, sort
from motorbus.doctor.move import move_axes
from motorbus.errors import MotorbusError, RequestError
from motorbus.link.serial import ports
from motorbus.motion.robot import Robot


class FoundErrors(MotorbusError):
    """The doctor has found errors."""


def doctor(
    target: Annotated[str, Parameter(name="BUS|MACHINE")] = "",
    /,
    *,
    loop: Annotated[float, Parameter(help="Measure whether a loop reaches RATE Hz.")] = 0.0,
    move: Annotated[bool, Parameter(help="Move each axis by 3 deg and back; asks first.")] = False,
    explain: Annotated[str, Parameter(help="Explain a traceback or log; - is stdin.")] = "",
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
    trace: examine.Trace = {}
    if explain:
        report = Report(explain, tuple(explain_text(_read(explain))))
    elif loop < 0 or loop > 10_000:
        raise RequestError(f"--loop {loop:g}", expected="above 0 to 10000 Hz")
    else:
        report = _examine(target, loop, common, trace)
        if move and not report.count("error"):
            report = _move(report, target, yes, common)
    if html is not None:
        made = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M")
        html.write_text(page.html(report, made=made, version=__version__), encoding="utf-8")
    if bundle is not None:
        bundles.write(bundle, report, trace)
    _show(report, common, is_explained=bool(explain))
    if report.count("error") and not explain:
        raise FoundErrors(page.summary(report), advice=f"first: {report.findings[0].action}")


def _examine(target: str, rate: float, common: Common, trace: examine.Trace) -> Report:
    if target.endswith(".toml"):
        return examine.examine_machine(target, trace, rate)
    if target or common.bus:
        return examine.examine_bus(bus_address(target, common), trace, rate)
    if Path(common.machine).exists():
        return examine.examine_machine(common.machine, trace, rate)
    found = [f"{one.device} ({one.guess})" if one.guess else one.device for one in ports()]
    advice = f"ports: {', '.join(found)}" if found else "no serial port is there: plug the adapter in"
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
        found = move_axes(robot)
    return structs.replace(report, findings=tuple(sort([*report.findings, *found])))


def _read(name: str) -> str:
    if name == "-":
        return sys.stdin.read()
    return Path(name).read_text("utf-8", errors="replace")


def _show(report: Report, common: Common, *, is_explained: bool) -> None:
    if common.json:
        emit(report, common)
        return
    shown = page.lines(report)
    if is_explained:
        shown = shown[:-1] or ["no known message; `motorbus doctor BUS` looks at the bus itself"]
    print("\n".join(escape(line, 600) for line in shown))
    if report.devices:
        print()
        emit(Report(report.target, (), report.devices), common)
    if report.simulated and report.devices:
        note("simulated")
