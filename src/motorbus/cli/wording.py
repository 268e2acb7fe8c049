"""Errors name what a program would call; in a shell there is a command for it, and that is what is said here."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from motorbus.cli import faces
from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.core.family import Family

COMMANDS: Final[Mapping[str, str]] = {
    "stop()": "`motorbus stop`",
    "identify()": "`motorbus info`",
    "read()": "`motorbus read`",
    "write()": "`motorbus write`",
    "write(": "`motorbus write BUS#ID {}`",
    "enable_torque()": "`motorbus torque on`",
    "disable_torque()": "`motorbus torque off`",
    "set_id()": "`motorbus set-id`",
    "set_baud()": "`motorbus set-baud`",
    "recover()": "`motorbus recover BUS`",
    "speed=0.5": "`--speed 50%`",
    "smoothed(5)": "`--smooth 5`",
}
"""What a program would call -> what says the same in a shell; `name(` stands for any arguments, which `{}` gets."""
PHRASES: Final[Mapping[str, str]] = {
    "see to it, then reset the fault": "see to it, then give the order again",
    "call reset() on the bus, in the process that owns it": "give the command again, for the stop has ended this one",
    "whose device has train": "whose device can be led in a loop",
    "whose device has disable torque": "whose device can be let go",
    "limp=False writes": "`--no-limp` writes",
}
"""What only a program that goes on can do -> what comes to the same where the program has ended."""
_BUS: Final = re.compile(r"(`motorbus [^`\[]*?\b)BUS(?!#\D|\w)")
_CALL: Final = re.compile(r"\b([a-z_]+\()([^()]*)\)|\b[a-z_]+=True\b|\b[a-z_]+=\([^()]*\)")
_FAULT: Final = re.compile(r"robot\.clear_fault\([^()]*\)(, or open the machine anew)?")
"""A fault lives in one process: in a shell there is nothing to clear, for it has ended with the command."""
_PARTS: Final = ("summary", "expected", "cause", "advice")


def in_words_of_the_shell(error: BaseException, family: Family | None = None, bus: str = "") -> None:
    """Name commands where this error and its notes name methods; what has no command stays as it is.

    Where those commands want a `bus`, it is this one: its address, or its name.
    """
    for part in _PARTS if isinstance(error, MotorbusError) else ():
        setattr(error, part, shell_words(getattr(error, part), family, bus))
    notes = getattr(error, "__notes__", None)
    if notes:
        notes[:] = [shell_words(note, family, bus) for note in notes]


def shell_words(text: str, family: Family | None = None, bus: str = "") -> str:
    """A text that names methods, with commands in their place, for this bus where there is one."""
    for phrase, instead in PHRASES.items():
        text = text.replace(phrase, instead)
    text = _FAULT.sub("give the order again", text)
    own = faces.offer(family.name, "COMMANDS") if family is not None else None
    words: dict[str, str] = {**COMMANDS, **(own or {})}

    def said(call: re.Match[str]) -> str:
        return words.get(call[0]) or words.get(call[1] or "", call[0]).format(call[2])

    found = _CALL.sub(said, text)
    return _BUS.sub(lambda hint: hint[1] + bus, found) if bus else found
