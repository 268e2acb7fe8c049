"""SDO streams: what our simulated servos answer, what a server with segments would, and what may become of either.

A CAN controller drops damaged frames, so what goes wrong is which frame comes, not what became of its bits; changed
bits are drawn nevertheless, for a gateway may have them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from random import Random
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Expected, Request
from motorbus.families.kst import FAMILY, notifications, sdo
from motorbus.link.memory import MemoryLink
from tests.interop.differential.cases import Frame, SdoCase, SdoRequest
from tests.interop.differential.streams import AS_RECORDED
from tests.support.world import make_bus

NODE: Final = 0x25
Step = tuple[Frame, ...]
OBJECTS: Final = ((0x6002, 0), (0x6003, 0), (0x3000, 0), (0x100A, 0), (0x1010, 1), (0x7FFF, 3))
TEXT: Final = b"KST-X12 firmware 4.07"


@cache
def recorded() -> tuple[SdoCase, ...]:
    """Reads and writes of a simulated servo, objects it lacks among them, and transfers in segments."""
    bus = make_bus(MemoryLink(FAMILY.simulator((NODE,)), rate=500_000), FAMILY.open(), gate=False)
    trace = bus.trace.subscribe()
    reads = [SdoRequest("upload", NODE, index, subindex) for index, subindex in OBJECTS]
    writes = [
        SdoRequest("download", NODE, index, 0, data) for index, data in ((0x6003, b"\x64\0"), (0x7FFF, b"\1"))
    ]
    cases = []
    for request in (*reads, *writes):
        bus.run(Request(packet(request), (_due(request),), lane=NODE))
        _, *arrived = trace
        frames = tuple((one.data.id, one.data.data) for one in arrived if isinstance(one.data, CanFrame))
        cases.append(SdoCase(request, (frames,), AS_RECORDED))
    return (*cases, *(_segmented(size, length) for size in (True, False) for length in (0, 5, 7, 8, 21)))


def packet(request: SdoRequest) -> CanFrame:
    """As we send it, its length stated."""
    if request.kind == "upload":
        return sdo.encode_upload(request.node, request.index, request.subindex)
    return sdo.encode_download(request.node, request.index, request.subindex, request.data, sized=True)


def _due(request: SdoRequest) -> Expected:
    made = sdo.upload_due if request.kind == "upload" else sdo.download_due
    return made(request.node, request.index, request.subindex)


def _segmented(stated: bool, length: int) -> SdoCase:
    """A text that comes in segments; no servo of ours does this, newer firmware may."""
    request, text = SdoRequest("upload", NODE, 0x100A, 0), TEXT[:length]
    first = sdo.encode_upload_start(NODE, 0x100A, 0, length if stated else None)
    pieces = [text[at : at + 7] for at in range(0, length, 7)] or [b""]
    rest = [
        sdo.encode_segment_reply(NODE, place % 2, piece, place == len(pieces) - 1)
        for place, piece in enumerate(pieces)
    ]
    steps = tuple(((frame.id, frame.data),) for frame in (first, *rest))
    return SdoCase(request, steps, "in segments" if stated else "in segments, size not stated")


# --- what becomes of an answer ----------------------------------------------------------------------------------------

Change = Callable[[Random, Frame], Step]


def _field(first: int, last: int) -> Change:
    """These bytes are others."""

    def change(random: Random, frame: Frame) -> Step:
        identifier, data = frame
        return ((identifier, data[:first] + random.randbytes(last - first) + data[last:]),)

    return change


def _flipped(random: Random, frame: Frame) -> Step:
    identifier, data = frame
    spot = random.randrange(len(data))
    return ((identifier, data[:spot] + bytes((data[spot] ^ 1 << random.randrange(8),)) + data[spot + 1 :]),)


def _other_sub(random: Random, frame: Frame) -> Step:
    identifier, data = frame
    return ((identifier, data[:3] + bytes((data[3] ^ random.randrange(1, 256),)) + data[4:]),)


def _other_index(random: Random, frame: Frame) -> Step:
    identifier, data = frame
    return ((identifier, data[:1] + (0x6003).to_bytes(2, "little") + data[3:]),)


def _aborted(random: Random, frame: Frame) -> Step:
    identifier, data = frame
    code = random.choice(sorted(sdo.ABORTS)).to_bytes(4, "little")
    return ((identifier, b"\x80" + random.choice((data[1:4], bytes(3), b"\x03\x60\x00")) + code),)


def _toggled(random: Random, frame: Frame) -> Step:
    identifier, data = frame
    return ((identifier, bytes((data[0] ^ 0x10,)) + data[1:]),)


def _expedited(random: Random, frame: Frame) -> Step:
    """Any size, stated or not."""
    identifier, data = frame
    return (
        (identifier, bytes((random.choice((0x42, 0x43, 0x46, 0x47, 0x4B, 0x4F, 0x40, 0x41)),)) + data[1:]),
    )


def _acknowledged(random: Random, frame: Frame) -> Step:
    identifier, data = frame
    return ((identifier, b"\x60" + data[1:4] + bytes(4)),)


def _short(random: Random, frame: Frame) -> Step:
    identifier, data = frame
    return ((identifier, data[: random.randrange(len(data))]),)


def _another_node(random: Random, frame: Frame) -> Step:
    return ((frame[0] + random.choice((1, -1)), frame[1]),)


def _lost(random: Random, frame: Frame) -> Step:
    return ()


def _twice(random: Random, frame: Frame) -> Step:
    return (frame, frame)


def _echoed(random: Random, frame: Frame) -> Step:
    return ((0x600 + NODE, b"\x40" + frame[1][1:4] + bytes(4)), frame)


def _stale_in_front(random: Random, frame: Frame) -> Step:
    """The late answer to another request, just before this one."""
    return (random.choice(recorded()).steps[0][0], frame)


def _stale_behind(random: Random, frame: Frame) -> Step:
    return (frame, random.choice(recorded()).steps[0][0])


def _report_in_front(random: Random, frame: Frame) -> Step:
    """A position report has the identifier of replies and four bytes."""
    report = notifications.encode_report(NODE, random.randrange(-900, 900))
    return ((report.id, report.data), frame)


CHANGES: Final[dict[str, Change]] = {
    "a bit turned over": _flipped,
    "any specifier": _field(0, 1),
    "any index": _field(1, 3),
    "any data": _field(4, 8),
    "any frame": _field(0, 8),
    "another index": _other_index,
    "another sub-index": _other_sub,
    "an abort": _aborted,
    "toggle bit": _toggled,
    "any expedited size": _expedited,
    "an acknowledgement": _acknowledged,
    "too short": _short,
    "another node": _another_node,
    "lost": _lost,
    "twice": _twice,
    "echo in front": _echoed,
    "another answer in front": _stale_in_front,
    "another answer behind": _stale_behind,
    "report in front": _report_in_front,
}


def drawn(seed: int, count: int) -> Iterator[SdoCase]:
    """What was recorded as it is, then so many with one answer changed by lot."""
    yield from recorded()
    random = Random(seed)
    for _ in range(count):
        request, steps, _ = random.choice(recorded())
        name, place = random.choice(list(CHANGES)), random.randrange(len(steps))
        changed = CHANGES[name](random, steps[place][0])
        yield SdoCase(request, (*steps[:place], changed, *steps[place + 1 :]), name)
