"""One FEETECH packet, made of bytes and taken apart again; what a register means is said elsewhere.

Instruction: FF FF | id | length | instruction | parameters | checksum.
Status:      FF FF | id | length | error       | parameters | checksum.
The length counts the parameters plus two, so a packet has length + 4 bytes; the checksum is the complement of
the sum of everything between header and checksum.

The decoders are lenient in what a packet says, for a simulator must see what others send, and strict in what
a packet is. Source: FEETECH serial bus servo protocol manual V1.01; 0x82, 0x0A and 0x0B are known from the
FEETECH SDK headers, 0x08, 0x09 and 0x0D from public analyses of the vendor's program.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.errors import ChecksumError, FramingError, WireError

HEADER: Final = b"\xff\xff"
MAX_ID: Final = 253
BROADCAST: Final = 254
MAX_LENGTH: Final = 255
"""The greatest length field: 259 bytes in all."""
VENDOR_MAX_LENGTH: Final = 246
"""The greatest length field the FEETECH SDKs send or take: 250 bytes in all."""
MAX_PARAMETERS: Final = MAX_LENGTH - 2
SOUND: Final = 0xFD
"""The last byte of the sum over a whole packet whose checksum is right, header and checksum included."""
OVERHEAD: Final = 6
"""Bytes of a packet besides its parameters."""
_BYTES: Final = tuple(bytes((value,)) for value in range(256))


class Instruction(IntEnum):
    """Every instruction code that is known of these servos, by the name used here."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    RESET = 0x06
    """Restore the factory values: "RESET" in the manual, "RECOVERY" in newer headers."""
    BOOTLOADER = 0x08
    UNKNOWN_09 = 0x09
    CLEAR_TURNS = 0x0A
    """Forget the turn count; newer FEETECH SDKs call this one "RESET"."""
    CALIBRATE = 0x0B
    UPGRADE = 0x0D
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


class InstructionPacket(NamedTuple):
    """What a host said: to which id, which instruction, with which parameters; `data` is the whole packet."""

    id: int
    instruction: int
    parameters: bytes
    data: bytes


class StatusPacket(NamedTuple):
    """What a servo answered: its id, its alarm bits, the parameters; `data` is the whole packet."""

    id: int
    error: int
    parameters: bytes
    data: bytes


class SyncWrite(NamedTuple):
    """Parameters of a SYNC WRITE: `length` bytes from `address` on for each (id, data) of `items`."""

    address: int
    length: int
    items: tuple[tuple[int, bytes], ...]


class SyncRead(NamedTuple):
    """Parameters of a SYNC READ: `length` bytes from `address` on, of each of `ids` in that order."""

    address: int
    length: int
    ids: tuple[int, ...]


class Rule(NamedTuple):
    """What an instruction needs.

    Fewest and most parameter bytes; may it go to one servo, to everyone (254); is it ever sent by us?
    """

    fewest: int
    most: int
    one: bool = True
    everyone: bool = False
    sent: bool = True


RULES: Final[Mapping[int, Rule]] = MappingProxyType(
    {
        Instruction.PING: Rule(0, 0),
        Instruction.READ: Rule(2, 2),
        Instruction.WRITE: Rule(2, MAX_PARAMETERS, everyone=True),
        Instruction.REG_WRITE: Rule(2, MAX_PARAMETERS, everyone=True),
        Instruction.ACTION: Rule(0, 0, everyone=True),
        Instruction.RESET: Rule(0, 0),
        Instruction.BOOTLOADER: Rule(0, 0, sent=False),
        Instruction.UNKNOWN_09: Rule(0, 0, sent=False),
        Instruction.CLEAR_TURNS: Rule(0, 0),
        Instruction.CALIBRATE: Rule(0, 2),
        Instruction.UPGRADE: Rule(0, 0, everyone=True, sent=False),
        Instruction.SYNC_READ: Rule(3, MAX_PARAMETERS, one=False, everyone=True),
        Instruction.SYNC_WRITE: Rule(4, MAX_PARAMETERS, one=False, everyone=True),
    }
)
_NAMES: Final = {
    Instruction.REG_WRITE: "REG WRITE",
    Instruction.RESET: "RESET (factory restore)",
    Instruction.BOOTLOADER: "enter bootloader (0x08)",
    Instruction.UNKNOWN_09: "unknown (0x09)",
    Instruction.CLEAR_TURNS: "CLEAR TURNS",
    Instruction.UPGRADE: "enter upgrade (0x0D)",
    Instruction.SYNC_READ: "SYNC READ",
    Instruction.SYNC_WRITE: "SYNC WRITE",
}


def instruction_name(code: int) -> str:
    """The name of an instruction code for people; "unknown (0x55)" for one that has none."""
    try:
        instruction = Instruction(code)
    except ValueError:
        return f"unknown (0x{code:02X})"
    return _NAMES.get(instruction, instruction.name)


def suits(instruction: int, parameters: bytes) -> bool:
    """Is the instruction known, and has it parameters it can be carried out with?"""
    rule = RULES.get(instruction)
    if rule is None or not rule.fewest <= len(parameters) <= rule.most:
        return False
    if instruction == Instruction.CALIBRATE:
        return len(parameters) != 1
    return instruction != Instruction.SYNC_WRITE or decode_sync_write(parameters) is not None


def checksum(body: bytes) -> int:
    """The checksum of a body: id, length, instruction or error, parameters."""
    return ~sum(body) & 0xFF


def frame(id: int, code: int, parameters: bytes = b"") -> bytes:
    """A packet of these fields, with no judgement at all: for simulators and tests, never for sending.

    `code` is an instruction or an error byte. Raises ValueError when a field does not fit its byte.
    """
    body = bytes((id, len(parameters) + 2, code)) + parameters
    return HEADER + body + _BYTES[~sum(body) & 0xFF]


def is_sound(data: bytes) -> bool:
    """Is the checksum of this whole packet right? The two header bytes are part of the sum used here."""
    return sum(data) & 0xFF == SOUND


def decode_status(data: bytes) -> StatusPacket:
    """Exactly one status packet. Raises FramingError or ChecksumError when it is none."""
    fault = fault_of(data, MAX_ID)
    if fault is not None:
        raise fault
    return StatusPacket(data[2], data[4], data[5:-1], data)


def decode_instruction(data: bytes) -> InstructionPacket:
    """Exactly one instruction packet. Raises FramingError or ChecksumError when it is none."""
    fault = fault_of(data, BROADCAST)
    if fault is not None:
        raise fault
    return InstructionPacket(data[2], data[4], data[5:-1], data)


def decode_sync_write(parameters: bytes) -> SyncWrite | None:
    """The parameters of a SYNC WRITE, or None when they are not whole items of at least one byte each."""
    if len(parameters) < 4 or not parameters[1] or (len(parameters) - 2) % (parameters[1] + 1):
        return None
    address, length = parameters[0], parameters[1]
    starts = range(2, len(parameters), length + 1)
    items = tuple((parameters[at], parameters[at + 1 : at + 1 + length]) for at in starts)
    return SyncWrite(address, length, items)


def decode_sync_read(parameters: bytes) -> SyncRead | None:
    """The parameters of a SYNC READ, or None when they name no servo."""
    if len(parameters) < 3:
        return None
    return SyncRead(parameters[0], parameters[1], tuple(parameters[2:]))


def fault_of(data: bytes, top: int) -> WireError | None:
    """Why these bytes are not exactly one packet with an id up to `top`, or None when they are one."""
    if data[:2] != HEADER:
        return FramingError("no FF FF at the beginning", received=data, expected="FF FF, then the id")
    if len(data) < OVERHEAD:
        return FramingError(f"only {len(data)} bytes", received=data, expected=f"at least {OVERHEAD} bytes")
    if data[2] > top:
        return FramingError(f"id {data[2]} is impossible here", received=data, expected=f"0 to {top}")
    if data[3] < 2:
        return FramingError(f"length {data[3]} is impossible", received=data, expected="2 to 255")
    if len(data) != data[3] + 4:
        return FramingError(
            f"length {data[3]} means {data[3] + 4} bytes but {len(data)} are there",
            received=data,
            expected=f"{data[3] + 4} bytes in all",
        )
    if not is_sound(data):
        right = checksum(data[2:-1])
        return ChecksumError(
            f"checksum {data[-1]:02X} is wrong", received=data, expected=f"{right:02X} as the last byte"
        )
    return None
