"""Examine buses and machines: open, read, close. Nothing is written to a device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack

from motorbus.bus.trace import TraceRecord
from motorbus.core.findings import Finding
from motorbus.doctor import host, loop, machine
from motorbus.doctor.bus import BusDoctor
from motorbus.doctor.findings import DeviceHealth, Report, arrange, sort
from motorbus.errors import RequestError
from motorbus.motion.machine import MachineConfig
from motorbus.session.address import parse_address

Trace = dict[str, list[TraceRecord]]
Progress = Callable[[str], object]


def examine_machine(
    path: str, *, rate: float = 0.0, trace: Trace | None = None, note: Progress = str
) -> Report:
    """All buses of a machine file, and the file itself; `rate` (Hz) of a control loop to measure."""
    try:
        config = MachineConfig.load(path)
    except RequestError as error:
        advice = error.advice or (f"write {error.expected}" if error.expected else "correct this key")
        finding = Finding("machine-file", "error", path, error.summary, "the file cannot be used", advice)
        return Report(path, (finding,))
    found: list[Finding] = []
    devices: dict[str, DeviceHealth] = {}
    simulated = True
    for name, bus in config.buses.items():
        note(f"bus {name}")
        names = {axis.node: axis_name for axis_name, axis in config.axes.items() if axis.bus == name}
        part = _examine(bus.address, name, names, (), config, rate, trace)
        found += part.findings
        devices |= part.devices
        simulated = simulated and part.simulated
    return Report(path, tuple(sort(found)), devices, simulated)


def examine_bus(address: str, *, rate: float = 0.0, trace: Trace | None = None) -> Report:
    """The bus of an address, `FAMILY:PORT`, with the expected ids behind #. Raises RequestError for a bad one."""
    spot = parse_address(address)
    return _examine(spot.bus, spot.bus, {}, spot.nodes, None, rate, trace)


def _examine(
    address: str,
    where: str,
    names: dict[int, str],
    ids: Sequence[int],
    config: MachineConfig | None,
    rate: float,
    trace: Trace | None,
) -> Report:
    with ExitStack() as stack:
        bus = host.open_port(address, where)
        if isinstance(bus, Finding):
            return Report(where, (bus,))
        stack.enter_context(bus)
        doctor = BusDoctor(bus, where, names, ids)
        doctor.examine()
        if doctor.subjects:
            machine.check_journal(doctor)
            if config is not None:
                machine.check_axes(doctor, config, where)
            if rate:
                doctor.found += loop.measure(doctor, rate)
        simulated = bus.simulated
    silent = any(one.code in ("bus-silent", "can-silent") for one in doctor.found)
    if silent and (answer := _other_settings(address, doctor)) is not None:
        doctor.found = [one for one in doctor.found if not one.code.endswith("-silent")]
        doctor.found.append(answer)
    if trace is not None:
        trace[where] = doctor.trace
    return Report(where, tuple(arrange(doctor.found, where)), doctor.health, simulated)


def _other_settings(address: str, silent: BusDoctor) -> Finding | None:
    """Open a silent bus with the other settings of its family that a device may need."""
    spot = parse_address(address)
    for settings in getattr(silent.checks, "OTHER_SETTINGS", ()):
        option = ",".join(f"{name}={value}" for name, value in settings.items())
        other = host.open_port(spot._replace(options={**spot.options, **settings}).bus, silent.where)
        if isinstance(other, Finding):
            continue
        with other:
            found = other.run(other.driver.scan())
        if found:
            ids = ", ".join(f"{one.node:#x}" for one in found)
            cause = "the devices use another form of identifiers than the bus is opened with"
            evidence = f"{ids} answer with {option} only"
            return Finding(
                "can-mute-node", "error", silent.where, evidence, cause, f"open the bus with {option}"
            )
    return None
