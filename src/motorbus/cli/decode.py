"""`motorbus decode`: what every byte of a frame says, and why a bad frame is bad. Opens no port."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, Parameter

from motorbus import families
from motorbus.cli import frame
from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.output import Output
from motorbus.cli.target import said
from motorbus.core.can_frame import REMOTE_FLAG, CanFrame
from motorbus.core.family import Explanation
from motorbus.errors import RequestError
from motorbus.recorder import can_log
from motorbus.recorder.files import from_hex, read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from motorbus.core.family import BusDriver, Family
    from motorbus.recorder.can_log import Logged

MOST = 1 << 25
"""Characters of hexadecimal on stdin: 16 MiB of bytes without spaces, which are explained as a whole."""

app = App(
    name="decode",
    usage="Usage: motorbus decode --family FAMILY [HEX...] [OPTIONS]",
    help_epilogue="""Bytes are hexadecimal, with or without spaces, commas, colons or 0x; without
any, they are read from stdin. A CAN frame is written as candump writes it:
IDENTIFIER#DATA, 3 digits for 11 bits, 8 for 29, #R for a remote frame. The
text of candump on stdin is explained as it comes. --file reads a recording:
of a serial line .bin and .raw (bytes), .hex and .txt (hexadecimal); of a CAN
bus the text of candump (.log, .candump, .txt or no ending), and ASC, BLF and
TRC files (with python-can). A line that is damaged is told and passed.
Recordings give JSON Lines with --json, each with its start, in bytes or
frames. Times that count from the beginning of a recording are shown with a +.
--summary counts instead of explaining, quickly where numpy is installed. Ends
with exit code 1 if any frame is bad or any byte belongs to none.

Examples:

    motorbus decode --family feetech FF FF 01 04 02 38 02 BE
    motorbus decode --family feetech ffff010402 3802be ffff0104001805dd
    motorbus decode --family feetech --json < capture.txt
    motorbus decode --family kst 625#2203600084030000 5A5#6003600000000000
    motorbus decode --family feetech --file line.bin
    motorbus decode --family feetech --summary --direction rx --file in.bin
    motorbus decode --family kst --file trace.asc
    candump -L can0 | motorbus decode --family kst --json""",
)


@app.default
def decode(
    *data: Annotated[str, Parameter(name="HEX")],
    family: str,
    file: Path | None = None,
    summary: Annotated[bool, Parameter(negative="")] = False,
    direction: Literal["rx", "tx"] | None = None,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Explain the bytes of frames, and why a bad one is bad.

    Parameters
    ----------
    data
        Bytes in hexadecimal, or CAN frames as candump writes them; stdin when there are none.
    family
        Whose protocol it is.
    file
        A recording: .bin, .raw, .hex, .txt of a line; .log, .candump, .txt, .asc, .blf, .trc of a CAN bus
    summary
        Count the packets of each kind, node and code, and the noise, instead of explaining each.
    direction
        All bytes went this way, rx from the devices or tx to them; with --summary.
    options
        How such a bus is spoken to, as --profile xqpower.
    """
    found = _open(families.load(family), options)
    if file is not None and data:
        raise RequestError("bytes and --file: one of them", advice="decode them one after the other")
    if direction is not None and not summary:
        raise RequestError("--direction goes with --summary", advice="without it each frame tells its own")
    if summary:
        return _summary(data, file, found, direction or "", output)
    if file is not None:
        return _file(file, found, output)
    if data:
        return _bytes_or_frames(data, found, output)
    first = sys.stdin.readline(can_log.LONGEST) if found.family.link.kind == "frames" else ""
    if can_log.looks_like_can(first):
        lines = chain([first], can_log.lines_of(sys.stdin))
        return _stream(_on_can(found, can_log.read_lines(lines)), found, output)
    return _document(found.decode(_bytes(first + _piped())), found, output)


def _file(file: Path, driver: BusDriver, output: Output) -> Exit:
    if _is_serial(file, driver):
        return _told(((one, {}, None) for one in driver.decode(_serial(file))), driver, output)
    return _stream(_on_can(driver, _recorded(file)), driver, output)


def _piped() -> str:
    """All that stands on stdin, which may be without end."""
    text = sys.stdin.read(MOST + 1)
    if len(text) > MOST:
        raise RequestError(
            f"more than {MOST:,} characters on stdin", advice="keep them in a file, and decode it with --file"
        )
    return text


def _is_serial(file: Path, driver: BusDriver) -> bool:
    return driver.family.link.kind == "bytes" and not can_log.is_log(file)


def _serial(file: Path) -> bytes:
    with usable(file, "read"):
        return read_bytes(file)


def _summary(
    data: Sequence[str], file: Path | None, driver: BusDriver, direction: str, output: Output
) -> Exit:
    from motorbus.cli.counted import summary

    if file is not None and _is_serial(file, driver):
        return summary(driver.family, _serial(file), direction, output)
    if driver.family.link.kind == "bytes" and file is None:
        return summary(driver.family, _bytes(" ".join(data) or _piped()), direction, output)
    if file is not None:
        logged = _recorded(file)
    elif data:
        logged = _typed(data)
    else:
        logged = can_log.read_lines(_words(can_log.lines_of(sys.stdin)))
    found = list(_on_can(driver, logged))
    damaged = [one for one in found if one.line]
    return summary(
        driver.family, [_classic(one) for one in found if not one.line], direction, output, damaged
    )


def _classic(one: Logged) -> CanFrame:
    """The frame; one that is no classic CAN frame is nobody's, as is any other that nobody understands."""
    return one.frame if one.frame is not None else CanFrame(REMOTE_FLAG, b"")


def _recorded(file: Path) -> Iterator[Logged]:
    with usable(file, "read"):
        yield from can_log.read_log(file)


def _open(family: Family, options: Mapping[str, str]) -> BusDriver:
    settings = said(options)
    known = {option.name for option in family.link.settings}
    if unknown := sorted(settings.keys() - known):
        there = ", ".join(f"--{name.replace('_', '-')}" for name in sorted(known)) or "none"
        raise RequestError(f"--{unknown[0]}: {family.name} has no such option", expected=there)
    return family.open(**settings)


def _bytes_or_frames(texts: Sequence[str], driver: BusDriver, output: Output) -> Exit:
    if not can_log.looks_like_can(" ".join(texts)):
        return _document(driver.decode(_bytes(" ".join(texts))), driver, output)
    frames = [_explained(one, driver) for one in list(_on_can(driver, _typed(texts)))]
    return _document(list(chain.from_iterable(frames)), driver, output)


def _typed(texts: Sequence[str]) -> Iterator[Logged]:
    """What somebody has typed is a question, not a recording: what is no frame in it is refused."""
    return (one for line in _words(texts) if (one := can_log.parse_line(line)))


def _words(texts: Iterable[str]) -> Iterator[str]:
    """A line of candump as it is, else each frame by itself."""
    return chain.from_iterable([text] if set("([") & set(text) else text.split() for text in texts)


def _on_can(driver: BusDriver, logged: Iterable[Logged]) -> Iterable[Logged]:
    if driver.family.link.kind != "frames":
        raise RequestError(
            f"{driver.family.name} devices are on no CAN bus",
            expected="bytes in hexadecimal, as FF FF 01 02 01 FB",
        )
    return logged


def _explained(one: Logged, driver: BusDriver) -> list[Explanation]:
    if one.line:
        return [Explanation(b"", f"line {one.line}", (), one.fault)]
    if one.frame is None:
        return [Explanation(b"", f"CAN frame {one.text}", (), one.fault)]
    return driver.decode(one.frame.flat())


def _bytes(text: str) -> bytes:
    found = from_hex(text)
    if not found:
        raise RequestError("there are no bytes to decode", advice="give them as arguments or on stdin")
    return found


def _document(explained: list[Explanation], driver: BusDriver, output: Output) -> Exit:
    frames = [_facts(one, driver) for one in explained]
    output.document("motorbus.decode/1", {"family": driver.family.name, "frames": frames})
    for one in explained:
        _show(one, driver, output)
    return Exit.FAILURE if any(one.fault for one in explained) else Exit.OK


def _stream(logged: Iterable[Logged], driver: BusDriver, output: Output) -> Exit:
    """Each frame as soon as it is read, with the time and the direction that were noted with it."""
    return _told(
        (
            (one, {"time": recorded.at, "relative": recorded.relative, "direction": recorded.direction or None},
             _when(recorded))
            for recorded in logged
            for one in _explained(recorded, driver)
        ),
        driver,
        output,
    )  # fmt: skip


def _told(
    explained: Iterable[tuple[Explanation, Mapping[str, object], str | None]],
    driver: BusDriver,
    output: Output,
) -> Exit:
    """A recording, frame by frame, each with what was noted with it, as facts and in words."""
    bad, start = False, 0
    for one, noted, when in explained:
        bad = bad or bool(one.fault)
        facts = {"family": driver.family.name, "start": start, **noted, **_facts(one, driver)}
        output.document("motorbus.decode.frame/1", facts)
        _show(one, driver, output, f"at byte {start}" if when is None else when)
        start += 1 if driver.family.link.kind == "frames" else len(one.data)
    if not start:
        raise RequestError(
            f"there are no {driver.family.link.kind} to decode",
            expected="the bytes of a serial line, the text of candump, or a log of CAN frames",
        )
    return Exit.FAILURE if bad else Exit.OK


def _when(recorded: Logged) -> str:
    return " ".join(filter(None, (_time(recorded), recorded.channel, recorded.direction)))


def _time(recorded: Logged) -> str:
    if recorded.at is None:
        return ""
    if recorded.relative:
        return f"+{recorded.at:.6f} s"
    return datetime.fromtimestamp(recorded.at, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


def _facts(one: Explanation, driver: BusDriver) -> dict[str, object]:
    parts = [
        {"start": part.start, "data": part.data.hex(" ").upper(), "name": part.name, "meaning": part.meaning}
        for part in one.parts
    ]
    return {
        **frame.facts(one.data, driver.family),
        "title": one.title,
        "valid": not one.fault,
        "fault": one.fault,
        "parts": parts,
    }


def _show(one: Explanation, driver: BusDriver, output: Output, when: str = "") -> None:
    verdict = f"BAD: {one.fault}" if one.fault else "good"
    rows: Iterable[tuple[object, ...]] = (
        (part.start, part.data.hex(" ").upper(), part.name, part.meaning) for part in one.parts
    )
    head = [when, frame.shown(one.data, driver.family), f"{one.title}: {verdict}"]
    output.text("\n".join(filter(None, head)))
    if one.parts:
        output.table("", [">byte", "data", "field", "meaning"], rows)
    output.text("")
