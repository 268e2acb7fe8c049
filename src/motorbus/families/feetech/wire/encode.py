"""Packets to be sent: the last gate before the wire.

What no servo could obey, what could only do harm, and what nobody knows the effect of raises RequestError
here and is never sent. `RULES` is the law.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from motorbus.errors import RequestError
from motorbus.families.feetech.wire.packets import (
    BROADCAST,
    MAX_ID,
    MAX_LENGTH,
    MAX_PARAMETERS,
    RULES,
    Instruction,
    Rule,
    frame,
    instruction_name,
    suits,
)

_READ: Final = int(Instruction.READ)
_SHAPES: Final[dict[int, str]] = {
    Instruction.READ: "give the first register and how many bytes",
    Instruction.WRITE: "give the first register and at least one datum",
    Instruction.REG_WRITE: "give the first register and at least one datum",
    Instruction.CALIBRATE: "give a position of two bytes, or none",
    Instruction.SYNC_READ: "give the first register, how many bytes, and the ids",
    Instruction.SYNC_WRITE: "give the first register, how many bytes, and an id and its bytes for each servo",
}


def encode_instruction(
    id: int, instruction: int, parameters: bytes = b"", *, broadcast: bool = False
) -> bytes:
    """An instruction packet. `broadcast=True` is the explicit wish to PING everyone at once.

    Raises RequestError when id, addressee or number of parameters do not suit the instruction, when the
    packet would exceed 259 bytes, and for instructions that are only ever decoded (0x08, 0x09, 0x0D).
    """
    rule = RULES.get(instruction)
    if rule is None or not rule.sent:
        raise _never_sent(instruction)
    if not 0 <= id <= BROADCAST:
        raise _bad_id(id)
    if not suits(instruction, parameters):
        raise _bad_parameters(instruction, rule, len(parameters))
    wished = broadcast and instruction == Instruction.PING
    if not (rule.everyone or wished if id == BROADCAST else rule.one):
        raise _bad_addressee(instruction, id)
    return frame(id, instruction, parameters)


def encode_status(id: int, error: int, parameters: bytes = b"") -> bytes:
    """A status packet, as a servo sends it. Raises RequestError when a field is impossible."""
    if not 0 <= id <= MAX_ID:
        raise _bad_id(id)
    if not 0 <= error <= 0xFF:
        raise RequestError(
            f"error byte {error} does not fit a byte",
            expected="0 to 255",
            advice="give the sum of the alarm bits; nothing was sent",
        )
    if len(parameters) > MAX_PARAMETERS:
        raise _too_long("status", len(parameters))
    return frame(id, error, parameters)


def ping(id: int, *, broadcast: bool = False) -> bytes:
    """PING: is it there, and which alarms? Everyone (254) only with `broadcast=True`, for replies collide."""
    return encode_instruction(id, Instruction.PING, broadcast=broadcast)


def read(id: int, address: int, count: int) -> bytes:
    """READ `count` bytes (1 to 253) from `address` on. One servo only: a broadcast READ has no answer."""
    if 0 <= id <= MAX_ID and address >= 0 and 1 <= count <= 253 and address + count <= 256:
        # the packet that is made most; whatever is wrong is told below
        return bytes((0xFF, 0xFF, id, 4, _READ, address, count, ~(id + 4 + _READ + address + count) & 0xFF))
    _check_span(address, count)
    return encode_instruction(id, Instruction.READ, bytes((address, count)))


def write(id: int, address: int, data: bytes) -> bytes:
    """WRITE at least one byte from `address` on; broadcast (254) is obeyed by all and answered by none."""
    _check_span(address, len(data))
    return encode_instruction(id, Instruction.WRITE, bytes((address,)) + data)


def reg_write(id: int, address: int, data: bytes) -> bytes:
    """REG WRITE: as WRITE, but kept back until ACTION comes."""
    _check_span(address, len(data))
    return encode_instruction(id, Instruction.REG_WRITE, bytes((address,)) + data)


def action(id: int = BROADCAST) -> bytes:
    """ACTION: carry out what REG WRITE left. As a broadcast, all at once and without any answer."""
    return encode_instruction(id, Instruction.ACTION)


def factory_restore(id: int) -> bytes:
    """RESET (0x06): restore the factory values of one servo."""
    return encode_instruction(id, Instruction.RESET)


def clear_turns(id: int) -> bytes:
    """0x0A: forget the turn count of one servo, where its firmware knows the instruction."""
    return encode_instruction(id, Instruction.CLEAR_TURNS)


def calibrate(id: int, position: bytes = b"") -> bytes:
    """0x0B: call the present pose `position`: two bytes in the servo's byte order, or none for its middle."""
    return encode_instruction(id, Instruction.CALIBRATE, position)


def sync_read(address: int, count: int, ids: Sequence[int]) -> bytes:
    """SYNC READ: `count` bytes from `address` on from each of `ids` (at most 251), answered in that order."""
    _check_span(address, count)
    _check_nodes("SYNC READ", ids, MAX_LENGTH - 4)
    return frame(BROADCAST, Instruction.SYNC_READ, bytes((address, count, *ids)))


def sync_write(address: int, items: Sequence[tuple[int, bytes]], *, cap: int = MAX_LENGTH) -> bytes:
    """SYNC WRITE: for each (id, data), all data equally long; nobody answers.

    `cap` is the greatest length field allowed, 255 or `VENDOR_MAX_LENGTH`. Raises RequestError when the data
    are of unequal length, an id is there twice, or there are more than `sync_write_capacity` allows.
    """
    length = len(items[0][1]) if items else 1
    _check_span(address, length)
    _check_nodes("SYNC WRITE", [id for id, _ in items], sync_write_capacity(length, cap))
    for id, data in items:
        if len(data) != length:
            raise RequestError(
                f"SYNC WRITE: {len(data)} bytes for id {id} but {length} for id {items[0][0]}",
                expected="the same number of bytes for every servo",
                advice="write the same registers on all of them, or use WRITE; nothing was sent",
                node=id,
            )
    parameters = b"".join([bytes((address, length)), *(bytes((id,)) + data for id, data in items)])
    return frame(BROADCAST, Instruction.SYNC_WRITE, parameters)


def sync_write_capacity(length: int, cap: int = MAX_LENGTH) -> int:
    """How many servos one SYNC WRITE of `length` bytes each can serve with a length field up to `cap`."""
    if not 1 <= length <= MAX_LENGTH - 5:
        raise RequestError(
            f"SYNC WRITE of {length} bytes for each servo is impossible",
            expected=f"1 to {MAX_LENGTH - 5} bytes",
            advice="write fewer registers at a time; nothing was sent",
        )
    return max(0, (min(cap, MAX_LENGTH) - 4) // (length + 1))


# --- refusals -----------------------------------------------------------------------------------------------


def _bad_id(id: int) -> RequestError:
    """The error for an id that no packet can carry."""
    return RequestError(
        f"id {id} is impossible",
        expected=f"0 to {MAX_ID}, or {BROADCAST} for everyone where no answer is wanted",
        advice="255 would be read as part of the header; nothing was sent",
        node=id,
    )


def _never_sent(instruction: int) -> RequestError:
    return RequestError(
        f"{instruction_name(instruction)} is never sent",
        expected="one of " + ", ".join(instruction_name(code) for code, rule in RULES.items() if rule.sent),
        advice="it can leave a servo without its program, or does what nobody knows; nothing was sent",
    )


def _bad_parameters(instruction: int, rule: Rule, count: int) -> RequestError:
    if count > rule.most and rule.most == MAX_PARAMETERS:
        return _too_long(instruction_name(instruction), count)
    few = f"{rule.fewest}" if rule.fewest == rule.most else f"{rule.fewest} to {rule.most}"
    return RequestError(
        f"{instruction_name(instruction)} with {count} parameter bytes is impossible",
        expected=f"{few} parameter bytes",
        advice=_SHAPES.get(instruction, "give exactly these") + "; nothing was sent",
    )


def _too_long(what: str, count: int) -> RequestError:
    return RequestError(
        f"{what}: a packet with {count} parameter bytes is too long",
        expected=f"at most {MAX_PARAMETERS} parameter bytes, {MAX_LENGTH + 4} bytes in all",
        advice="split the request; nothing was sent",
    )


def _bad_addressee(instruction: int, id: int) -> RequestError:
    name = instruction_name(instruction)
    if id != BROADCAST:
        return RequestError(
            f"{name} cannot be addressed to id {id} alone",
            expected=f"id {BROADCAST}; the servos stand among the parameters",
            advice="use READ or WRITE for one servo; nothing was sent",
            node=id,
        )
    return RequestError(
        f"{name} cannot be sent to everyone (id {BROADCAST})",
        expected=f"the id of one servo, 0 to {MAX_ID}",
        advice="replies would collide or never come: take one servo after another; nothing was sent",
        node=id,
    )


def _check_span(address: int, count: int) -> None:
    if not (0 <= address <= 255 and 1 <= count <= 253 and address + count <= 256):
        raise RequestError(
            f"{count} bytes from register {address} on do not exist",
            expected="at least one byte, at most 253, within registers 0 to 255",
            advice="check address and count; nothing was sent",
        )


def _check_nodes(name: str, ids: Sequence[int], most: int) -> None:
    if not 1 <= len(ids) <= most:
        raise RequestError(
            f"{name} for {len(ids)} servos is impossible",
            expected=f"1 to {most} servos of that many bytes each in one packet",
            advice="split the group; nothing was sent",
        )
    for id in ids:
        if not 0 <= id <= MAX_ID:
            raise _bad_id(id)
    if len(set(ids)) != len(ids):
        twice = next(id for id in ids if list(ids).count(id) > 1)
        raise RequestError(
            f"{name} names id {twice} twice",
            expected="every id once",
            advice="leave one of them out; nothing was sent",
            node=twice,
        )
