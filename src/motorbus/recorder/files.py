"""Bytes of a serial line that somebody has kept in a file: as they came, or written in hexadecimal.

What is written by a terminal program, a logic analyser or `xxd -p` is one of the two. Logs of CAN frames are read by
`can_log`.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from motorbus.errors import RequestError

RAW: Final = (".bin", ".raw")
"""Endings of files that hold the bytes themselves."""
TEXT: Final = (".hex", ".txt")
"""Endings of files that hold them in hexadecimal."""
_SHOWN: Final = 60


def read_bytes(path: Path) -> bytes:
    """All bytes in a recording of a serial line.

    Raises RequestError for a name that ends in none of `RAW` and `TEXT`, and for text that is not hexadecimal; OSError
    where it cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix in RAW:
        return path.read_bytes()
    if suffix in TEXT:
        return from_hex(path.read_text(encoding="utf-8", errors="replace"))
    raise RequestError(
        f"{path}: no recording of a serial line that is known here",
        expected=f"a name that ends in {', '.join(RAW)} (bytes) or {', '.join(TEXT)} (hexadecimal)",
    )


def from_hex(text: str) -> bytes:
    """Bytes in hexadecimal, with or without spaces, commas, colons or 0x. Raises RequestError for anything else.

    A byte order mark in front, as some editors write it, is none of them.
    """
    text = text.removeprefix("\ufeff")
    try:
        return bytes.fromhex(re.sub(r"0[xX]|[\s,:;]", "", text))
    except ValueError:
        raise RequestError(
            "these are not bytes in hexadecimal", sent=text.strip()[:_SHOWN], expected="pairs of 0-9 A-F"
        ) from None
