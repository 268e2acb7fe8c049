"""The packets of a recording, counted by kind, node and code, and the noise by its fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.cli.exits import Exit
from motorbus.core.recording import ABSENT
from motorbus.errors import RequestError
from motorbus.recorder import Decoder, Packet

if TYPE_CHECKING:
    from motorbus.cli.output import Output
    from motorbus.core.can_frame import CanFrame
    from motorbus.core.family import Family
    from motorbus.recorder.can_log import Logged

_CHUNK: Final = 1 << 14
"""Bytes that are decoded at a time."""
_KINDS: Final = ("noise", "request", "reply", "either", "notice")
_FAULTS: Final = ("", "checksum", "framing", "foreign")
"""Kinds and faults in the order in which they are shown."""


class Group(NamedTuple):
    """The packets of one kind, node, code and fault, see `recorder.Packet`; their number and their bytes."""

    kind: str
    node: int
    code: int
    fault: str
    packets: int
    bytes: int


def summary(
    family: Family,
    recording: bytes | Sequence[CanFrame],
    direction: str,
    output: Output,
    damaged: Sequence[Logged] = (),
) -> Exit:
    """Print the groups of a recording; FAILURE if it contains noise or damaged lines.

    `damaged` are the lines of a log that could not be read.
    """
    if not recording and not damaged:
        raise RequestError("there is nothing to count", expected="bytes, or frames for a CAN family")
    decoder = Decoder(family, direction)
    groups = counted(_packets(decoder, recording))
    noise = [group for group in groups if group.fault]
    facts = {
        "family": family.name,
        "packets": sum(group.packets for group in groups if not group.fault),
        "bytes": sum(group.bytes for group in groups),
        "noise_bytes": sum(group.bytes for group in noise),
        "damaged_lines": len(damaged),
        "code": decoder.code_meaning,
        "groups": [_facts(group) for group in groups],
    }
    output.document("motorbus.decode.summary/1", facts)
    lines = f", damaged lines: {len(damaged)}" if damaged else ""
    output.table(
        f"{facts['packets']} packets, {facts['noise_bytes']} of {facts['bytes']} bytes are noise{lines}",
        ("kind", ">node", ">code", ">packets", ">bytes"),
        [_row(group) for group in groups],
    )
    if facts["code"]:
        output.text(f"code: {facts['code']}")
    if damaged:
        output.text(f"the first damaged line, {damaged[0].line}: {damaged[0].fault}")
    return Exit.FAILURE if noise or damaged else Exit.OK


def counted(packets: Iterable[Packet]) -> list[Group]:
    """Return the groups of these packets, noise last."""
    equal = Counter((kind, node, code, fault, len(data)) for _, data, kind, node, code, fault, _ in packets)
    numbers: Counter[tuple[str, int, int, str]] = Counter()
    sizes: Counter[tuple[str, int, int, str]] = Counter()
    for (kind, node, code, fault, size), number in equal.items():
        numbers[kind, node, code, fault] += number
        sizes[kind, node, code, fault] += number * size
    groups = [Group(*key, number, sizes[key]) for key, number in numbers.items()]
    return sorted(
        groups, key=lambda one: (_FAULTS.index(one.fault), _KINDS.index(one.kind), one.node, one.code)
    )


def _packets(decoder: Decoder, recording: bytes | Sequence[CanFrame]) -> Iterator[Packet]:
    chunks: Iterable[bytes | CanFrame]
    if isinstance(recording, bytes):
        chunks = (recording[start : start + _CHUNK] for start in range(0, len(recording), _CHUNK))
    else:
        chunks = recording
    yield from chain.from_iterable(map(decoder.feed, chunks))
    yield from decoder.flush()


def _facts(group: Group) -> dict[str, object]:
    absent = {name: None for name in ("node", "code") if getattr(group, name) == ABSENT}
    return {**group._asdict(), **absent}


def _row(group: Group) -> tuple[object, ...]:
    kind = f"{group.kind}: {group.fault}" if group.fault else group.kind
    node = "" if group.node == ABSENT else group.node
    return kind, node, "" if group.code == ABSENT else f"0x{group.code:02X}", group.packets, group.bytes
