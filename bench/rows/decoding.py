"""Row 8: packets out of a noisy capture, by the receiver of a bus, against the vendor's SDK.

One capture (`bench.noisy_stream`) for both, in memory. The receiver gets it in pieces as a serial port returns them,
and in large blocks; the SDK's `rxPacket` reads from a port that returns what it requests and never waits. The figure is
the time that the SDK needs for the whole capture by the time that the receiver needs. The receiver must find exactly
the packets of a search by brute force. The note says how many of them the SDK finds: it drops what follows a damaged
length.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from statistics import median
from time import process_time
from typing import Any

from bench import apart
from bench.noisy_stream import capture, decodable, pieces
from bench.rounds import Failed
from bench.row import SAMPLES, Row, Say, pairs

NUMBERS = ("8",)
MODULE = "bench.rows.decoding"
SDK = "feetech-servo-sdk"
STREAM, BLOCKS = "streaming", "streaming, blocks"
BLOCK = 4096
"""Bytes of a block."""
JOBS = (
    apart.Job(STREAM, MODULE, (STREAM,)),
    apart.Job(BLOCKS, MODULE, (BLOCKS,)),
    apart.Job(SDK, MODULE, (SDK,), (SDK, "pyserial")),
)
PASSES, AT_LEAST = 9, 0.5
"""Of each sample: the number of passes over the capture, and their minimum total time (s); the median pass counts."""
GOALS = {STREAM: (">= 3.5", ">= 5"), BLOCKS: ("", "")}
MEASURES = {
    STREAM: "streaming decoding of a noisy capture, in pieces as of a port",
    BLOCKS: f"streaming decoding of a noisy capture, in blocks of {BLOCK} bytes as of a file",
}


def rows(rounds: int, say: Say) -> list[Row]:
    """Row 8, for pieces and for blocks. Raises Failed if the receiver misses a packet or finds one too many."""
    if not all(job.there for job in JOBS):
        say(f"{SDK} is not installed: row 8 is not measured\n")
        return []
    found = apart.rounds(JOBS, max(rounds, SAMPLES), say)
    return [_row(name, found) for name in GOALS]


def _row(name: str, found: Any) -> Row:
    ours, theirs = ([one["seconds"] for one in found[who]] for who in (name, SDK))
    first = found[SDK][0]
    note = (
        f"per decodable packet {median(ours) / first['decodable'] * 1e6:.2f} µs of ours, "
        f"{median(theirs) / first['decodable'] * 1e6:.2f} µs of theirs; the SDK finds "
        f"{first['found'] / first['decodable']:.1%} of {first['decodable']} packets"
    )
    return Row(
        "8",
        f"{MEASURES[name]}; {first['bytes']} bytes",
        SDK,
        "x",
        *pairs(theirs, ours),
        *GOALS[name],
        median(ours),
        median(theirs),
        len(ours),
        note,
    )


# -- in a process of its own -------------------------------------------------------------------------------------


def measured(name: str, packets: int | None = None) -> dict[str, Any]:
    """One decoder over the capture, once to warm up and then timed. Raises Failed for a wrong result."""
    stream = capture() if packets is None else capture(packets)
    truth = list(decodable(stream))
    decode = {STREAM: _streaming, BLOCKS: _blocks, SDK: _vendor}[name]()
    decode(stream)
    passes: list[float] = []
    while len(passes) < PASSES or sum(passes) < AT_LEAST:
        seconds, places = decode(stream)
        passes.append(seconds)
    known = {at for at, _ in truth}
    if name != SDK and places != [data for _, data in truth]:
        raise Failed(f"{name}: {len(places)} packets, and not the {len(truth)} that brute force finds")
    found = sum(at in known for at in places) if name == SDK else len(places)
    return {"seconds": median(passes), "bytes": len(stream), "decodable": len(truth), "found": found}


Decoder = Callable[[bytes], tuple[float, Sequence[Any]]]
"""Processor time for the whole stream, and what was found: packets, or the places of those of the SDK."""


def _blocks() -> Decoder:
    return _streaming(
        lambda stream: [stream[start : start + BLOCK] for start in range(0, len(stream), BLOCK)]
    )


def _streaming(cutting: Callable[[bytes], list[bytes]] = pieces) -> Decoder:
    from motorbus.core.request import Reply
    from motorbus.families.feetech import FAMILY

    def decode(stream: bytes) -> tuple[float, list[bytes]]:
        cut, receiver = cutting(stream), FAMILY.open().receiver()
        began = process_time()
        events = [event for piece in cut for event in receiver.feed(piece)]
        events += receiver.flush()
        seconds = process_time() - began
        return seconds, [event.data for event in events if isinstance(event, Reply)]

    return decode


class MemoryPort:
    """Those members of the SDK's PortHandler that its `rxPacket` uses, over a capture in memory."""

    def __init__(self, stream: bytes) -> None:
        self.is_using = False
        self.stream = stream
        self.at = 0

    def readPort(self, length: int) -> bytes:  # noqa: N802 - the SDK's name
        start = self.at
        self.at = min(start + max(0, length), len(self.stream))
        return self.stream[start : self.at]

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return self.at >= len(self.stream)


def _vendor() -> Decoder:
    import scservo_sdk as sdk  # type: ignore[import-not-found]

    handler = sdk.PacketHandler(0)

    def decode(stream: bytes) -> tuple[float, list[int]]:
        port, end, found = MemoryPort(stream), len(stream), []
        began = process_time()
        while port.at < end:
            packet, result = handler.rxPacket(port)
            if result == sdk.COMM_SUCCESS:
                found.append((port.at, packet))
        seconds = process_time() - began
        return seconds, [at - len(packet) for at, packet in found]

    return decode


if __name__ == "__main__":
    json.dump(measured(sys.argv[1], *map(int, sys.argv[2:])), sys.stdout)
