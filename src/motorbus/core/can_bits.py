"""The exact length of a CAN data frame on the wire, in bits.

The number of stuff bits depends on the content; frames of many zeros, which these devices send, have more than random
data. Classic CAN 2.0 (ISO 11898-1): start bit, identifier, control field, data and CRC-15 are stuffed. Delimiters,
acknowledge slot, end of frame (7 bits) and interframe space (3 bits) are not.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, CanFrame

INTERFRAME: Final = 3  # bits between two frames; counted with the first
ERROR_BITS: Final = 23
"""Error flag with the flags of all nodes superposed (12), delimiter (8), interframe space (3)."""

_HEAD: Final = {False: 19, True: 39}  # start bit to length code
_CRC: Final = 15
_POLYNOMIAL: Final = 0x4599
_TAIL: Final = 1 + 2 + 7 + INTERFRAME  # CRC delimiter, acknowledge slot and delimiter, end of frame


def _crc_table() -> list[int]:
    """The CRC of each byte."""
    table = [byte << _CRC - 8 for byte in range(256)]
    for _ in range(8):
        table = [(crc << 1 ^ (_POLYNOMIAL if crc >> _CRC - 1 else 0)) & 0x7FFF for crc in table]
    return table


_CRC_OF: Final = _crc_table()
# An inverted bit follows five equal bits. It starts the next run, so four bits equal to it are followed by another:
# a match of 1 + 4 n bits has n stuff bits.
_STUFFED: Final = re.compile("0{5}(?:1{4}0{4})*(?:1{4})?|1{5}(?:0{4}1{4})*(?:0{4})?")


@lru_cache(maxsize=1 << 16)
def bits(frame: CanFrame) -> int:
    """Bits on the wire, with stuff bits and interframe space; `ERROR_BITS` for an error report (`ERROR_FLAG`)."""
    if frame.id & ERROR_FLAG:
        return ERROR_BITS
    number, data = frame.id & 0x1FFF_FFFF, frame.data
    # 11 bits and three zeros; or 11 bits, two ones, 18 bits and three zeros
    base = (number >> 18) << 2 | 0b11
    head = (base << 18 | number & 0x3FFFF if frame.extended else number) << 3
    stream = (head << 4 | len(data)) << 8 * len(data) | int.from_bytes(data, "big")
    size = _HEAD[frame.extended] + 8 * len(data)
    crc = 0
    for byte in stream.to_bytes((size + 7) // 8, "big"):  # leading zeros do not change the CRC
        crc = (crc << 8 & 0x7FFF) ^ _CRC_OF[crc >> 7 ^ byte]
    runs = _STUFFED.findall(f"{stream << _CRC | crc:0{size + _CRC}b}")
    stuff_bits = sum((len(run) - 1) // 4 for run in runs)
    return size + _CRC + stuff_bits + _TAIL


def least(length: int, extended: bool = False) -> int:
    """Minimum bits of a frame with `length` data bytes: no stuff bits."""
    return _HEAD[extended] + 8 * length + _CRC + _TAIL
