"""How long a CAN frame is on the wire, to the bit.

Stuff bits depend on the content: frames full of zeros, as these devices send them, have more of them than random
data. So a bus budget, a simulated wire and a deadline that must be right count the bits instead of guessing.
Classic CAN 2.0 (ISO 11898-1): start bit, identifier, control field, data, CRC-15 are stuffed; delimiters,
acknowledge slot, 7 bits end of frame and 3 bits of interframe space are not.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Final

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame

INTERFRAME: Final = 3
"""Bits after a frame before the next may begin; they are counted with the frame."""
ERROR_BITS: Final = 23
"""An error flag that every node joins (12), its delimiter (8) and the interframe space."""

_HEAD: Final = {False: 19, True: 39}  # start bit to length code
_CRC: Final = 15
_POLYNOMIAL: Final = 0x4599
_TAIL: Final = 1 + 2 + 7 + INTERFRAME  # CRC delimiter, acknowledge slot and delimiter, end of frame
_LIMIT: Final = 5  # equal bits, behind which a stuff bit follows
_PADDING: Final = tuple(
    0b0101_0101 & ((1 << count) - 1) for count in range(8)
)  # alternates and ends with a one


def _crc_row(byte: int) -> int:
    crc = byte << _CRC - 8
    for _ in range(8):
        crc = crc << 1 ^ (_POLYNOMIAL if crc >> _CRC - 1 & 1 else 0)
        crc &= (1 << _CRC) - 1
    return crc


def _stuffed(state: int, byte: int) -> tuple[int, int]:
    """The state after this byte, and the stuff bits it brings. A state is the last bit and how often it stood."""
    last, run, count = state & 1, state >> 1, 0
    for place in range(7, -1, -1):
        bit = byte >> place & 1
        run = run + 1 if bit == last else 1
        last = bit
        if run == _LIMIT:  # the stuff bit is the opposite one, and counts for the next run
            last, run, count = 1 - bit, 1, count + 1
    return run << 1 | last, count


@cache
def _tables() -> tuple[tuple[int, ...], tuple[tuple[tuple[int, int], ...], ...]]:
    """CRC and stuffing, a byte at a time; made when first needed, so whoever has no CAN does not wait for them."""
    crc = tuple(_crc_row(byte) for byte in range(256))
    return crc, tuple(tuple(_stuffed(state, byte) for byte in range(256)) for state in range(2 * _LIMIT))


@lru_cache(maxsize=1 << 16)
def bits(frame: CanFrame) -> int:
    """Bits on the wire of this frame, stuff bits and interframe space included.

    A report of a bus error (`ERROR_FLAG`) counts as the error flag it stands for.
    """
    if frame.id & ERROR_FLAG:
        return ERROR_BITS
    stream, size = _stream(frame)
    crc_of, stuffed_by = _tables()
    crc = 0
    for byte in stream.to_bytes((size + 7) // 8, "big"):  # zeros in front change nothing
        crc = (crc << 8 & 0x7FFF) ^ crc_of[crc >> 7 ^ byte]
    stream, size = stream << _CRC | crc, size + _CRC
    padding = -size % 8
    stream |= _PADDING[padding] << size  # an idle bus shows ones too, and this is never stuffed
    state, stuffed = 0, 0
    for byte in stream.to_bytes((size + padding) // 8, "big"):
        state, count = stuffed_by[state][byte]
        stuffed += count
    return size + stuffed + _TAIL


def unstuffed(frame: CanFrame) -> int:
    """Bits without any stuff bit: the least that a frame of this form can have."""
    size = 0 if frame.id & REMOTE_FLAG else len(frame.data)
    return least(size, frame.extended)


def least(length: int, extended: bool = False) -> int:
    """The least bits of a frame with so many data bytes."""
    return _HEAD[extended] + 8 * length + _CRC + _TAIL


def most(length: int, extended: bool = False) -> int:
    """The most bits of a frame with so many data bytes: one stuff bit behind the first five, then every four."""
    size = _HEAD[extended] + 8 * length + _CRC
    return size + (size - 1) // 4 + _TAIL


def precedence(frame: CanFrame) -> tuple[int, ...]:
    """What arbitration compares: of frames that begin together, the one with the least goes on.

    The first eleven bits of the identifier come first, and then a short identifier beats a long one.
    """
    number, remote = frame.id & 0x1FFF_FFFF, int(bool(frame.id & REMOTE_FLAG))
    if frame.extended:
        return (number >> 18, 1, 1, number & 0x3FFFF, remote)
    return (number, remote, 0, 0, 0)


def _stream(frame: CanFrame) -> tuple[int, int]:
    """From the start bit (a zero) to the end of the data, as a number, and how many bits that is."""
    number, remote = frame.id & 0x1FFF_FFFF, int(bool(frame.id & REMOTE_FLAG))
    data = b"" if remote else frame.data
    if frame.extended:  # 11 bits, two ones, 18 bits, remote, two zeros
        head = ((number >> 18) << 2 | 0b11) << 18 | number & 0x3FFFF
        head = (head << 1 | remote) << 2
    else:  # 11 bits, remote, two zeros
        head = (number << 1 | remote) << 2
    head = head << 4 | len(frame.data)
    return head << 8 * len(data) | int.from_bytes(data, "big"), _HEAD[frame.extended] + 8 * len(data)
