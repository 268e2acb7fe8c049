"""Bytes of a serial line in a file: the bytes themselves, or text as people have it.

Text is pairs of hexadecimal digits with or without separators, `0x`, `\\x`; a hex dump with offsets and an ASCII column
(xxd, hexdump -C); an array of C; a list of decimal numbers in brackets. Logs of CAN frames are read by `can_log`.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from motorbus.errors import RequestError

RAW: Final = (".bin", ".raw")
"""Endings of files that hold the bytes themselves."""
TEXT: Final = (".hex", ".txt")
"""Endings of files that hold text."""
_SHOWN: Final = 60
_OFFSET: Final = re.compile(r"\s*([0-9A-Fa-f]{4,8})(:?)\s+(.*)")
_TIME: Final = re.compile(r"^\s*\[?(\d+:)?\d+:\d+[.,]\d+\]?\s+|^\s*\(?\d+\.\d{3,}\)?\s+")
_BETWEEN: Final = re.compile(r"[\s,;:{}]+|\\x|0[xX]")
_LIST: Final = re.compile(r"\[\s*\d+(\s*,\s*\d+)*\s*,?\s*\]")


def read_bytes(path: Path) -> bytes:
    """All bytes in a recording of a serial line.

    Raises RequestError for a name that ends in none of `RAW` and `TEXT` and for a line without bytes, OSError if the
    file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix in RAW:
        return path.read_bytes()
    if suffix in TEXT:
        return from_text(path.read_text(encoding="utf-8", errors="replace"))
    raise RequestError(
        f"{path}: not a recording of a serial line",
        expected=f"a name that ends in {', '.join(RAW)} (bytes) or {', '.join(TEXT)} (text)",
    )


def from_text(text: str) -> bytes:
    """The bytes of a text. Digits are never paired across white space. Raises RequestError that names the line."""
    text = text.removeprefix("\ufeff")
    if "{" in text:  # an array of C: its values are between the braces
        text = re.sub(r"/\*.*?\*/|//[^\n]*", "", text.partition("{")[2].partition("}")[0], flags=re.DOTALL)
    found = bytearray()
    for number, line in enumerate(text.splitlines(), 1):
        found += _from_line(line, number, len(found))
    return bytes(found)


def _from_line(line: str, number: int, count: int) -> bytes:
    if _LIST.fullmatch(line.strip()):
        return bytes(_byte(word, 10, line, number) for word in re.findall(r"\d+", line))
    text = _TIME.sub("", line).strip().strip("\"'")
    text = re.sub(r"^b[\"']", "", text)
    dump = _OFFSET.fullmatch(text)
    if dump is not None and (dump[2] or int(dump[1], 16) == count):
        text = _without_ascii(dump[3])
    elif re.fullmatch(r"[0-9A-Fa-f]{7,8}", text) and int(text, 16) == count:
        return b""  # the last line of hexdump: the length
    found = bytearray()
    for word in filter(None, _BETWEEN.split(text)):
        if not re.fullmatch(r"([0-9A-Fa-f]{2})+", word):
            raise _unreadable(word, line, number)
        found += bytes.fromhex(word)
    return bytes(found)


def _without_ascii(text: str) -> str:
    """A line of a hex dump without the column that repeats its bytes as ASCII characters."""
    for gap in re.finditer(r"\s{2,}\|?|\|", text):
        head, tail = text[: gap.start()], text[gap.end() :].rstrip("|")
        digits = "".join(head.split())
        if not re.fullmatch(r"([0-9A-Fa-f]{2})+", digits):
            break
        shown = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in bytes.fromhex(digits))
        if shown.strip() == tail.strip():
            return head
    return text


def _byte(word: str, base: int, line: str, number: int) -> int:
    value = int(word, base)
    if value > 255:
        raise _unreadable(word, line, number)
    return value


def _unreadable(word: str, line: str, number: int) -> RequestError:
    return RequestError(
        f"line {number}: {word[:_SHOWN]!r} is not bytes",
        sent=line.strip()[:_SHOWN],
        expected="pairs of 0-9 A-F, as FF FF 01; a hex dump; a list as [255, 255, 1]",
    )
