"""`motorbus decode`: explain the bytes of frames. Opens no port."""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from msgspec import Struct

from motorbus import families
from motorbus.cli.common import Common, Exit
from motorbus.cli.output import emit, escape
from motorbus.cli.target import bus_address, key_values
from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.family import Explanation
from motorbus.core.recording import ABSENT
from motorbus.errors import RequestError
from motorbus.recorder import Decoder, can_log
from motorbus.recorder.files import from_text, read_bytes

if TYPE_CHECKING:
    from motorbus.core.family import BusDriver, Family
    from motorbus.recorder.can_log import Logged

LONGEST: Final = 1 << 25  # characters on stdin
CHUNK: Final = 1 << 14  # bytes that are counted at a time
HEAD: Final = 5  # bytes before the data of a CAN frame, see `CanFrame.flat`


class Field(Struct, frozen=True):
    """A field of a frame: its offset, bytes, name and meaning."""

    start: int
    data: str
    name: str
    meaning: str


class Frame(Struct, frozen=True, tag="frame"):
    """A frame, or bytes that are none (`fault` says why); `start` counts bytes, or frames on CAN."""

    start: int
    data: str
    title: str
    fault: str
    fields: list[Field]
    time: float | None = None  # s, since 1970 if it is above 1e8
    direction: str = ""
    channel: str = ""  # as in the log


class Group(Struct, frozen=True):
    """The packets of one kind, node, code and fault: how many, and their bytes."""

    kind: str
    node: int | None
    code: str
    packets: int
    bytes: int


class Summary(Struct, frozen=True, tag="summary"):
    """The packets of a recording, noise last."""

    groups: list[Group]
    packets: int
    noise_bytes: int
    damaged_lines: int = 0


def decode(
    *data: Annotated[str, Parameter(name="HEX")],
    family: Annotated[str, Parameter(help="Protocol: feetech, kst or stepper; else that of --bus.")] = "",
    file: Annotated[Path | None, Parameter(help="Recording: .bin .hex .txt, or a CAN log.")] = None,
    summary: Annotated[bool, Parameter(help="Count the frames.")] = False,
    common: Common = Common(),
) -> int:
    """Explain the bytes of frames, and why a bad one is bad; without HEX those of stdin.

    Examples:

        motorbus decode --family feetech FF FF 01 04 02 38 02 BE
        motorbus decode --family kst --file trace.asc --summary
        motorbus decode --family kst --json < candump.log

    CAN frames are ID#DATA; CAN logs are candump, ASC, BLF, TRC. Exit code 1: noise.
    """
    if file is not None and data:
        raise RequestError("bytes and --file", expected="one of them")
    if not (family or common.bus):
        raise RequestError("no protocol", expected="--family feetech, kst or stepper")
    found = families.load(family or bus_address("", common).partition(":")[0])
    source = _can_lines(data, file) if found.link.kind == "frames" else _read_serial(data, file)
    if summary:
        return _summarize(found, source, common)
    frame = None
    is_bad = False
    for frame in _frames(found.open(**key_values(common)), source):
        if common.json:
            emit(frame, common)
        else:
            _print(frame)
        is_bad = is_bad or bool(frame.fault)
    if frame is None:
        raise RequestError("no frames to decode", expected="ID#DATA, the text of candump, or a CAN log")
    return Exit.FAILURE if is_bad else Exit.OK


def _read_serial(texts: Sequence[str], file: Path | None) -> bytes:
    if file is not None:
        found = read_bytes(file)
    else:
        text = " ".join(texts) or sys.stdin.read(LONGEST + 1)
        if len(text) > LONGEST:
            raise RequestError(f"more than {LONGEST:,} characters on stdin", advice="use --file")
        found = from_text(text)
    if not found:
        raise RequestError("no bytes to decode")
    return found


def _can_lines(texts: Sequence[str], file: Path | None) -> Iterator[Logged]:
    """The frames of arguments, of a log, or of the lines on stdin as they come."""
    if file is not None:
        yield from can_log.read_log(file)
    elif texts:
        for text in [" ".join(texts)] if set("([") & set(texts[0]) else texts:
            if (one := can_log.parse_line(text)) is not None:
                yield one
    else:
        yield from can_log.read_lines(sys.stdin)


# -- frames --------------------------------------------------------------------------------------------------------


def _frames(driver: BusDriver, source: bytes | Iterator[Logged]) -> Iterator[Frame]:
    if isinstance(source, bytes):
        start = 0
        for one in driver.decode(source):
            yield Frame(start, one.data.hex(" ").upper(), one.title, one.fault, _fields(one))
            start += len(one.data)
        return
    for number, logged in enumerate(source):
        if logged.frame is None:
            title = f"line {logged.line}" if logged.line else f"CAN frame {logged.text}"
            found = [Explanation(b"", title, (), logged.fault)]
        else:
            found = list(driver.decode(logged.frame.flat()))
        for one in found:
            data = _candump(one.data)
            where = (logged.at, logged.direction, logged.channel)
            yield Frame(number, data, one.title, one.fault, _fields(one), *where)


def _fields(one: Explanation) -> list[Field]:
    return [Field(part.start, part.data.hex(" ").upper(), part.name, part.meaning) for part in one.parts]


def _candump(data: bytes) -> str:
    """A CAN frame as candump writes it."""
    if len(data) < HEAD:
        return data.hex(" ").upper()
    head = int.from_bytes(data[:4], "big")
    width = 8 if head >> 31 or head & ERROR_FLAG else 3
    identifier = head & ~(1 << 31) & ~REMOTE_FLAG
    return f"{identifier:0{width}X}#{'R' if head & REMOTE_FLAG else data[HEAD:].hex().upper()}"


def _print(frame: Frame) -> None:
    where = f"at {frame.start}" if frame.time is None else f"{frame.time:.6f} s"
    print(" ".join(filter(None, (where, escape(frame.channel), frame.direction, escape(frame.data)))))
    print(f"{escape(frame.title)}: {f'BAD: {frame.fault}' if frame.fault else 'good'}")
    for field in frame.fields:
        print(f"  {field.start:3}  {field.data:<12} {field.name:<14} {escape(field.meaning)}")
    print(flush=True)


# -- summary -------------------------------------------------------------------------------------------------------


def _summarize(family: Family, source: bytes | Iterator[Logged], common: Common) -> int:
    decoder, damaged = Decoder(family), 0
    chunks: Iterable[bytes | CanFrame]
    if isinstance(source, bytes):
        chunks = [source[start : start + CHUNK] for start in range(0, len(source), CHUNK)]
    else:
        logged = list(source)
        damaged = sum(bool(one.line) for one in logged)
        chunks = [one.frame or CanFrame(REMOTE_FLAG, b"") for one in logged if not one.line]
    packets = [*chain.from_iterable(map(decoder.feed, chunks)), *decoder.flush()]
    if not packets and not damaged:
        raise RequestError("no frames to count")
    sizes: defaultdict[tuple[str, str, int, int], list[int]] = defaultdict(list)
    for one in packets:
        sizes[one.fault, one.kind, one.node, one.code].append(len(one.data))
    groups = [
        Group(
            kind + (f": {fault}" if fault else ""),
            None if node == ABSENT else node,
            "" if code == ABSENT else f"0x{code:02X}",
            len(found),
            sum(found),
        )
        for (fault, kind, node, code), found in sorted(sizes.items())
    ]
    noise = sum(sum(found) for (fault, *_), found in sizes.items() if fault)
    emit(Summary(groups, len(packets), noise, damaged), common)
    return Exit.FAILURE if noise or damaged else Exit.OK
