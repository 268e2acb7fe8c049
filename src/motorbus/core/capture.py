"""Packets of a recorded line, and the decoders that a family provides for them.

A `Cutter` decodes a recording chunk by chunk, `Captures.bulk` the whole of it at once in arrays; both find the same
packets. `recorder` makes `Packet`s of either result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple, Protocol, TypeAlias

from motorbus.core.request import Data, Noise

NOISE: Final = 0
REQUEST: Final = 1
REPLY: Final = 2
EITHER: Final = 3
NOTICE: Final = 4
KINDS: Final = ("noise", "request", "reply", "either", "notice")
"""Kinds of packets; columns hold the index. "either": a request, its echo or a reply, which cannot be decided."""
FAULTS: Final = ("", "checksum", "framing", "foreign")
"""Why bytes are noise, as `Noise.fault`, or "" for a valid packet; columns hold the index."""
WAYS: Final = ("", "rx", "tx")
"""Direction of bytes: from the devices (rx), to them (tx), or unknown and possibly mixed ("")."""
ABSENT: Final = -1
"""Node or code of a packet that has none."""
PIECE: Final = 1024
"""Bytes; a longer run of noise is split into pieces of this length, the last one shorter."""

Run: TypeAlias = "list[bytes] | Noise"
"""Consecutive valid packets, or the noise between two of them."""
PacketFacts: TypeAlias = Callable[[], tuple[Sequence[int], Sequence[int], Sequence[int]]]
"""Computes the kinds (indices), nodes and codes of packets."""


class Packet(NamedTuple):
    """One packet of a recording, or a run of noise.

    `start`  offset in the recording: bytes, for CAN frames
    `data`   the whole packet; a CAN frame as `CanFrame.flat()` serializes it
    `kind`   one of `KINDS`
    `node`   its sender or receiver; -1 for noise, and where the packet does not tell
    `code`   its content as a number of the family; -1 for noise
    `fault`  "" for a valid packet, else one of `FAULTS`
    `at`     start time, s on the clock of the recording; None where it was not recorded
    """

    start: int
    data: bytes
    kind: str
    node: int
    code: int
    fault: str
    at: float | None


class Columns(NamedTuple):
    """All packets and runs of noise of a recording in order: arrays with one element for each."""

    start: Any
    size: Any
    kind: Any
    node: Any
    code: Any
    fault: Any


class Cutter(Protocol):
    """Finds packets in data of one direction. The result does not depend on the boundaries between chunks."""

    def feed(self, data: Data, /) -> list[Run]:
        """Take bytes, or one CAN frame; return the runs that are complete. Never raises."""

    def flush(self) -> list[Run]:
        """Return the runs in the remaining data at the end of the recording."""

    def tell(self, packets: list[bytes], /) -> PacketFacts:
        """Identify packets; call it with the packets in the order in which they were found."""


class Captures(NamedTuple):
    """Decoders of a family for recordings of its line.

    `cutter`  makes a `Cutter` for one of `WAYS`
    `bulk`    (numpy, all bytes or a list of all CAN frames, one of `WAYS`) -> `Columns`, equal to the result of the
              cutter; None where it would not be faster
    `code`    the meaning of the code of a packet, in words
    """

    cutter: Callable[[str], Cutter]
    bulk: Callable[[Any, Any, str], Columns] | None = None
    code: str = ""
