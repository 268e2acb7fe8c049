"""Examine buses and machines: open, read, close; or what is open already. Nothing is written to a device."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, TypeAlias

from msgspec import structs

from motorbus import session
from motorbus.bus.blocking import Bus
from motorbus.bus.trace import TraceRecord
from motorbus.core.findings import Finding
from motorbus.doctor import machine, trial
from motorbus.doctor.bus import BusDoctor
from motorbus.doctor.findings import Report, arrange, complete, sort
from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound, RequestError
from motorbus.motion.machine import MachineConfig
from motorbus.session.address import parse_address

Trace: TypeAlias = "dict[str, list[TraceRecord]]"
"""What went over the wire, by bus."""
CH340: Final = ("1a86", "7523")  # the adapter that brltty takes for a Braille display


def examine_machine(path: str, trace: Trace, rate: float = 0.0, only: str = "") -> Report:
    """The buses of a machine file, or `only` one; `rate` (Hz) of a control loop to measure.

    Raises RequestError for a bus that the file does not have.
    """
    try:
        config = MachineConfig.load(path)
    except RequestError as error:
        fix = error.advice or (f"write {error.expected}" if error.expected else "")
        return Report(path, (complete(Finding("machine-file", path, error.summary, action=fix), path),))
    if only and only not in config.buses:
        raise RequestError(f"no bus {only!r}", expected=f"one of {', '.join(config.buses)}")
    parts = []
    for name, bus in config.buses.items():
        if only not in ("", name):
            continue
        parts.append(_examine(bus.address, name, trace, rate, names=_names(config, name), config=config))
    return _join(path, parts)


def examine_bus(address: str, trace: Trace, rate: float = 0.0) -> Report:
    """The bus of an address, `FAMILY:PORT`, with the expected ids behind #. Raises RequestError for a bad one."""
    spot = parse_address(address)
    return _examine(spot.bus, spot.bus, trace, rate, ids=spot.nodes)


def examine_open(config: MachineConfig, buses: Mapping[str, Bus], is_stopped: Callable[[], bool]) -> Report:
    """The open buses of a machine; they refuse all but reads meanwhile.

    Silent devices are not searched at other rates, and settings in RAM are not judged: they may be from here.
    A stop on another thread must clear `read_only` of each bus first. Raises Interrupted once `is_stopped`.
    """
    parts = []
    try:
        for bus in buses.values():
            bus.read_only = True
        for name, bus in buses.items():
            latency = bus.latency
            doctor = BusDoctor(bus, name, _names(config, name), tries_rates=False, is_stopped=is_stopped)
            try:
                part = _report(doctor, config)
                found = tuple(one for one in part.findings if one.code != "settings-left")
                parts.append(structs.replace(part, findings=found))
            finally:
                bus.latency = latency
                doctor.end()
    finally:
        for bus in buses.values():
            bus.read_only = False
    return _join(config.name or config.path, parts)


def _names(config: MachineConfig, bus: str) -> dict[int, str]:
    return {axis.node: name for name, axis in config.axes.items() if axis.bus == bus}


def _join(target: str, parts: Sequence[Report]) -> Report:
    found = sort(one for part in parts for one in part.findings)
    devices = {name: one for part in parts for name, one in part.devices.items()}
    return Report(target, tuple(found), devices, all(part.simulated for part in parts))


def _examine(
    address: str,
    where: str,
    trace: Trace,
    rate: float,
    *,
    names: Mapping[int, str] = {},
    ids: Sequence[int] = (),
    config: MachineConfig | None = None,
) -> Report:
    bus = _open(address, where)
    if isinstance(bus, Finding):
        return Report(where, (complete(bus, where),))
    with bus:
        doctor = BusDoctor(bus, where, names, ids)
        report = _report(doctor, config, rate)
        trace[where] = doctor.trace
    return report


def _report(doctor: BusDoctor, config: MachineConfig | None, rate: float = 0.0) -> Report:
    try:
        doctor.examine()
        machine.check_journal(doctor)
        if config is not None:
            machine.check_axes(doctor, config)
        else:
            machine.check_saved(doctor)
        if rate:
            trial.measure_loop(doctor, rate)
    except LinkError as error:
        doctor.found.append(_of_port(error, doctor.where))
    return Report(
        doctor.where, tuple(arrange(doctor.found, doctor.where)), doctor.health, doctor.bus.simulated
    )


# -- host -----------------------------------------------------------------------------------------------------


def _open(address: str, where: str) -> Bus | Finding:
    """The open read-only bus of this address, or what prevents it. Raises RequestError for a bad address."""
    try:
        bus = session.open(address)
    except LinkError as error:
        return _of_port(error, where)
    bus.read_only = True
    return bus


def _of_port(error: LinkError, where: str) -> Finding:
    """The finding of an error of a port."""
    code, text = "port-refused", error.summary
    if "brltty" in text or (isinstance(error, PortNotFound) and has_brltty()):
        return Finding("brltty", where, text)
    if isinstance(error, PortNotFound):
        code = "port-missing"
    elif isinstance(error, PortBusy):
        code = "port-busy"
    elif isinstance(error, LinkLost):
        code = "port-lost"
    elif "no permission" in text:
        code = "port-permission"
    elif "bit/s" in text:
        code = "rate-refused"
    return Finding(code, where, text, error.cause, error.advice)


def has_brltty(sysfs: Path = Path("/sys"), proc: Path = Path("/proc")) -> bool:
    """A CH340 is plugged in, and brltty runs: it took the port when the adapter was plugged in."""
    devices = list((sysfs / "bus/usb/devices").glob("*"))
    adapters = [(_text(one / "idVendor"), _text(one / "idProduct")) for one in devices]
    return CH340 in adapters and any(_text(one) == "brltty" for one in proc.glob("[1-9]*/comm"))


def _text(path: Path) -> str:
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
