"""FEETECH packets: instructions to servos, their status packets, and how both are found in a stream of bytes.

    instruction   FF FF, id, length, instruction, parameters, checksum
    status        FF FF, id, length, error, parameters, checksum

The length counts the parameters plus two, so a packet has length + 4 bytes. The checksum is the complement of the sum
of all bytes between header and checksum. There is no byte stuffing: FF FF alone does not prove that a packet begins.

`frame` makes any packet, for simulators and tests. All other encoders obey `RULES` and raise RequestError for what no
servo can carry out, what only does harm, and what has an unknown effect.
Source: FEETECH serial bus servo protocol manual V1.01; 0x82, 0x0A and 0x0B: FEETECH SDK headers; 0x08, 0x09 and 0x0D:
public analyses of the vendor's program.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from motorbus.core.framing import FrameParser, FrameReceiver
from motorbus.errors import RequestError

HEADER: Final = b"\xff\xff"
MAX_ID: Final = 253
BROADCAST: Final = 254
OVERHEAD: Final = 6  # bytes of a packet besides its parameters
MAX_LENGTH: Final = 255  # of the length field; 259 bytes in all
MAX_PARAMETERS: Final = MAX_LENGTH - 2


class Instruction(IntEnum):
    """All known instruction codes."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    RESET = 0x06  # restore factory values; "RECOVERY" in newer headers
    BOOTLOADER = 0x08
    UNKNOWN_09 = 0x09
    CLEAR_TURNS = 0x0A  # "RESET" in newer FEETECH SDKs
    CALIBRATE = 0x0B
    UPGRADE = 0x0D
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


class Rule(NamedTuple):
    """Number of parameter bytes of an instruction, and its receivers; without a receiver it is never sent."""

    fewest: int
    most: int
    one: bool = False
    all: bool = False


RULES: Final[Mapping[int, Rule]] = {
    Instruction.PING: Rule(0, 0, one=True, all=True),
    Instruction.READ: Rule(2, 2, one=True),
    Instruction.WRITE: Rule(2, MAX_PARAMETERS, one=True, all=True),
    Instruction.REG_WRITE: Rule(2, MAX_PARAMETERS, one=True, all=True),
    Instruction.ACTION: Rule(0, 0, one=True, all=True),
    Instruction.RESET: Rule(0, 0, one=True),
    Instruction.BOOTLOADER: Rule(0, 0),
    Instruction.UNKNOWN_09: Rule(0, 0),
    Instruction.CLEAR_TURNS: Rule(0, 0, one=True),
    Instruction.CALIBRATE: Rule(0, 2, one=True),
    Instruction.UPGRADE: Rule(0, 0),
    Instruction.SYNC_READ: Rule(3, MAX_PARAMETERS, all=True),
    Instruction.SYNC_WRITE: Rule(4, MAX_PARAMETERS, all=True),
}
_NAMES: Final = {
    Instruction.RESET: "RESET (factory restore)",
    Instruction.BOOTLOADER: "enter bootloader (0x08)",
    Instruction.UNKNOWN_09: "unknown (0x09)",
    Instruction.UPGRADE: "enter upgrade (0x0D)",
}


class Packet(NamedTuple):
    """A valid packet; `code` is the instruction or the error byte."""

    id: int
    code: int
    parameters: bytes


class SyncWrite(NamedTuple):
    """Parameters of a SYNC WRITE: `length` bytes from `address` on for each (id, data) of `items`."""

    address: int
    length: int
    items: tuple[tuple[int, bytes], ...]


# -- encoders --------------------------------------------------------------------------------------------------


def checksum(body: bytes) -> int:
    """The checksum of a body: id, length, instruction or error, parameters."""
    return ~sum(body) & 0xFF


def frame(id: int, code: int, parameters: bytes = b"") -> bytes:
    """A packet of these fields, whatever they are; `code` is an instruction or an error byte."""
    body = bytes((id, len(parameters) + 2, code)) + parameters
    return HEADER + body + bytes((checksum(body),))


def instruction(id: int, code: int, parameters: bytes = b"") -> bytes:
    """An instruction packet that obeys `RULES`."""
    rule = RULES.get(code, Rule(0, 0))
    if suits(code, parameters) and (rule.all if id == BROADCAST else rule.one and 0 <= id <= MAX_ID):
        return frame(id, code, parameters)
    name = instruction_name(code)
    if not (rule.one or rule.all):
        raise RequestError(f"{name} is never sent", cause="it may leave the servo without its program")
    if suits(code, parameters):
        ids = [f"0 to {MAX_ID}"] * rule.one + [f"{BROADCAST} for all servos"] * rule.all
        raise RequestError(f"{name} cannot be sent to id {id}", expected=" or ".join(ids))
    raise RequestError(
        f"{name} with {len(parameters)} parameter bytes is impossible",
        expected=f"{rule.fewest} to {rule.most} bytes",
    )


def ping(id: int) -> bytes:
    """PING: is it there, and which alarms are set? The replies to a broadcast (254) may collide."""
    return instruction(id, Instruction.PING)


def read(id: int, address: int, count: int) -> bytes:
    """READ `count` bytes (1 to 253) from `address` on, of one servo."""
    _check_span(address, count)
    return instruction(id, Instruction.READ, bytes((address, count)))


def write(id: int, address: int, data: bytes) -> bytes:
    """WRITE at least one byte from `address` on; a broadcast (254) is not answered."""
    _check_span(address, len(data))
    return instruction(id, Instruction.WRITE, bytes((address,)) + data)


def reg_write(id: int, address: int, data: bytes) -> bytes:
    """REG WRITE: a WRITE that the servo carries out at the next ACTION."""
    _check_span(address, len(data))
    return instruction(id, Instruction.REG_WRITE, bytes((address,)) + data)


def action(id: int = BROADCAST) -> bytes:
    """ACTION: carry out the last REG WRITE; a broadcast is not answered."""
    return instruction(id, Instruction.ACTION)


def factory_restore(id: int) -> bytes:
    """RESET (0x06): restore the factory values of one servo."""
    return instruction(id, Instruction.RESET)


def clear_turns(id: int) -> bytes:
    """0x0A: set the turn count of one servo to 0; some servos only."""
    return instruction(id, Instruction.CLEAR_TURNS)


def calibrate(id: int, position: bytes = b"") -> bytes:
    """0x0B: give the present pose this position: two bytes in the servo's byte order, or none for its middle."""
    return instruction(id, Instruction.CALIBRATE, position)


def sync_read(address: int, count: int, ids: Sequence[int]) -> bytes:
    """SYNC READ: `count` bytes from `address` on of each of `ids`, which reply in this order."""
    _check_span(address, count)
    _check_ids(ids, MAX_LENGTH - 4)
    return frame(BROADCAST, Instruction.SYNC_READ, bytes((address, count, *ids)))


def sync_write(address: int, items: Sequence[tuple[int, bytes]]) -> bytes:
    """SYNC WRITE: for each (id, data), all data of one length; no servo replies."""
    length = len(items[0][1]) if items else 1
    _check_span(address, length)
    _check_ids([id for id, _ in items], sync_write_capacity(length))
    if any(len(data) != length for _, data in items):
        raise RequestError("SYNC WRITE: the data of the servos have different lengths")
    parameters = b"".join(bytes((id,)) + data for id, data in items)
    return frame(BROADCAST, Instruction.SYNC_WRITE, bytes((address, length)) + parameters)


def sync_write_capacity(length: int) -> int:
    """Maximum number of servos of one SYNC WRITE with `length` bytes for each."""
    return (MAX_LENGTH - 4) // (length + 1)


def _check_span(address: int, count: int) -> None:
    if not (address >= 0 and 1 <= count <= MAX_PARAMETERS and address + count <= 256):
        raise RequestError(
            f"{count} bytes from register {address} on do not exist",
            expected=f"1 to {MAX_PARAMETERS} bytes within registers 0 to 255",
        )


def _check_ids(ids: Sequence[int], most: int) -> None:
    if not 1 <= len(ids) <= most:
        raise RequestError(f"{len(ids)} servos in one packet are impossible", expected=f"1 to {most}")
    for id in ids:
        if not 0 <= id <= MAX_ID:
            raise RequestError(f"id {id} is impossible", expected=f"0 to {MAX_ID}", node=id)
        if ids.count(id) > 1:
            raise RequestError(f"id {id} is given twice", node=id)


# -- decoders --------------------------------------------------------------------------------------------------


def instruction_name(code: int) -> str:
    """`SYNC READ`; `unknown (0x55)` for a code without a name."""
    if code not in RULES:
        return f"unknown (0x{code:02X})"
    known = Instruction(code)
    return _NAMES.get(known, known.name.replace("_", " "))


def suits(code: int, parameters: bytes) -> bool:
    """Whether the instruction is known and can be carried out with these parameters."""
    rule = RULES.get(code)
    if rule is None or not rule.fewest <= len(parameters) <= rule.most:
        return False
    if code == Instruction.CALIBRATE:
        return len(parameters) != 1
    return code != Instruction.SYNC_WRITE or decode_sync_write(parameters) is not None


def decode(data: bytes) -> Packet:
    """The fields of a valid packet."""
    return Packet(data[2], data[4], data[5:-1])


def decode_sync_write(parameters: bytes) -> SyncWrite | None:
    """The parameters of a SYNC WRITE; None unless they are whole items of at least one byte each."""
    if len(parameters) < 4 or not parameters[1] or (len(parameters) - 2) % (parameters[1] + 1):
        return None
    address, length = parameters[:2]
    starts = range(2, len(parameters), length + 1)
    items = tuple((parameters[at], parameters[at + 1 : at + 1 + length]) for at in starts)
    return SyncWrite(address, length, items)


def is_valid(data: bytes) -> bool:
    """Whether the checksum of this whole packet is right."""
    return data[-1] == checksum(data[2:-1])


def parser(top: int = BROADCAST) -> FrameParser:
    """A parser of packets with an id up to `top`: `MAX_ID` for status packets, `BROADCAST` for instructions too."""
    highest = bytes((top,))

    def size(data: bytes) -> int | None:
        if data[2:3] > highest:
            return 0
        if len(data) < 4:
            return None
        return data[3] + 4 if data[3] >= 2 else 0

    return FrameParser((HEADER,), size, is_valid)


def receiver() -> FrameReceiver:
    """The receiver of a bus: each status packet is a `Reply` on lane 0 with the id as key."""
    return FrameReceiver(parser(MAX_ID), key=lambda data: data[2])
