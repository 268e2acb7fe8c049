"""Row 12: a servo that is silent: processor time of one time-out, and how far past its deadline it is told.

    python -m bench.rows.silence CONTENDER PORT COUNT

A position is asked of an id that nobody has, again and again, in processes of their own against a fresh responder. Our
deadline is what the bus fixes when the request leaves: the time of the bytes, the turnaround of the family, the latency
of the adapter and a margin for a busy host. The first request, which is tried twice, is left out; rustypot gets a
time-out of about the same length. A bus tells its deadlines to nobody, so this one is reckoned anew from the parts that
make it, which a program has no other use for; what is timed is the public call. How far past the deadline is wall time
in which the kernel wakes a process: the median counts, and the greatest is told beside it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from resource import RUSAGE_SELF, getrusage
from statistics import median
from time import perf_counter
from typing import Any

from bench import responder
from bench.apart import Job, told
from bench.apart import rounds as shuffled
from bench.figures import spread
from bench.row import PROCESS, ROUNDS, Row, Say, met, noted, pairs

NUMBERS = ("12",)
MODULE = "bench.rows.silence"
NOBODY = 0
"""An id that the responder does not have; it has all others."""
COUNT, WARM_UP = 30, 3
TIMEOUT = 0.025
"""s, for those that are told one."""
BAUD = 1_000_000
OURS, RUST, VENDOR = "motorbus", "rustypot", "feetech-servo-sdk"
JOBS = (
    Job(OURS, MODULE, (OURS,)),
    Job(RUST, MODULE, (RUST,), ("rustypot",)),
    Job(VENDOR, MODULE, (VENDOR,), (VENDOR, "pyserial")),
)

Said = dict[str, Any]


def rows(rounds: int, say: Say) -> list[Row]:
    """Row 12. Raises Failed, NoCompiler."""
    times = max(rounds, ROUNDS)
    first = judged(measured(times, say))
    if all(map(met, first)):
        return first
    second = judged(measured(times, say))
    return [
        one if met(one) else two._replace(note=noted(two.note, f"measured twice, first {one.value:.2f}"))
        for one, two in zip(first, second, strict=True)
    ]


def measured(times: int, say: Say) -> dict[str, list[Said]]:
    """What everyone said in each round. Raises Failed, NoCompiler."""
    program = responder.build()

    def run(job: Job) -> Said:
        with responder.responder(program) as wire:
            return told(job, wire.port, str(COUNT))

    return dict(shuffled([job for job in JOBS if job.there], times, say, run))


def judged(found: dict[str, list[Said]]) -> list[Row]:
    """Ours by rustypot's, and the overshoot of ours."""
    ours = found[OURS]
    over = spread(median(said["late"]) * 1e3 for said in ours)
    most = max(late for said in ours for late in said["late"]) * 1e3
    overshoot = Row(
        "12",
        "silent servo: told after the deadline",
        "-",
        "ms",
        *over,
        "< 2",
        samples=len(ours),
        note=f"the latest of all {most:.2f} ms",
        margin=0.0,
    )
    if RUST not in found:
        return [overshoot]
    return [_needed(found, ours), overshoot]


def _needed(found: dict[str, list[Said]], ours: Sequence[Said]) -> Row:
    costs = {name: [said["processor"] for said in every] for name, every in found.items()}
    told = f"{VENDOR} {median(costs[VENDOR]) * 1e6:.0f} µs" if VENDOR in costs else ""
    return Row(
        "12",
        "silent servo: processor time per time-out",
        RUST,
        "x",
        *pairs(costs[OURS], costs[RUST]),
        "<= 2",
        "<= 1",
        ours=median(costs[OURS]),
        theirs=median(costs[RUST]),
        samples=len(ours),
        note=told,
        margin=PROCESS,
    )


# -- in the process that is measured -----------------------------------------------------------------------------


def timed(ask: Callable[[], None], count: int, deadline: float) -> Said:
    """Processor time of one time-out, and how late each was told (s)."""
    for _ in range(WARM_UP):
        ask()
    took = []
    before = getrusage(RUSAGE_SELF)
    for _ in range(count):
        began = perf_counter()
        ask()
        took.append(perf_counter() - began)
    after = getrusage(RUSAGE_SELF)
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return {"processor": used / count, "late": [each - deadline for each in took]}


def ours(port: str, count: int) -> Said:
    """By the public call, and the error that it raises."""
    import motorbus
    from motorbus import feetech
    from motorbus.bus.engine import MARGIN
    from motorbus.core.request import Expected, Request

    told = motorbus.NoReply("nobody was asked yet")
    with motorbus.open(f"feetech:{port},baud={BAUD}") as bus:
        servo = feetech.Servo(bus, NOBODY)

        def ask() -> None:
            nonlocal told
            try:
                servo.position()
            except motorbus.NoReply as error:
                told = error
            else:
                raise AssertionError("somebody answered")

        ask()
        sent, expected = told.sent, int(str(told.expected).split()[0])
        assert isinstance(sent, bytes)
        asked: Request[None] = Request(sent, (Expected(NOBODY, NOBODY, expected),))
        driver = feetech.FAMILY.open()
        patience = driver.air_time(asked, BAUD) + driver.turnaround(asked) + bus.link.latency
        return timed(ask, count, patience + MARGIN[asked.reply_within])


def rust(port: str, count: int) -> Said:
    """rustypot, by its typed controller."""
    rustypot: Any = import_module("rustypot")  # it is in a folder of its own, where no type checker looks
    controller = rustypot.Sts3215PyController(port, BAUD, TIMEOUT)

    def ask() -> None:
        try:
            controller.read_present_position(NOBODY)
        except Exception:  # it has no type of its own
            return
        raise AssertionError("somebody answered")

    return timed(ask, count, TIMEOUT)


def vendor(port: str, count: int) -> Said:
    """The vendor's SDK, which has a time-out of its own, in milliseconds."""
    sdk: Any = import_module("scservo_sdk")  # it is in a folder of its own, where no type checker looks
    opened = sdk.PortHandler(port)
    if not opened.openPort() or not opened.setBaudRate(BAUD):
        raise OSError(f"cannot open {port}")
    packets = sdk.PacketHandler(0)

    def ask() -> None:
        if packets.read2ByteTxRx(opened, NOBODY, 56)[1] == sdk.COMM_SUCCESS:
            raise AssertionError("somebody answered")

    return timed(ask, count, 0.0)


CONTENDERS = {OURS: ours, RUST: rust, VENDOR: vendor}

if __name__ == "__main__":
    name, port, count = sys.argv[1:]
    print(json.dumps(CONTENDERS[name](port, int(count))))
