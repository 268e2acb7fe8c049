"""The flag `--faults` of a simulation: a script, a file with one, or a question what can be said there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.errors import RequestError
from motorbus.simulation.faults import WORDS, Script
from motorbus.simulation.faults.script import meant

if TYPE_CHECKING:
    from motorbus.cli.output import Output

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
    ("… on adapter: …", "the text between a CAN adapter (slcan, socketcand) and its host"),
    ("seed 42", "what chance begins with"),
)
"""Where a fault can stand, and what that means."""


def script_of(said: str | None) -> Script:
    """What the flag says: a script, or the name of a file that is there; None is none.

    Raises RequestError for neither, and for a script without a fault: its user believes that one is at work.
    """
    if said is None:
        return Script()
    if _is_file(said):
        with usable(Path(said), "read"):
            said = Path(said).read_bytes().decode("utf-8-sig", errors="replace")
    elif ":" not in said:
        raise RequestError(
            f"--faults {said}: neither a file nor a script",
            expected='a file, or a script as "exchange 17 byte 3: drop"',
            advice="`--faults help` lists what can be said",
        )
    return meant(said or "#")  # a file with nothing in it is no "none"


def _is_file(said: str) -> bool:
    try:
        return Path(said).is_file()
    except (OSError, ValueError):  # longer than any name, or with what no name can have
        return False


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
