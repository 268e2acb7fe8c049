"""Rows 8 and 9: packets out of a noisy capture, by a streaming decoder and by a bulk one, against the vendor's SDK.

One capture (`bench.noisy_stream`) for all, in memory. The streaming decoder gets it in pieces as a serial port hands
them over, and gives lists of packets; what they say is not asked. The SDK has all of it at hand, so what ours needs
for blocks as of a file is told beside it. The bulk decoder gets it whole, and gives arrays, and the bytes of packets
once they are asked for: row 9 has them cut out, as the SDK does; what the arrays alone take is told beside it. The
SDK's `rxPacket` reads from a port that hands over what it asks for and never makes it wait. The figure is the time that
theirs needs for the whole capture by the time that ours needs. Ours must give exactly the packets that a search by
brute force finds; how many of them the SDK finds is told, for it gives up what follows a damaged length.
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

NUMBERS = ("8", "9")
MODULE = "bench.rows.decoding"
SDK = "feetech-servo-sdk"
STREAM, BLOCKS, BULK, CUT = "streaming", "streaming, blocks", "bulk", "bulk, bytes too"
BLOCK = 4096
"""Bytes of a block."""
JOBS = (
    apart.Job(STREAM, MODULE, (STREAM,)),
    apart.Job(BLOCKS, MODULE, (BLOCKS,)),
    apart.Job(BULK, MODULE, (BULK,)),
    apart.Job(CUT, MODULE, (CUT,)),
    apart.Job(SDK, MODULE, (SDK,), (SDK, "pyserial")),
)
PASSES, AT_LEAST = 9, 0.5
"""Of each sample: over the whole capture, and so long in all (s); the pass in the middle counts."""
GOALS = {
    STREAM: ("8", ">= 3.5", ">= 5"),
    BLOCKS: ("8", "", ""),
    CUT: ("9", ">= 15", ">= 25"),
    BULK: ("9", "", ""),
}
MEASURES = {
    STREAM: "streaming decoding of a noisy capture, in pieces as of a port",
    BLOCKS: f"streaming decoding of a noisy capture, in blocks of {BLOCK} bytes as of a file",
    CUT: "bulk decoding of a noisy capture, the bytes of each packet cut out",
    BULK: "bulk decoding of a noisy capture, columns only, which is less than theirs does",
}


def rows(rounds: int, say: Say) -> list[Row]:
    """Rows 8 and 9, and what columns take alone. Raises Failed when ours misses a packet or finds one too many."""
    if not all(job.there for job in JOBS):
        say(f"{SDK} is not installed: rows 8 and 9 are not measured\n")
        return []
    found = apart.rounds(JOBS, max(rounds, SAMPLES), say)
    return [_row(name, found) for name in GOALS]


def _row(name: str, found: Any) -> Row:
    number, goal, stretch = GOALS[name]
    ours, theirs = ([one["seconds"] for one in found[who]] for who in (name, SDK))
    ratio = pairs(theirs, ours)
    first = found[SDK][0]
    note = (
        f"per decodable packet {median(ours) / first['decodable'] * 1e6:.2f} µs of ours, "
        f"{median(theirs) / first['decodable'] * 1e6:.2f} µs of theirs; the SDK finds "
        f"{first['found'] / first['decodable']:.1%} of {first['decodable']} packets"
    )
    if name in (BULK, CUT):
        streamed = pairs([one["seconds"] for one in found[STREAM]], ours)
        what = "as arrays, bytes as a list" if name == CUT else "as arrays"
        times = f"{streamed.median:.1f} times as fast as our streaming decoder"
        note += f"; places, nodes, codes and faults {what}: {times}"
    return Row(
        number,
        f"{MEASURES[name]}; {first['bytes']} bytes",
        SDK,
        "x",
        *ratio,
        goal,
        stretch,
        median(ours),
        median(theirs),
        len(ours),
        note,
    )


# -- in a process of its own -------------------------------------------------------------------------------------


def measured(name: str, packets: int | None = None) -> dict[str, Any]:
    """One decoder over the capture, once to warm up and then by the clock. Raises Failed for a wrong result."""
    stream = capture() if packets is None else capture(packets)
    truth = list(decodable(stream))
    decode = {STREAM: _streaming, BLOCKS: _blocks, BULK: _bulk, CUT: _cut, SDK: _vendor}[name]()
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
    from motorbus.recorder import Decoder

    def decode(stream: bytes) -> tuple[float, list[bytes]]:
        cut, decoder = cutting(stream), Decoder("feetech", "rx")
        began = process_time()
        heard = [decoder.feed(piece) for piece in cut]
        last = decoder.flush()
        seconds = process_time() - began
        found = [data for one in heard for data, fault in zip(one.data, one.fault, strict=True) if not fault]
        return seconds, found + [packet.data for packet in last if not packet.fault]

    return decode


def _bulk(cut: bool = False) -> Decoder:
    """The columns, as arrays; with `cut` the bytes of each packet as well."""
    from motorbus.recorder import decode as at_once

    def decode(stream: bytes) -> tuple[float, list[bytes]]:
        began = process_time()
        packets = at_once("feetech", stream, "rx")
        if cut:
            _ = packets.data
        seconds = process_time() - began
        return seconds, [data for data, fault in zip(packets.data, packets.fault, strict=True) if not fault]

    return decode


def _cut() -> Decoder:
    return _bulk(cut=True)


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
