"""Examine buses and machines: open, read, close. Nothing is written to a device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from motorbus.bus.trace import TraceRecord
from motorbus.core.findings import Finding
from motorbus.doctor import host, loop, machine
from motorbus.doctor.bus import BusDoctor
from motorbus.doctor.findings import DeviceHealth, Report, arrange, complete, sort
from motorbus.errors import LinkError, RequestError
from motorbus.motion.machine import MachineConfig
from motorbus.session.address import parse_address

Trace: TypeAlias = "dict[str, list[TraceRecord]]"
"""What went over the wire, by bus."""


def examine_machine(path: str, trace: Trace, rate: float = 0.0) -> Report:
    """The buses of a machine file, and the file itself; `rate` (Hz) of a control loop to measure."""
    try:
        config = MachineConfig.load(path)
    except RequestError as error:
        fix = error.advice or (f"write {error.expected}" if error.expected else "")
        return Report(path, (complete(Finding("machine-file", path, error.summary, action=fix), path),))
    found: list[Finding] = []
    devices: dict[str, DeviceHealth] = {}
    simulated = True
    for name, bus in config.buses.items():
        axes = {axis.node: one for one, axis in config.axes.items() if axis.bus == name}
        part = _examine(bus.address, name, trace, rate, names=axes, config=config)
        found += part.findings
        devices |= part.devices
        simulated = simulated and part.simulated
    return Report(path, tuple(sort(found)), devices, simulated)


def examine_bus(address: str, trace: Trace, rate: float = 0.0) -> Report:
    """The bus of an address, `FAMILY:PORT`, with the expected ids behind #. Raises RequestError for a bad one."""
    spot = parse_address(address)
    return _examine(spot.bus, spot.bus, trace, rate, ids=spot.nodes)


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
    bus = host.open_port(address, where)
    if isinstance(bus, Finding):
        return Report(where, (complete(bus, where),))
    with bus:
        doctor = BusDoctor(bus, where, names, ids)
        try:
            doctor.examine()
            machine.check_journal(doctor)
            if config is not None:
                machine.check_axes(doctor, config)
            if rate:
                loop.measure(doctor, rate)
        except LinkError as error:
            doctor.found.append(host.explain(error, where))
        trace[where] = doctor.trace
    if not doctor.subjects:
        doctor.found = _other_settings(address, doctor) or doctor.found
    return Report(where, tuple(arrange(doctor.found, where)), doctor.health, bus.simulated)


def _other_settings(address: str, silent: BusDoctor) -> list[Finding]:
    """Open a silent bus with the other settings of its family that a device may need."""
    spot = parse_address(address)
    for settings in getattr(silent.checks, "OTHER_SETTINGS", ()):
        other = host.open_port(spot._replace(options={**spot.options, **settings}).bus, silent.where)
        if isinstance(other, Finding):
            continue
        with other:
            found = other.run(other.driver.scan())
        if found:
            ids = ", ".join(f"{one.node:#x}" for one in found)
            option = ",".join(f"{name}={value}" for name, value in settings.items())
            evidence, fix = f"{ids} answer with {option} only", f"open the bus with {option}"
            return [Finding("can-mute-node", silent.where, evidence, action=fix)]
    return []
