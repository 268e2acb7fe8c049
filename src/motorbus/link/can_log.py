"""CAN traffic that somebody has recorded: candump text read here, ASC, BLF and TRC by python-can's readers.

Text needs nothing installed, so a line of candump can be explained anywhere; the other formats need python-can. What
is no classic CAN frame is told as such, never dropped.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import RequestError

MOST: Final = 8
"""Data bytes of a classic CAN frame."""
_BY_PYTHON_CAN: Final = (".asc", ".blf", ".trc")
_TEXT: Final = (".log", ".txt", ".candump", "")
_HIGHEST: Final = {3: 0x7FF, 8: 0x1FFFFFFF}
_DATE: Final = 1e8
"""s; a time below this is three years after 1970 at most, so it is counted from something else."""

_WORD: Final = re.compile(r"(?P<id>[0-9A-Fa-f]+)#(?P<data>.*)")
_LOG: Final = re.compile(
    r"\((?P<at>\d+\.?\d*)\)\s+(?P<channel>\S+)\s+(?P<word>\S+#\S*)(?:\s+(?P<way>[RT]))?\s*"
)
_SCREEN: Final = re.compile(
    r"\s*(?:\((?P<at>[\d.]+)\)\s+)?(?P<channel>\S+)\s+(?:(?P<way>RX|TX)\b[\s\-BE]*)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<fd>0?)(?P<length>\d+)\]\s*(?P<data>.*?)\s*(?:'.*')?"
)
_WAYS: Final = {"R": "rx", "T": "tx", "RX": "rx", "TX": "tx"}


class Logged(NamedTuple):
    """One recorded frame.

    `frame`      None for what is no classic CAN frame; `fault` says what it is instead
    `at`         s since 1970, or since some beginning if `relative`; None where nothing was noted
    `direction`  "rx" or "tx" as the recorder saw it, "" where it did not say
    """

    text: str
    frame: CanFrame | None
    at: float | None = None
    direction: str = ""
    channel: str = ""
    fault: str = ""

    @property
    def relative(self) -> bool:
        """The time is counted from the beginning of something, not from 1970."""
        return self.at is not None and self.at < _DATE


def parse_word(word: str) -> CanFrame | None:
    """`625#2203600084030000` -> a frame: 3 digits are an 11-bit identifier, 8 a 29-bit one, `#R` a remote frame.

    None for a CAN FD frame (`##`). Raises RequestError for what is no frame.
    """
    found = _WORD.fullmatch(word.strip())
    if found is None:
        raise _no_frame(word, "expected IDENTIFIER#DATA")
    if found["data"].startswith("#"):
        return None
    identifier, extended = _identifier(found["id"], word)
    if found["data"][:1] in ("R", "r"):
        if not re.fullmatch(r"[Rr][0-8]?", found["data"]):
            raise _no_frame(word, "a remote frame is written #R or #R8")
        return CanFrame(identifier | REMOTE_FLAG, b"", extended)
    return CanFrame(identifier, _data(found["data"].replace(".", ""), word), extended)


def parse_line(line: str) -> Logged | None:
    """One line as candump prints or logs it, or frames as words alone; None for a line without a frame.

    Raises RequestError for a line that looks like a frame and is none.
    """
    text = line.strip()
    if not text or text.startswith(("#", ";", "//")):
        return None
    if found := _LOG.fullmatch(text):
        frame = parse_word(found["word"])
        return _logged(
            found["word"], frame, float(found["at"]), _WAYS.get(found["way"], ""), found["channel"]
        )
    if found := _SCREEN.fullmatch(text):
        return _from_screen(found)
    return _logged(text, parse_word(text))


def looks_like_can(text: str) -> bool:
    """Is this the text of CAN frames, rather than bytes in hexadecimal?"""
    first = next((line for line in text.splitlines() if line.strip()), "")
    return "#" in first or _SCREEN.fullmatch(first) is not None


def is_log(path: Path) -> bool:
    """Does the name say that this can be nothing but a log of CAN frames?"""
    return path.suffix.lower() in (_TEXT[0], ".candump", *_BY_PYTHON_CAN)


def read_lines(lines: Iterable[str]) -> Iterator[Logged]:
    """Every frame in the text of candump, as it comes. Raises RequestError with the number of a bad line."""
    for number, line in enumerate(lines, 1):
        try:
            found = parse_line(line)
        except RequestError as error:
            raise RequestError(
                f"line {number}: {error.summary}", sent=error.sent, expected=error.expected
            ) from None
        if found is not None:
            yield found


def read_log(path: Path) -> Iterator[Logged]:
    """Every frame in a file of candump (`.log`), ASC, BLF or TRC, in order.

    Raises RequestError for a file that is none of these, LinkError where its format needs python-can and that is
    missing, OSError where it cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix in _TEXT:
        with path.open(encoding="utf-8", errors="replace") as file:
            yield from read_lines(file)
    elif suffix in _BY_PYTHON_CAN:
        yield from _by_python_can(path)
    else:
        raise RequestError(
            f"{path}: no log of CAN frames that is known here",
            expected=f"a name that ends in {', '.join((*_TEXT[:1], *_BY_PYTHON_CAN))}",
        )


def _by_python_can(path: Path) -> Iterator[Logged]:
    from motorbus.link.can import python_can  # the one place where it is imported

    can = python_can(f"reading {path}")
    reader = {".asc": can.ASCReader, ".blf": can.BLFReader, ".trc": can.TRCReader}[path.suffix.lower()]
    how: dict[str, Any] = (
        {"mode": "rb"} if reader is can.BLFReader else {"encoding": "utf-8", "errors": "replace"}
    )
    with path.open(**how) as file:
        try:
            yield from map(_from_message, reader(file))
        except OSError:
            raise
        except Exception as error:  # what its readers raise for a broken file is theirs to choose
            raise RequestError(f"{path}: cannot be read as {path.suffix}: {error}") from error


def _from_message(message: Any) -> Logged:
    identifier = message.arbitration_id
    word = f"{identifier:0{8 if message.is_extended_id else 3}X}#{bytes(message.data or b'').hex().upper()}"
    direction = "rx" if message.is_rx else "tx"
    channel = "" if message.channel is None else str(message.channel)
    if message.is_fd:
        return _logged(word.replace("#", "##"), None, message.timestamp, direction, channel)
    if message.is_error_frame:
        identifier = (identifier & 0x1FFFFFFF) | ERROR_FLAG
        frame = CanFrame(identifier, bytes(message.data or b"")[:MOST])
    elif message.is_remote_frame:
        frame = CanFrame(identifier | REMOTE_FLAG, b"", message.is_extended_id)
    else:
        frame = CanFrame(identifier, bytes(message.data or b""), message.is_extended_id)
    return _logged(word, frame, message.timestamp, direction, channel)


def _from_screen(found: re.Match[str]) -> Logged:
    at = float(found["at"]) if found["at"] else None
    data = found["data"]
    text = f"{found['id']}#{data.replace(' ', '')}"
    if found["fd"] or int(found["length"]) > MOST:
        return _logged(f"{found['id']}##", None, at, _WAYS.get(found["way"], ""), found["channel"])
    word = f"{found['id']}#R" if data.startswith("remote") else text.partition("ERRORFRAME")[0]
    frame = parse_word(word)
    if frame is not None and not frame.id & REMOTE_FLAG and len(frame.data) != int(found["length"]):
        raise _no_frame(
            found[0].strip(), f"{found['length']} bytes are announced and {len(frame.data)} stand there"
        )
    return _logged(word, frame, at, _WAYS.get(found["way"], ""), found["channel"])


def _logged(
    text: str, frame: CanFrame | None, at: float | None = None, direction: str = "", channel: str = ""
) -> Logged:
    fault = (
        "" if frame is not None else "a CAN FD frame, not classic CAN: these devices neither send nor hear it"
    )
    return Logged(text, frame, at, direction, channel, fault)


def _identifier(digits: str, word: str) -> tuple[int, bool]:
    if len(digits) not in _HIGHEST:
        raise _no_frame(word, "an identifier has 3 hexadecimal digits (11 bits) or 8 (29 bits)")
    identifier = int(digits, 16)
    error = (
        len(digits) == 8 and identifier >> 29 == 1
    )  # as SocketCAN flags the adapter's report of a bus error
    if identifier > _HIGHEST[len(digits)] and not error:
        raise _no_frame(word, f"identifiers of {len(digits)} digits end at {_HIGHEST[len(digits)]:X}")
    return identifier, len(digits) == 8 and not error


def _data(digits: str, word: str) -> bytes:
    try:
        data = bytes.fromhex(digits)
    except ValueError:
        raise _no_frame(word, "the data are pairs of 0-9 A-F") from None
    if len(data) > MOST:
        raise _no_frame(word, f"a classic CAN frame has {MOST} data bytes at most, this has {len(data)}")
    return data


def _no_frame(word: str, why: str) -> RequestError:
    return RequestError(
        f"{word.strip()[:60]!r} is no CAN frame: {why}",
        expected="as 625#2203600084030000, 00000625#40, 625#R",
    )
