"""Whether a control loop reaches its rate on a bus, by reads only; what limits it, in words."""

from __future__ import annotations

from statistics import quantiles
from typing import Any, Final

from motorbus.core.findings import Finding
from motorbus.core.steps import Sleep, catch
from motorbus.doctor.bus import BusDoctor
from motorbus.errors import MotorbusError

SECONDS: Final = 1.0
SHARE: Final = 0.8  # of the period that the wire may take
MISSED: Final = 0.02  # share of the cycles that may be late


def measure(doctor: BusDoctor, rate: float) -> list[Finding]:
    """Read all positions at `rate` (Hz) for a second; goals are counted by their air time and not sent."""
    bus, streams = doctor.bus, _streams(doctor)
    reads = [request for stream in streams for request in stream.positions]
    if not reads:
        return []
    wire = sum(bus.engine.air_time(one) for one in [*reads, *_goals(doctor, streams)])
    period, times, late = 1 / rate, [], 0
    due = bus.now() + period
    for _ in range(max(int(rate * SECONDS), 10)):
        start = bus.now()
        bus.exchange(reads, (MotorbusError,))
        times.append(bus.now() - start)
        late += bus.now() > due
        bus.run(Sleep(max(due - bus.now(), 0.0)))
        due = max(due, bus.now()) + period
    p50, p99 = quantiles(times, n=100)[49], quantiles(times, n=100)[98]
    cycle = max(p99, wire)
    evidence = (
        f"{rate:g} Hz is {1000 * period:.1f} ms; reads take {1000 * p50:.1f} ms, p99 {1000 * p99:.1f} ms;"
        f" goals and reads are {1000 * wire:.1f} ms on the wire; {late} of {len(times)} cycles late"
    )
    if late <= MISSED * len(times) and wire <= SHARE * period:
        cause = f"up to about {SHARE / max(cycle, 1e-6):.0f} Hz are possible"
        return [Finding("loop-rate", "info", doctor.where, evidence, cause, "nothing to do")]
    beyond = p50 - sum(bus.engine.air_time(one) for one in reads)
    if wire > SHARE * period:
        cause, fix = "the bytes take too long on the wire", "a higher baud rate, or fewer devices on this bus"
    elif beyond > 0.5 * p50:
        cause = (
            f"{1000 * beyond:.1f} ms of a cycle are not the wire: the latency timer of the adapter, or a hub"
        )
        fix = "set the latency timer to 1 ms, connect the adapter without a hub, write return_delay=0"
    else:
        cause, fix = "the computer is late", "end other programs, or lower the rate"
    fix = f"{fix}; about {SHARE / max(cycle, 1e-6):.0f} Hz are possible now"
    return [Finding("loop-too-fast", "error", doctor.where, evidence, cause, fix)]


def _streams(doctor: BusDoctor) -> list[Any]:
    groups: dict[Any, list[Any]] = {}
    for subject in doctor.subjects.values():
        axis = doctor.bus.driver.axis(subject.identity)
        if "stream" in axis:
            groups.setdefault(axis.stream, []).append(subject.device)
    made = [doctor.bus.run(catch(open_(devices, rate=doctor.bus.rate))) for open_, devices in groups.items()]
    return [one for one in made if not isinstance(one, MotorbusError)]


def _goals(doctor: BusDoctor, streams: list[Any]) -> list[Any]:
    """The requests that would hold every device where it is."""
    found = []
    for stream in streams:
        values = doctor.bus.exchange(stream.positions, (MotorbusError,))
        here = {
            node: angle
            for one in values
            if not isinstance(one, MotorbusError)
            for node, angle in one.values.items()
        }
        try:
            found += list(stream.goals(here))
        except MotorbusError:
            continue  # outside of its range
    return found
