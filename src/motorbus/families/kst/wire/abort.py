"""Why a servo refuses, in words.

The KST CAN protocol manual prints 29 codes, all of them CiA 301's, high word first ("0602 0000"); on the wire they
are little-endian: 00 00 02 06. CiA 301 version 4.2 has two more. Other codes are invented by vendors and are shown
as they are. No code of the table is another one byte-reversed, so a code sent the wrong way round can be told.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

ABORTS: Final[Mapping[int, str]] = MappingProxyType(
    {
        0x0503_0000: "Toggle bit not alternated",
        0x0504_0000: "SDO protocol timed out",
        0x0504_0001: "Client/server command specifier not valid or unknown",
        0x0504_0002: "Invalid block size (block mode only)",
        0x0504_0003: "Invalid sequence number (block mode only)",
        0x0504_0004: "CRC error (block mode only)",
        0x0504_0005: "Out of memory",
        0x0601_0000: "Unsupported access to an object",
        0x0601_0001: "Attempt to read a write only object",
        0x0601_0002: "Attempt to write a read only object",
        0x0602_0000: "Object does not exist in the object dictionary",
        0x0604_0041: "Object cannot be mapped to the PDO",
        0x0604_0042: "The number and length of the objects to be mapped would exceed PDO length",
        0x0604_0043: "General parameter incompatibility reason",
        0x0604_0047: "General internal incompatibility in the device",
        0x0606_0000: "Access failed due to a hardware error",
        0x0607_0010: "Data type does not match, length of service parameter does not match",
        0x0607_0012: "Data type does not match, length of service parameter too high",
        0x0607_0013: "Data type does not match, length of service parameter too low",
        0x0609_0011: "Sub-index does not exist",
        0x0609_0030: "Value range of parameter exceeded (only for write access)",
        0x0609_0031: "Value of parameter written too high",
        0x0609_0032: "Value of parameter written too low",
        0x0609_0036: "Maximum value is less than minimum value",
        0x060A_0023: "Resource not available: SDO connection",
        0x0800_0000: "General error",
        0x0800_0020: "Data cannot be transferred or stored to the application",
        0x0800_0021: "Data cannot be transferred or stored to the application because of local control",
        0x0800_0022: "Data cannot be transferred or stored to the application because of the present device state",
        0x0800_0023: "Object dictionary dynamic generation fails or no object dictionary is present",
        0x0800_0024: "No data available",
    }
)
"""Code -> the manual's words; 0x060A0023 and 0x08000024 are CiA 301's alone."""


def abort_text(code: int) -> str:
    """What an abort code says; a code nobody knows as hex, one sent byte-reversed with what it must mean."""
    if code in ABORTS:
        return ABORTS[code]
    meant = int.from_bytes(code.to_bytes(4, "little"), "big") if 0 <= code <= 0xFFFF_FFFF else -1
    if meant in ABORTS:
        return f"byte-swapped abort 0x{code:08X}, meaning 0x{meant:08X}: {ABORTS[meant]}"
    return f"unknown abort code 0x{code:08X}"
