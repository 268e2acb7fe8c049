"""The exact length of a CAN frame on the wire, in bits.

The number of stuff bits depends on the content; frames of many zeros, which these devices send, have more than random
data. Classic CAN 2.0 (ISO 11898-1): start bit, identifier, control field, data and CRC-15 are stuffed. Delimiters,
acknowledge slot, end of frame (7 bits) and interframe space (3 bits) are not.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame

INTERFRAME: Final = 3
"""Bits between two frames; counted with the first."""
ERROR_BITS: Final = 23
"""Error flag with the flags of all nodes superposed (12), delimiter (8), interframe space (3)."""

_HEAD: Final = {False: 19, True: 39}  # start bit to length code
_CRC: Final = 15
_POLYNOMIAL: Final = 0x4599
_TAIL: Final = 1 + 2 + 7 + INTERFRAME  # CRC delimiter, acknowledge slot and delimiter, end of frame
_LIMIT: Final = 5  # equal bits; a stuff bit follows them
_PADDING: Final = tuple(0b0101_0101 & ((1 << count) - 1) for count in range(8))  # alternating, last bit 1


def _stuffed(state: int, byte: int) -> tuple[int, int]:
    """Return the state after this byte and its number of stuff bits. A state is the run length * 2 + the last bit."""
    last, run, count = state & 1, state >> 1, 0
    for place in range(7, -1, -1):
        bit = byte >> place & 1
        run = run + 1 if bit == last else 1
        last = bit
        if run == _LIMIT:  # the stuff bit is inverted and starts the next run
            last, run, count = 1 - bit, 1, count + 1
    return run << 1 | last, count


@cache
def _tables() -> tuple[tuple[int, ...], tuple[tuple[tuple[int, int], ...], ...]]:
    """Tables of CRC and stuffing per byte, built on first use: buses without CAN do not need them."""
    crcs = [byte << _CRC - 8 for byte in range(256)]
    for _ in range(8):
        crcs = [(crc << 1 ^ (_POLYNOMIAL if crc >> _CRC - 1 & 1 else 0)) & 0x7FFF for crc in crcs]
    return tuple(crcs), tuple(
        tuple(_stuffed(state, byte) for byte in range(256)) for state in range(2 * _LIMIT)
    )


@lru_cache(maxsize=1 << 16)
def bits(frame: CanFrame) -> int:
    """Bits on the wire, with stuff bits and interframe space; `ERROR_BITS` for an error report (`ERROR_FLAG`)."""
    if frame.id & ERROR_FLAG:
        return ERROR_BITS
    stream, size = _stream(frame)
    crc_of, stuffed_by = _tables()
    crc = 0
    for byte in stream.to_bytes((size + 7) // 8, "big"):  # leading zeros do not change the CRC
        crc = (crc << 8 & 0x7FFF) ^ crc_of[crc >> 7 ^ byte]
    stream, size = stream << _CRC | crc, size + _CRC
    padding = -size % 8
    stream |= _PADDING[padding] << size  # ones like an idle bus; never stuffed
    state, stuffed = 0, 0
    for byte in stream.to_bytes((size + padding) // 8, "big"):
        state, count = stuffed_by[state][byte]
        stuffed += count
    return size + stuffed + _TAIL


def unstuffed(frame: CanFrame) -> int:
    """Bits of this frame without stuff bits."""
    size = 0 if frame.id & REMOTE_FLAG else len(frame.data)
    return least(size, frame.extended)


def least(length: int, extended: bool = False) -> int:
    """Minimum bits of a frame with `length` data bytes: no stuff bits."""
    return _HEAD[extended] + 8 * length + _CRC + _TAIL


def precedence(frame: CanFrame) -> tuple[int, ...]:
    """Sort key of arbitration: of frames that start together, the one with the lowest key wins.

    The first eleven bits of the identifier count first; at equality an 11-bit identifier wins over a 29-bit one.
    """
    number, remote = frame.id & 0x1FFF_FFFF, int(bool(frame.id & REMOTE_FLAG))
    if frame.extended:
        return (number >> 18, 1, 1, number & 0x3FFFF, remote)
    return (number, remote, 0, 0, 0)


def _stream(frame: CanFrame) -> tuple[int, int]:
    """Return the bits from the start bit (a zero) to the end of the data as an integer, and their number."""
    number, remote = frame.id & 0x1FFF_FFFF, int(bool(frame.id & REMOTE_FLAG))
    data = b"" if remote else frame.data
    if frame.extended:  # 11 bits, two ones, 18 bits, remote, two zeros
        head = ((number >> 18) << 2 | 0b11) << 18 | number & 0x3FFFF
        head = (head << 1 | remote) << 2
    else:  # 11 bits, remote, two zeros
        head = (number << 1 | remote) << 2
    head = head << 4 | len(frame.data)
    return head << 8 * len(data) | int.from_bytes(data, "big"), _HEAD[frame.extended] + 8 * len(data)
