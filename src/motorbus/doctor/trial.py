"""Two trials that a user asks for: the rate of a control loop, by reads only; a small movement of each axis."""

from __future__ import annotations

from statistics import quantiles
from typing import Any, Final

from motorbus.core.findings import Finding
from motorbus.core.steps import Sleep
from motorbus.core.units import DEGREE
from motorbus.doctor.bus import BusDoctor
from motorbus.doctor.findings import complete
from motorbus.errors import DeviceError, MotorbusError, NoReply, WireError
from motorbus.motion.robot import Robot

SECONDS: Final = 1.0
SHARE: Final = 0.8  # of the period that a cycle may take
MISSED: Final = 0.02  # share of the cycles that may be late
SWING: Final = 3.0  # deg of the device, towards the middle of its range
LOST: Final = (NoReply, WireError, DeviceError)  # of one cycle; a lost port ends the trial
SPEED: Final = 0.3  # share of the velocity of the axis


def measure_loop(doctor: BusDoctor, rate: float) -> None:
    """Read all positions at `rate` (Hz) for a second; goals are counted by their air time and not sent."""
    bus, streams = doctor.bus, _streams(doctor)
    reads = [request for stream in streams for request in stream.positions]
    if not reads:
        return
    air = sum(map(bus.engine.air_time, reads))
    wire = air + sum(map(bus.engine.air_time, _goals(doctor, streams)))
    period, times, late = 1 / rate, [], 0
    due = bus.now() + period
    for _ in range(max(int(rate * SECONDS), 10)):
        start = bus.now()
        bus.exchange(reads, LOST)
        times.append(bus.now() - start)
        late += bus.now() > due
        bus.run(Sleep(max(due - bus.now(), 0.0)))
        due = max(due, bus.now()) + period
    points = quantiles(times, n=100)
    beyond = points[49] - air
    evidence = (
        f"{rate:g} Hz is {1000 * period:.2g} ms; reads take {1000 * points[49]:.2g} ms, p99 {1000 * points[98]:.2g} ms;"
        f" goals and reads are {1000 * wire:.2g} ms on the wire; {late} of {len(times)} cycles late"
    )
    reachable = f"about {SHARE / max(points[49], wire):.0f} Hz are possible"
    if wire > SHARE * period:
        fix = f"a higher baud rate, or fewer devices on this bus; {reachable}"
        doctor.add("loop-too-fast", doctor.where, evidence, "the bytes take too long on the wire", fix)
    elif late <= MISSED * len(times):
        doctor.add("loop-rate", doctor.where, evidence, reachable)
    elif beyond > air:
        cause = (
            f"{1000 * beyond:.1f} ms of a cycle are not the wire: the latency timer of the adapter, or a hub"
        )
        fix = f"set the latency timer to 1 ms, connect the adapter without a hub; {reachable}"
        doctor.add("loop-too-fast", doctor.where, evidence, cause, fix)
    else:
        doctor.add("loop-too-fast", doctor.where, evidence)


def _streams(doctor: BusDoctor) -> list[Any]:
    groups: dict[Any, list[Any]] = {}
    for subject in doctor.subjects.values():
        axis = doctor.bus.driver.axis(subject.identity)
        if "stream" in axis:
            groups.setdefault(axis.stream, []).append(subject.device)
    made = [doctor.read(open_(devices, rate=doctor.bus.rate)) for open_, devices in groups.items()]
    return [one for one in made if not isinstance(one, MotorbusError)]


def _goals(doctor: BusDoctor, streams: list[Any]) -> list[Any]:
    """The requests that would hold every device where it is."""
    found = []
    for stream in streams:
        values = doctor.bus.exchange(stream.positions, LOST)
        read = [one.values for one in values if not isinstance(one, MotorbusError)]
        try:
            found += stream.goals({node: angle for one in read for node, angle in one.items()})
        except MotorbusError:
            continue  # a device is outside of its range
    return found


def move_axes(robot: Robot) -> list[Finding]:
    """Move each axis that has a position by 3 deg and back, one after the other. Limp axes are limp again after it."""
    found = []
    for name, axis in robot.axes.items():
        if axis.config.is_wheel or "position" not in axis.driver:
            continue
        bus: Any = axis.bus
        is_limp = "health" in axis.driver and bus.run(axis.driver.health(axis.device)).torque is False
        try:
            here = robot.positions(name)[name]
            low, high = axis.config.low, axis.config.high
            swing = SWING * DEGREE / abs(axis.config.ratio)
            if low is not None and high is not None and here > (low + high) / 2:
                swing = -swing
            robot.move({name: here + swing}, speed=SPEED)
            state = robot.states(name)[name]
            robot.move({name: here}, speed=SPEED)
        except MotorbusError as error:
            cause = error.cause or "it is blocked, overloaded, or lost its torque"
            found.append(Finding("motion-blocked", name, error.summary, cause, error.advice))
            continue
        finally:
            if is_limp:
                robot.disable_torque(name)
        if "voltage" in state.alarm:
            evidence = f"supply {state.voltage or 0:.1f} V after a move, its voltage alarm is set"
            found.append(Finding("supply-sag", name, evidence))
    return [complete(one, one.where) for one in found]
