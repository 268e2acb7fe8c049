"""The words of a fault script: what each of them does to bytes, to packets, or to the whole bus.

One table, so that what is parsed, what is carried out and what `--faults help` lists cannot drift apart. What a real
device does after one of these is not said here: where nobody knows, it is a switch of its family.
"""

from __future__ import annotations

from enum import Enum
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping


class Takes(Enum):
    """What stands behind a word. Its value is what the reader is told."""

    NOTHING = ""
    BITS = "the bits to turn over, in hex, 01 to FF"
    BIT = "a bit, 0 to 7"
    BYTE = "the byte in front, in hex, 00 to FF"
    SECONDS = "seconds, more than 0, a year at most"
    SPAN = "seconds, more than 0, a year at most, or two as 0.02-0.5 for anything between them"
    PERHAPS_SECONDS = "nothing, or seconds"
    PERHAPS_COUNT = "nothing, or how many bytes of it"
    NODE = "the id of a device"
    NODES = "the id of a device, or `all`"
    SECONDS_NODE = "seconds, more than 0, a year at most, and the id of a device, or none for all"


class Word(NamedTuple):
    """One word. `byte` and `packet` say what it does at a byte and to a packet, "" where it has no meaning.

    `world`  it happens to the bus or its devices and not to what is under way
    `outward`  it belongs to what the host sends, unless the script says otherwise
    """

    name: str
    takes: Takes
    byte: str
    packet: str
    world: bool = False

    @property
    def waits(self) -> bool:
        """It only lies in wait for what a device does later, so nothing that is under way is cut by it."""
        return self.name == "torn-eeprom"

    @property
    def outward(self) -> bool:
        """Whether it strikes what goes to the device when no side is named."""
        return self.world or self.name == "echo"


_AT = "it happens just before this byte; what comes before has arrived"
_WORDS: Final = (
    Word("drop", Takes.NOTHING, "the byte is lost", "the packet is lost"),
    Word("duplicate", Takes.NOTHING, "the byte comes twice", "the packet comes twice"),
    Word(
        "corrupt",
        Takes.BITS,
        "these bits of the byte are turned over",
        "one byte of it, by chance; a CAN frame is lost with an error frame",
    ),
    Word(
        "flip",
        Takes.BIT,
        "this bit of the byte is turned over, 0 being the lowest",
        "one bit of one byte, by chance; a CAN frame is lost with an error frame",
    ),
    Word(
        "insert",
        Takes.BYTE,
        "another byte comes in front; it may stand behind the last one",
        "somewhere in it, by chance; a CAN frame is lost with an error frame",
    ),
    Word(
        "truncate",
        Takes.NOTHING,
        "this byte and all that follow in this exchange are lost",
        "from a byte on, by chance",
    ),
    Word(
        "delay",
        Takes.SPAN,
        "this byte and all that follow in this exchange come so much later",
        "the packet comes so much later, and nothing that follows overtakes it",
    ),
    Word(
        "split",
        Takes.PERHAPS_SECONDS,
        "the packet is cut before this byte; the rest comes so much later (0.001 s)",
        "every byte comes by itself, each so much after the other (0.001 s); a CAN frame is never split",
    ),
    Word("echo", Takes.PERHAPS_COUNT, "", "the host hears what it has sent, all of it or its first bytes"),
    Word(
        "unplug",
        Takes.SECONDS,
        _AT,
        "the port is pulled and comes back after so long; what was under way is lost",
        world=True,
    ),
    Word(
        "power-cycle",
        Takes.NODES,
        _AT,
        "the supply goes and comes back at once: RAM and motion are lost",
        world=True,
    ),
    Word(
        "duplicate-id",
        Takes.NODE,
        _AT,
        "from now on a second device with this id is there, and answers too",
        world=True,
    ),
    Word(
        "brown-out",
        Takes.SECONDS_NODE,
        _AT,
        "the supply is too low for so long: the device is silent, then it starts anew",
        world=True,
    ),
    Word(
        "torn-eeprom",
        Takes.NODE,
        _AT,
        "the next thing that this device stores is cut by a power cut, in the middle of a step",
        world=True,
    ),
)

WORDS: Final[Mapping[str, Word]] = MappingProxyType({word.name: word for word in _WORDS})
"""Every word by its name, in the order in which they are listed."""
