"""The flag `--faults` of a simulation: a script, a file with one, or a question what can be said there."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Final

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.errors import RequestError
from motorbus.simulation.faults import WORDS, Script, parse
from motorbus.simulation.faults.script import EXAMPLES, is_meant, requested

if TYPE_CHECKING:
    from motorbus.cli.output import Output

MOST: Final = 1 << 20
"""Bytes of a file with a script: some 40 000 faults, far more than a person or a run makes, and read in a second."""
PLACES = (
    (
        "exchange 17: …",
        "a packet: the first one in exchange 17; the host begins an exchange with all it sends",
    ),
    ("exchange 17 packet 2: …", "its second packet"),
    ("exchange 17 byte 3: …", "a byte of what goes to the host in exchange 17, counted from 0"),
    ("… to device: …", "of what goes to the device; `to host` is usual"),
    ("1%: …", "each packet, by chance"),
    ("1% of bytes: …", "each byte, by chance"),
    ("at 2.5 s: …", "the first packet from that moment on, or devices at that very moment"),
    ("… on adapter: …", "the text between an slcan adapter and its host"),
    ("seed 42", "what chance begins with"),
)
"""Where a fault can stand, and what that means."""


def from_option(said: str | None) -> Script:
    """What the flag says: a script, or the name of a file; None is none.

    Raises RequestError for neither, for one that is too long, and for a script without a fault.
    """
    if said is None:
        return Script()
    if _is_file(said):
        return _of_file(Path(said))
    if not said.strip():
        raise RequestError(
            "--faults: the text is empty",
            expected='a file, or a script as "exchange 17 byte 3: drop"',
            advice="leave --faults out where nothing is to go wrong",
        )
    if not is_meant(said):
        raise RequestError(
            f"--faults {said}: neither a file nor a script",
            expected='a file, or a script as "exchange 17 byte 3: drop"',
            advice="`--faults help` lists what can be said",
        )
    return requested(said)


def _of_file(file: Path) -> Script:
    text = _contents(file).decode("utf-8-sig", errors="replace")
    try:
        made = parse(text)
    except RequestError as error:
        if "\0" not in text and "\N{REPLACEMENT CHARACTER}" not in text:
            raise RequestError(
                f"--faults {file}: {error.summary}", expected=error.expected, cause=error.cause
            ) from None
        raise RequestError(
            f"--faults {file}: this is no text: {error.summary}",
            expected="a script, one fault a line, in UTF-8",
            advice="see that this is the file you mean; `--faults help` lists what can be said",
        ) from None
    if not made:
        raise RequestError(f"--faults {file}: there is no fault in it", expected=EXAMPLES)
    return made


def _is_file(said: str) -> bool:
    """A regular file: to open a device may move something."""
    try:
        mode = os.stat(said).st_mode
    except (OSError, ValueError):  # longer than any name, or with what no name can have
        return False
    return stat.S_ISREG(mode)


def _contents(file: Path) -> bytes:
    """The contents of a file with a script."""
    with usable(file, "read"), file.open("rb") as script:
        found = script.read(MOST + 1)
    if len(found) > MOST:
        raise RequestError(
            f"--faults {file}: a script has at most {MOST:,} bytes",
            expected="one fault a line",
            advice="faults without a place, as `1%: drop`, say more in fewer lines",
        )
    return found


def listed(output: Output) -> Exit:
    """Every word with what it takes and does, and every place."""
    rows = [
        {
            "fault": word.name,
            "takes": word.takes.value,
            "byte": word.byte,
            "packet": word.packet,
            "world": word.world,
        }
        for word in WORDS.values()
    ]
    places = [{"place": place, "meaning": meaning} for place, meaning in PLACES]
    output.document("motorbus.faults/1", {"faults": rows, "places": places})
    output.table("Where", ["place", "what it strikes"], [list(place) for place in PLACES])
    output.table(
        "What",
        ["fault", "takes", "at a byte", "to a packet, or to the bus"],
        [[word.name, word.takes.value, word.byte, word.packet] for word in WORDS.values()],
    )
    return Exit.OK
