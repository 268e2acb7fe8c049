"""Bytes of a serial line from a file or text, as other programs write them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from motorbus.errors import RequestError

RAW: Final = (".bin", ".raw")
TEXT: Final = (".hex", ".txt")
_SHOWN: Final = 60  # characters of a line in an error
_PAIRS: Final = re.compile(r"([0-9A-Fa-f]{2})+")
_OFFSET: Final = re.compile(r"([0-9A-Fa-f]{4,8})(:?)\s+(.*)")
_TIME: Final = re.compile(r"^\s*\[?(\d+:)?\d+:\d+[.,]\d+\]?\s+|^\s*\(?\d+\.\d{3,}\)?\s+")
_LABEL: Final = re.compile(r"^([0-9]+|[RrTt][Xx]):\s+")  # a time or a direction
_BETWEEN: Final = re.compile(r"[\s,;:{}]+|\\x|0[xX]")
_LIST: Final = re.compile(r"\[\s*[0-9]{1,3}(\s*,\s*[0-9]{1,3})*\s*,?\s*\]")
_COMMENT: Final = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


def read_bytes(path: Path) -> bytes:
    """Read a recording of a serial line: `.bin` and `.raw` hold the bytes, `.hex` and `.txt` text for `from_text`.

    Raises RequestError for another ending and for a line without bytes, OSError if the file cannot be read.
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
    """Parse pairs of hexadecimal digits (also `0x`, `\\x`), hex dumps, C arrays and lists of decimal numbers.

    Digits are never paired across white space. Raises RequestError that names the line.
    """
    text = text.removeprefix("\ufeff")
    if "{" in text:  # a C array: its values are between the braces
        text = _COMMENT.sub("", text.partition("{")[2].partition("}")[0])
    found = bytearray()
    for number, line in enumerate(text.splitlines(), 1):
        try:
            found += _parse_line(line, len(found))
        except ValueError as error:
            raise RequestError(
                f"line {number}: {str(error)[:_SHOWN]!r} is not bytes",
                sent=line.strip()[:_SHOWN],
                expected="pairs of 0-9 A-F, as FF FF 01; a hex dump; a list as [255, 255, 1]",
            ) from None
    return bytes(found)


def _parse_line(line: str, count: int) -> bytes:
    """Parse a line that `count` bytes precede. Raises ValueError with the word that cannot be read."""
    if _LIST.fullmatch(line.strip()):
        values = [int(word) for word in re.findall(r"\d+", line)]
        if max(values) > 255:
            raise ValueError(max(values))
        return bytes(values)
    text = re.sub(r"^b(?=[\"'])", "", _TIME.sub("", line).strip()).strip("\"'")
    dump = _OFFSET.fullmatch(text)
    if dump is not None and (dump[2] or _is_offset(dump[1], count)):
        text = _remove_ascii(dump[3])
    elif re.fullmatch(r"[0-9A-Fa-f]{7,8}", text) and _is_offset(text, count):
        return b""  # the last line of hexdump or od: the length
    else:
        text = _LABEL.sub("", text)
    found = bytearray()
    for word in filter(None, _BETWEEN.split(text)):
        if not _PAIRS.fullmatch(word):
            raise ValueError(word)
        found += bytes.fromhex(word)
    return bytes(found)


def _is_offset(digits: str, count: int) -> bool:
    """In hexadecimal, or with 7 digits in octal as od writes it."""
    return (len(digits) == 7 and digits == f"{count:07o}") or int(digits, 16) == count


def _remove_ascii(text: str) -> str:
    """Remove the column of a hex dump that repeats the bytes of its line as ASCII characters."""
    for gap in re.finditer(r"\s{2,}\|?|\|", text):
        head, tail = text[: gap.start()], text[gap.end() :].strip()
        digits = "".join(head.split())
        if not _PAIRS.fullmatch(digits):
            break
        ascii_column = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in bytes.fromhex(digits))
        if tail in (ascii_column.strip(), f"{ascii_column}|".strip()):
            return head
    return text
