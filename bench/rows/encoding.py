"""Row 10: making the bytes of a READ of 2 bytes at 56, and of a SYNC WRITE of 6 bytes at 42 to six servos.

Nothing is sent: a library that writes its packet to a port gets one that only keeps it. Each is asked by the shortest
public call of its own that ends in a packet: ours by the name of what is read, and by names and SI units of what is
written; theirs by address, count and raw counts. The figure is our processor time by that of the best peer of the same
round. Every packet is compared with what it must be.

A read by name is made an exchange once and kept, so there are three rows of it. What is judged is the first reading of
a position of a servo that has just been prepared, where all of it is built, the packet and what is done with its
answer: a public call by name. Beside it, without a goal: the same once it is kept, as every reading behind the first
has it, where nothing is built any more; and the bytes alone, from id, address and count, which is all that the peers
make.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from statistics import median
from time import process_time
from typing import Any, Final

from bench import apart
from bench.loop import STRETCHES
from bench.memory import packet
from bench.rounds import Failed
from bench.row import SAMPLES, Row, Say, pairs
from bench.workloads import COUNTS, IDS, goals

NUMBERS = ("10",)
MODULE: Final = "bench.rows.encoding"
OURS: Final = "motorbus"
READ, KEPT, BYTES, SYNC_WRITE = "read", "kept", "bytes", "sync_write"
TIMES: Final = {READ: 20_000, SYNC_WRITE: 4_000}
FRESH: Final = 1_000
"""Servos that are prepared for the first reading of each."""
GOALS: Final = {
    BYTES: ("", ""),
    READ: ("<= 1.0", "<= 0.8"),
    KEPT: ("", ""),
    SYNC_WRITE: ("<= 0.75", "<= 0.6"),
}
TEXT: Final = {
    BYTES: "encoding a read request, its bytes alone from id, address and count",
    READ: "encoding a read request by name, the first of a servo: the whole exchange is built",
    KEPT: "encoding a read request by name, every further one: the exchange is kept",
    SYNC_WRITE: "encoding a sync write 6x6",
}
POSITION, GOAL, SPEED = 56, 42, 1000
STEP: Final = math.tau / COUNTS

JOBS: Final = (
    apart.Job(OURS, MODULE, (OURS,)),
    apart.Job("feetech-servo-sdk", MODULE, ("feetech-servo-sdk",), ("feetech-servo-sdk", "pyserial")),
    apart.Job("ftservo-python-sdk", MODULE, ("ftservo-python-sdk",), ("ftservo-python-sdk", "pyserial")),
    apart.Job("st3215", MODULE, ("st3215",), ("st3215", "pyserial")),
    apart.Job("feetech-cli", MODULE, ("feetech-cli",), ("feetech-cli", "pyserial")),
)
"""servolab and LeRobot are left out: they encode by the vendor's SDK, and add to it."""


def rows(rounds: int, say: Say) -> list[Row]:
    """All rows 10. Raises Failed when anybody makes other bytes than those that are due."""
    jobs = [job for job in JOBS if job.there]
    if len(jobs) < 2:
        say("no peer is installed: row 10 is not measured\n")
        return []
    found = apart.rounds(jobs, max(rounds, SAMPLES), say)
    return [_row(what, found) for what in GOALS]


def _row(what: str, found: Mapping[str, Sequence[Mapping[str, float]]]) -> Row:
    theirs = SYNC_WRITE if what == SYNC_WRITE else READ
    seconds = {name: [one[theirs] for one in said] for name, said in found.items() if name != OURS}
    ours = [one[what] for one in found[OURS]]
    best = [min(one) for one in zip(*seconds.values(), strict=True)]
    peer = min(seconds, key=lambda name: median(seconds[name]))
    shown = ", ".join(f"{name} {median(each) * 1e6:.2f} µs" for name, each in seconds.items())
    return Row(
        "10",
        TEXT[what],
        peer,
        "x",
        *pairs(ours, best),
        *GOALS[what],
        median(ours),
        median(best),
        len(ours),
        f"ours {median(ours) * 1e6:.2f} µs; {shown}",
    )


# -- in a process of its own -------------------------------------------------------------------------------------

Encoder = Callable[[Any], Any]
"""Makes a packet of prepared goals, or of nothing."""


def measured(name: str, times: Mapping[str, int] = TIMES) -> dict[str, float]:
    """Seconds of processor time for each packet of each kind. Raises Failed for wrong bytes."""
    read, sync_write, prepare = MAKERS[name]()
    wanted = [goals(index) for index in range(times[SYNC_WRITE])]
    reads = _reads(times[READ]) if name == OURS else {READ: (read, [None] * times[READ])}
    return {
        **{
            kind: _each(name, how, inputs, [_read_packet()] * len(inputs))
            for kind, (how, inputs) in reads.items()
        },
        SYNC_WRITE: _each(name, sync_write, list(map(prepare, wanted)), list(map(_sync_packet, wanted))),
    }


def _each(name: str, encode: Encoder, inputs: Sequence[Any], due: Sequence[bytes]) -> float:
    stretch = max(1, len(inputs) // (STRETCHES + 1))  # the first one warms up
    made = [encode(one) for one in inputs[:stretch]]
    keep, costs = made.append, []
    for start in range(stretch, len(inputs) - stretch + 1, stretch):
        part = inputs[start : start + stretch]
        began = process_time()
        for one in part:
            keep(encode(one))
        costs.append((process_time() - began) / stretch)
    for index, one in enumerate(made):
        if bytes(one) != due[index]:
            raise Failed(f"{name} made {bytes(one).hex(' ')} where {due[index].hex(' ')} was due")
    return median(costs)


def _read_packet() -> bytes:
    return packet(1, 2, bytes((POSITION, 2)))


def _sync_packet(counts: Sequence[int]) -> bytes:
    items = b"".join(bytes((node, *_six(goal))) for node, goal in zip(IDS, counts, strict=True))
    return packet(254, 0x83, bytes((GOAL, 6)) + items)


def _six(goal: int) -> list[int]:
    """Goal, no time, speed, low byte first."""
    return [goal & 255, goal >> 8, 0, 0, SPEED & 255, SPEED >> 8]


class Sink:
    """A port that keeps what is written, with the members that the libraries' packet handlers use."""

    is_using = False

    def __init__(self) -> None:
        self.last: Any = b""

    def clearPort(self) -> None:  # noqa: N802 - the SDK's name
        """There is nothing to wait for."""

    def writePort(self, data: Any) -> int:  # noqa: N802
        self.last = data
        self.is_using = False
        return len(data)

    def setPacketTimeout(self, length: int) -> None:  # noqa: N802
        """Nothing is waited for."""

    def write(self, data: bytes) -> int:
        self.last = data
        return len(data)

    def flush(self) -> None:
        """Nothing is held back."""

    reset_input_buffer = flush


def _ours() -> tuple[Encoder, Encoder, Encoder]:
    import motorbus
    from motorbus import feetech
    from motorbus.core.request import Request

    bus = motorbus.open(motorbus.simulate("feetech", ids="1-6").url)
    servos = [feetech.Servo(bus, node) for node in IDS]
    for servo in servos:
        servo.prepare()
    position = feetech.Servo.position.function

    def read(servo: feetech.Servo) -> Any:
        exchange = position(servo)
        assert isinstance(exchange, Request)
        return exchange.wire

    write = feetech.sync_writer(servos, "goal_position", "goal_time", "goal_velocity")

    def prepare(counts: Sequence[int]) -> list[tuple[float, float, float]]:
        return [(goal * STEP, 0.0, SPEED * STEP) for goal in counts]

    def sync_write(rows: list[tuple[float, float, float]]) -> Any:
        exchange = write(rows)
        assert isinstance(exchange, Request)
        return exchange.wire

    return read, sync_write, prepare


def _reads(times: int) -> dict[str, tuple[Encoder, list[Any]]]:
    """Ours by kind: how a READ of a position is made, and of what; of each servo once, of one again and again."""
    import motorbus
    from motorbus import feetech
    from motorbus.families.feetech import wire

    read, _, _ = MAKERS[OURS]()
    bus = motorbus.open(motorbus.simulate("feetech").url)
    fresh = [feetech.Servo(bus, 1) for _ in range(min(times, FRESH))]
    for servo in fresh:
        servo.prepare()
    again = [fresh[-1]] * times

    def encode(_: Any) -> bytes:
        return wire.read(1, POSITION, 2)

    return {READ: (read, fresh), KEPT: (read, again), BYTES: (encode, again)}


def _vendor() -> tuple[Encoder, Encoder, Encoder]:
    sdk: Any = import_module("scservo_sdk")
    port, handler = Sink(), sdk.PacketHandler(0)
    group = sdk.GroupSyncWrite(port, handler, GOAL, 6)

    def read(_: Any) -> Any:
        handler.readTx(port, 1, POSITION, 2)
        return port.last

    return read, _grouped(group, port, sdk.SCS_LOBYTE, sdk.SCS_HIBYTE), list


def _ftservo() -> tuple[Encoder, Encoder, Encoder]:
    sdk: Any = import_module("scservo_sdk")
    port = Sink()
    handler = sdk.sms_sts(port)
    group = sdk.GroupSyncWrite(handler, GOAL, 6)

    def read(_: Any) -> Any:
        handler.readTx(1, POSITION, 2)
        return port.last

    return read, _grouped(group, port, handler.scs_lobyte, handler.scs_hibyte), list


def _st3215() -> tuple[Encoder, Encoder, Encoder]:
    sdk: Any = import_module("st3215.protocol_packet_handler")
    groups: Any = import_module("st3215.group_sync_write")
    port = Sink()
    handler = sdk.protocol_packet_handler(port)
    group = groups.GroupSyncWrite(handler, GOAL, 6)

    def read(_: Any) -> Any:
        handler.readTx(1, POSITION, 2)
        return port.last

    return read, _grouped(group, port, handler.sts_lobyte, handler.sts_hibyte), list


def _grouped(group: Any, port: Sink, low: Any, high: Any) -> Encoder:
    """The group writing that these three have in common."""

    def sync_write(counts: Sequence[int]) -> Any:
        for node, goal in zip(IDS, counts, strict=True):
            group.addParam(node, [low(goal), high(goal), 0, 0, low(SPEED), high(SPEED)])
        group.txPacket()
        group.clearParam()
        return port.last

    return sync_write


def _feetech_cli() -> tuple[Encoder, Encoder, Encoder]:
    protocol: Any = import_module("feetech_cli.protocol")
    port = Sink()
    handler = protocol.PacketHandler(port)
    build, word = handler.build_packet, handler.encode_word

    def read(_: Any) -> Any:
        return build(1, protocol.INST_READ, (POSITION, 2))

    def sync_write(counts: Sequence[int]) -> Any:
        entries = [(node, [*word(goal), 0, 0, *word(SPEED)]) for node, goal in zip(IDS, counts, strict=True)]
        handler.sync_write(GOAL, entries)
        return port.last

    return read, sync_write, list


MAKERS: Final[dict[str, Callable[[], tuple[Encoder, Encoder, Encoder]]]] = {
    OURS: _ours,
    "feetech-servo-sdk": _vendor,
    "ftservo-python-sdk": _ftservo,
    "st3215": _st3215,
    "feetech-cli": _feetech_cli,
}


if __name__ == "__main__":
    asked = dict.fromkeys(TIMES, int(sys.argv[2])) if len(sys.argv) > 2 else TIMES
    json.dump(measured(sys.argv[1], asked), sys.stdout)
