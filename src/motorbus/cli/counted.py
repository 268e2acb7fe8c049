"""What a whole recording holds, counted: who said what how often, and how much was broken.

It is taken apart at once where numpy is there, else piece by piece, which takes longer and gives the same.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.cli.exits import Exit
from motorbus.core.capture import ABSENT, FAULTS, KINDS
from motorbus.errors import RequestError
from motorbus.recorder import Decoder, Packets, decode
from motorbus.recorder.bulk import can_decode
from motorbus.recorder.heard import captures_of

if TYPE_CHECKING:
    from motorbus.cli.output import Output
    from motorbus.core.can_frame import CanFrame
    from motorbus.core.family import Family
    from motorbus.recorder.can_log import Logged

_PIECE: Final = 1 << 16
"""Bytes that are fed at a time where there is no numpy."""


class Group(NamedTuple):
    """So many packets say the same kind of thing; `kind` and `fault` as in `Packet`."""

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
    """Print what is in it; FAILURE if anything is broken or belongs to no packet.

    `damaged` are the lines of a log of which nobody knows what was in them.
    """
    if not recording and not damaged:
        raise RequestError("there is nothing to count", expected="bytes, or frames for a CAN family")
    groups = counted(_taken_apart(family, recording, direction))
    noise = [group for group in groups if group.fault]
    facts = {
        "family": family.name,
        "packets": sum(group.packets for group in groups if not group.fault),
        "bytes": sum(group.bytes for group in groups),
        "noise_bytes": sum(group.bytes for group in noise),
        "damaged_lines": len(damaged),
        "code": captures_of(family).code,
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


def counted(found: Iterator[Packets]) -> list[Group]:
    """Packets of one kind, node and code together, noise of one kind last."""
    times: Counter[tuple[int, int, int, int]] = Counter()
    sizes: Counter[tuple[int, int, int, int]] = Counter()
    for packets in found:
        columns = (packets.kind, packets.node, packets.code, packets.fault, packets.size)
        rows = zip(*map(_plain, columns), strict=True)
        for (kind, node, code, fault, size), count in Counter(rows).items():
            times[kind, node, code, fault] += count
            sizes[kind, node, code, fault] += count * size
    order = sorted(times, key=lambda key: (key[3], key))
    return [Group(KINDS[key[0]], key[1], key[2], FAULTS[key[3]], times[key], sizes[key]) for key in order]


def _taken_apart(family: Family, recording: bytes | Sequence[CanFrame], way: str) -> Iterator[Packets]:
    if can_decode():
        yield decode(family, recording, way)
        return
    decoder = Decoder(family, way)
    if isinstance(recording, bytes):
        for start in range(0, len(recording), _PIECE):
            yield decoder.feed(recording[start : start + _PIECE])
    else:
        yield from map(decoder.feed, recording)
    yield from decoder.rest()


def _plain(column: Sequence[int]) -> Sequence[int]:
    return column.tolist() if hasattr(column, "tolist") else column


def _facts(group: Group) -> dict[str, object]:
    nobody = {name: None for name in ("node", "code") if getattr(group, name) == ABSENT}
    return {**group._asdict(), **nobody}


def _row(group: Group) -> tuple[object, ...]:
    kind = f"{group.kind}: {group.fault}" if group.fault else group.kind
    node = "" if group.node == ABSENT else group.node
    return kind, node, "" if group.code == ABSENT else f"0x{group.code:02X}", group.packets, group.bytes
