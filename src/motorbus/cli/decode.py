"""`motorbus decode`: what every byte of a frame says, and why a bad frame is bad. Opens no port."""

from __future__ import annotations

import re
import sys
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus import families
from motorbus.cli import frame
from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.output import Output
from motorbus.cli.target import said
from motorbus.core.family import Explanation
from motorbus.errors import RequestError
from motorbus.link import can_log

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from motorbus.core.family import Family
    from motorbus.link.can_log import Logged

app = App(
    name="decode",
    usage="Usage: motorbus decode --family FAMILY [HEX...] [OPTIONS]",
    help_epilogue="""Bytes are hexadecimal, with or without spaces, commas, colons or 0x; without
any, they are read from stdin. A CAN frame is written as candump writes it:
IDENTIFIER#DATA, 3 digits for 11 bits, 8 for 29, #R for a remote frame. The
text of candump on stdin is explained as it comes, and --file reads its logs,
and ASC, BLF and TRC files (with python-can); both give JSON Lines with --json.
Times that count from the beginning of a recording are shown with a +. Ends
with exit code 1 if any frame is bad or any byte belongs to none.

Examples:

    motorbus decode --family feetech FF FF 01 04 02 38 02 BE
    motorbus decode --family feetech ffff010402 3802be ffff0104001805dd
    motorbus decode --family feetech --json < capture.txt
    motorbus decode --family kst 625#2203600084030000 5A5#6003600000000000
    motorbus decode --family kst --file trace.asc
    candump -L can0 | motorbus decode --family kst --json""",
)


@app.default
def decode(
    *data: Annotated[str, Parameter(name="HEX")],
    family: str,
    file: Path | None = None,
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
        A recording of CAN frames, by its ending: .log, .asc, .blf, .trc
    options
        How such a bus is spoken to, as --profile xqpower.
    """
    found = _spoken(families.load(family), options)
    if file is not None:
        if data:
            raise RequestError("bytes and --file: one of them", advice="decode them one after the other")
        return _stream(_on_can(found, _recorded(file)), found, output)
    if data:
        return _bytes_or_frames(data, found, output)
    first = sys.stdin.readline() if found.link.kind == "frames" else ""
    if can_log.looks_like_can(first):
        return _stream(_on_can(found, can_log.read_lines(chain([first], sys.stdin))), found, output)
    return _document(found.explain(_bytes(first + sys.stdin.read())), found, output)


def _recorded(file: Path) -> Iterator[Logged]:
    with usable(file, "read"):
        yield from can_log.read_log(file)


def _spoken(family: Family, options: Mapping[str, str]) -> Family:
    settings = said(options)
    known = {option.name for option in family.link.settings}
    if unknown := sorted(settings.keys() - known):
        there = ", ".join(f"--{name.replace('_', '-')}" for name in sorted(known)) or "none"
        raise RequestError(f"--{unknown[0]}: {family.name} has no such option", expected=there)
    return family.configured(**settings)


def _bytes_or_frames(texts: Sequence[str], family: Family, output: Output) -> Exit:
    if not can_log.looks_like_can(" ".join(texts)):
        return _document(family.explain(_bytes(" ".join(texts))), family, output)
    lines = chain.from_iterable([text] if set("([") & set(text) else text.split() for text in texts)
    logged = [one for line in lines if (one := can_log.parse_line(line))]
    frames = [_explained(one, family) for one in _on_can(family, logged)]
    return _document(list(chain.from_iterable(frames)), family, output)


def _on_can(family: Family, logged: Iterable[Logged]) -> Iterable[Logged]:
    if family.link.kind != "frames":
        raise RequestError(
            f"{family.name} devices are on no CAN bus", expected="bytes in hexadecimal, as FF FF 01 02 01 FB"
        )
    return logged


def _explained(one: Logged, family: Family) -> list[Explanation]:
    if one.frame is None:
        return [Explanation(b"", f"CAN frame {one.text}", (), one.fault)]
    return family.explain(one.frame.flat())


def _bytes(text: str) -> bytes:
    digits = re.sub(r"0[xX]|[\s,:;]", "", text)
    try:
        found = bytes.fromhex(digits)
    except ValueError:
        raise RequestError(
            "these are not bytes in hexadecimal", sent=text.strip()[:60], expected="pairs of 0-9 A-F"
        ) from None
    if not found:
        raise RequestError("there are no bytes to decode", advice="give them as arguments or on stdin")
    return found


def _document(explained: list[Explanation], family: Family, output: Output) -> Exit:
    frames = [_facts(one, family) for one in explained]
    output.document("motorbus.decode/1", {"family": family.name, "frames": frames})
    for one in explained:
        _show(one, family, output)
    return Exit.FAILURE if any(one.fault for one in explained) else Exit.OK


def _stream(logged: Iterable[Logged], family: Family, output: Output) -> Exit:
    """Each frame as soon as it is read, with the time and the direction that were noted with it."""
    bad, empty = False, True
    for recorded in logged:
        empty = False
        when = {"time": recorded.at, "relative": recorded.relative, "direction": recorded.direction or None}
        for one in _explained(recorded, family):
            bad = bad or bool(one.fault)
            output.document("motorbus.decode.frame/1", {"family": family.name, **when, **_facts(one, family)})
            _show(one, family, output, _when(recorded))
    if empty:
        raise RequestError(
            "there are no frames to decode", expected="the text of candump, or a log of CAN frames"
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


def _facts(one: Explanation, family: Family) -> dict[str, object]:
    parts = [
        {"start": part.start, "data": part.data.hex(" ").upper(), "name": part.name, "meaning": part.meaning}
        for part in one.parts
    ]
    return {
        **frame.facts(one.data, family),
        "title": one.title,
        "valid": not one.fault,
        "fault": one.fault,
        "parts": parts,
    }


def _show(one: Explanation, family: Family, output: Output, when: str = "") -> None:
    verdict = f"BAD: {one.fault}" if one.fault else "good"
    rows: Iterable[tuple[object, ...]] = (
        (part.start, part.data.hex(" ").upper(), part.name, part.meaning) for part in one.parts
    )
    head = [when, frame.shown(one.data, family), f"{one.title}: {verdict}"]
    output.text("\n".join(filter(None, head)))
    if one.parts:
        output.table("", [">byte", "data", "field", "meaning"], rows)
    output.text("")
