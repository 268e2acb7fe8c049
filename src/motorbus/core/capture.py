"""What a recording of a line holds, packet by packet, and what a family says so that it can be found.

A recording is taken apart in two ways that give the same: by a `Cutter`, as the bytes come and cut anywhere, and by
`Captures.bulk`, all of it at once in arrays. `recorder` turns both into `Packet`s; nothing here knows a family.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple, Protocol, TypeAlias

from motorbus.core.operation import Data, Noise

NOISE: Final = 0
REQUEST: Final = 1
REPLY: Final = 2
EITHER: Final = 3
NOTICE: Final = 4
KINDS: Final = ("noise", "request", "reply", "either", "notice")
"""What a packet is; in columns by number. "either": it can be a request, its echo or a reply, and nothing tells."""
FAULTS: Final = ("", "checksum", "framing", "foreign")
"""Why bytes are noise, as `Noise.fault`; in columns by number. "" for a sound packet."""
WAYS: Final = ("", "rx", "tx")
"""Which way bytes went: from the devices (rx), to them (tx), or nobody knows, and both may be among them ("")."""
NOBODY: Final = -1
"""The node, or the code, of what has none."""
PIECE: Final = 1024
"""Bytes: a longer run of noise is told in pieces of so many, the last one shorter."""

Run: TypeAlias = "list[bytes] | Noise"
"""Sound packets that follow one another, or what lies between two of them."""
Told: TypeAlias = Callable[[], tuple[Sequence[int], Sequence[int], Sequence[int]]]
"""Kinds (by number), nodes and codes of packets, worked out when somebody asks for them."""


class Packet(NamedTuple):
    """One packet of a recording, or a run of bytes that belongs to none.

    `start`  so many bytes of the recording were before it; for CAN so many frames
    `data`   the whole packet; a CAN frame as `CanFrame.flat()` says
    `kind`   one of `KINDS`
    `node`   which device it is from or for; -1 for noise, and where nothing tells
    `code`   what it says, as the family counts that; -1 for noise
    `fault`  "" for a sound packet, else why it is none
    `at`     when it began, s on the clock of the recording; None where nothing was noted
    """

    start: int
    data: bytes
    kind: str
    node: int
    code: int
    fault: str
    at: float | None


class Columns(NamedTuple):
    """The packets and the noise of a whole recording in order, as arrays with one element for each."""

    start: Any
    size: Any
    kind: Any
    node: Any
    code: Any
    fault: Any


class Cutter(Protocol):
    """Finds the packets in what went one way; its events do not depend on how that is cut."""

    def feed(self, data: Data, /) -> list[Run]:
        """Take bytes, or one CAN frame; give what is complete. Never raises."""

    def flush(self) -> list[Run]:
        """Nothing more comes: give what can be made of the rest."""

    def tell(self, packets: list[bytes], /) -> Told:
        """Who says these, which must be the next it has found, and what."""


class Captures(NamedTuple):
    """How recordings of a family's line are taken apart.

    `cutter`  makes a `Cutter` for one of `WAYS`
    `bulk`    numpy, all bytes (or a list of all CAN frames) and one of `WAYS` -> `Columns`, the same as the cutter
              finds; None where nothing is gained by it
    `code`    what the code of a packet is, in words
    """

    cutter: Callable[[str], Cutter]
    bulk: Callable[[Any, Any, str], Columns] | None = None
    code: str = ""
