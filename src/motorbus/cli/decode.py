"""`motorbus decode`: what every byte of a frame says, and why a bad frame is bad. Opens no port."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus import families
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from motorbus.core.family import Explanation

app = App(
    name="decode",
    usage="Usage: motorbus decode --family FAMILY [HEX...]",
    help_epilogue="""Bytes are hexadecimal, with or without spaces, commas, colons or 0x; without
any, they are read from stdin. Ends with exit code 1 if any frame is bad or any
byte belongs to none.

Examples:

    motorbus decode --family feetech FF FF 01 04 02 38 02 BE
    motorbus decode --family feetech ffff010402 3802be ffff0104001805dd
    motorbus decode --family feetech --json < capture.txt""",
)


@app.default
def decode(
    *data: Annotated[str, Parameter(name="HEX")],
    family: str,
    output: Annotated[Output, Parameter(parse=False)],
) -> Exit:
    """Explain the bytes of frames, and why a bad one is bad.

    Parameters
    ----------
    data
        Bytes in hexadecimal; stdin when there are none.
    family
        Whose protocol it is.
    """
    explained = families.load(family).explain(_bytes(" ".join(data) or sys.stdin.read()))
    output.document("motorbus.decode/1", {"family": family, "frames": [_facts(one) for one in explained]})
    for one in explained:
        _show(one, output)
    return Exit.FAILURE if any(one.fault for one in explained) else Exit.OK


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


def _facts(one: Explanation) -> dict[str, object]:
    parts = [
        {"start": part.start, "data": part.data.hex(" ").upper(), "name": part.name, "meaning": part.meaning}
        for part in one.parts
    ]
    return {
        "data": one.data.hex(" ").upper(),
        "title": one.title,
        "valid": not one.fault,
        "fault": one.fault,
        "parts": parts,
    }


def _show(one: Explanation, output: Output) -> None:
    verdict = f"BAD: {one.fault}" if one.fault else "good"
    rows: Iterable[tuple[object, ...]] = (
        (part.start, part.data.hex(" ").upper(), part.name, part.meaning) for part in one.parts
    )
    output.text(f"{one.data.hex(' ').upper()}\n{one.title}: {verdict}")
    if one.parts:
        output.table("", [">byte", "data", "field", "meaning"], rows)
    output.text("")
