"""CAN traffic that somebody has recorded: candump text read here, ASC, BLF and TRC by python-can's readers.

Text needs nothing installed, so a line of candump can be explained anywhere; the other formats need python-can. What
is no classic CAN frame is told as such, never dropped, and so is a line that is damaged or cut off. In ASC and TRC
there are lines about other things as well, and what these readers pass over is told if it still looks like a frame.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple, TextIO

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import RequestError

MOST: Final = 8
"""Data bytes of a classic CAN frame."""
LONGEST: Final = 8192
"""Characters of a line at most: far more than a frame takes, and than what a cut of power leaves in a file (a page of
zeros). What goes on for longer has no lines, and would be read until the memory ends."""
_SHOWN: Final = 60
_GAPS: Final = {".asc": "\n", ".trc": ";\n"}
"""By ending: what stands in for the header where python-can's reader is begun anew behind a damaged line."""
_LIKE_A_FRAME: Final = {
    ".asc": re.compile(
        r"(?!.*J1939TP)(\d+\.\d+(\s+\d+(\s+[0-9A-F]+x?(\s|$)|$)|$)|\S+\s+\d+\s+\S+\s+(Rx|Tx)\b)", re.I
    ),
    ".trc": re.compile(
        r"(?!.*\sFFFFFFFF\s)(?!\d+\)?\s+\S+\s+(\d+\s+)?(Warng|Error|ST|EC|ER|EV)(\s|$))"
        r"(?!\d+\.\d+\s+(ST|EC|ER|EV)(\s|$))(\d+(\)$|\)?\s+\d)|\d+\.\d+(\s|$))"
    ),
}
"""By ending: what begins as a frame does, by a time, a channel and an identifier or so much of that as there is, or by
a number and a time, without the word of a status behind them; or has a direction in its place."""
_EVENT: Final = re.compile(r"\s*\d+\.\d+\s+CANFD\s+(?!Rx\b|Tx\b)[A-Z]", re.I)
"""A line of ASC about the measurement, where a frame has a channel; python-can's reader takes it for a frame."""
_BY_PYTHON_CAN: Final = (".asc", ".blf", ".trc")
_TEXT: Final = (".log", ".txt", ".candump", "")
_HIGHEST: Final = {3: 0x7FF, 8: 0x1FFFFFFF}
_DATE: Final = 1e8
"""s; a time below this is three years after 1970 at most, so it is counted from something else."""

_WORD: Final = re.compile(r"(?P<id>[0-9A-Fa-f]+)#(?P<data>.*)")
_LOG: Final = re.compile(
    r"\((?P<at>\d{1,11}(?:\.\d*)?)\)\s+(?P<channel>\S+)\s+(?P<word>\S+#\S*)(?:\s+(?P<way>[RT]))?\s*"
)
_SCREEN: Final = re.compile(
    r"\s*(?:\((?P<at>\d{1,11}(?:\.\d*)?)\)\s+)?(?P<channel>\S+)\s+(?:(?P<way>RX|TX)\b[\s\-BE]*)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<fd>0?)(?P<length>\d{1,3})\]\s*(?P<data>.*?)\s*(?:'.*')?"
)
_WAYS: Final = {"R": "rx", "T": "tx", "RX": "rx", "TX": "tx"}


class Logged(NamedTuple):
    """One recorded frame.

    `frame`      None for what is no classic CAN frame; `fault` says what it is instead
    `at`         s since 1970, or since some beginning if `relative`; None where nothing was noted
    `direction`  "rx" or "tx" as the recorder saw it, "" where it did not say
    `line`       the number of the line, where that is damaged and nobody knows what was in it; `fault` says why
    """

    text: str
    frame: CanFrame | None
    at: float | None = None
    direction: str = ""
    channel: str = ""
    fault: str = ""
    line: int = 0

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
    """Every frame in the text of candump, as it comes; a damaged line is told as such, in its place.

    Raises RequestError for a line that is longer than `LONGEST`.
    """
    for number, line in enumerate(lines, 1):
        _bound(line, number)
        try:
            found = parse_line(line)
        except RequestError as error:
            found = _damaged(line, number, error.summary)
        if found is not None:
            yield found


def lines_of(file: TextIO) -> Iterator[str]:
    """Its lines as they come, cut where they are longer than `LONGEST`."""
    return iter(partial(file.readline, LONGEST), "")


def read_log(path: Path) -> Iterator[Logged]:
    """Every frame in a file of candump (`.log`), ASC, BLF or TRC, in order.

    A damaged line is told as such. Raises RequestError for a file that is none of these or has no lines, LinkError
    where its format needs python-can and that is missing, OSError where it cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix in _TEXT:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            yield from read_lines(lines_of(file))
    elif suffix in _BY_PYTHON_CAN:
        yield from _by_python_can(path)
    else:
        raise RequestError(
            f"{path}: no log of CAN frames that is known here",
            expected=f"a name that ends in {', '.join(filter(None, _TEXT))} or in nothing (text of candump), or in "
            + ", ".join(_BY_PYTHON_CAN),
        )


def _by_python_can(path: Path) -> Iterator[Logged]:
    from motorbus.link.can import python_can  # the one place where it is imported

    can = python_can(f"reading {path}")
    reader = {".asc": can.ASCReader, ".blf": can.BLFReader, ".trc": can.TRCReader}[path.suffix.lower()]
    if reader is can.BLFReader:
        with path.open("rb") as binary:
            yield from _until_broken(path, binary, reader)
    else:
        with path.open(encoding="utf-8-sig", errors="replace") as text:
            yield from _line_by_line(path, _Lines(text, path.suffix.lower()), reader)


def _until_broken(path: Path, file: Any, reader: Any) -> Iterator[Logged]:
    try:
        yield from (_from_message(message, 1) for message in reader(file))
    except OSError:
        raise
    except Exception as error:  # what its readers raise for a broken file is theirs to choose
        raise _unreadable(path, error) from error


def _line_by_line(path: Path, lines: _Lines, reader: Any) -> Iterator[Logged]:
    """What python-can's reader cannot read of a text is told with the number of the line, and it reads on behind it."""
    begun = -1
    messages = reader(lines)
    while True:
        try:
            for message in messages:
                yield from lines.passed_over(but_last=True)
                found = _from_message(message, int(path.suffix.lower() == ".asc"))
                short = found.frame is not None and _is_short(message)
                yield (
                    _damaged(lines.last, lines.number, "more data bytes are announced than stand there")
                    if short
                    else found
                )
            yield from lines.passed_over(but_last=False)
            return
        except (OSError, RequestError):
            raise
        except Exception as error:  # as above
            if lines.number == begun:  # it is not the line that it cannot read
                raise _unreadable(path, error) from error
            yield from lines.passed_over(but_last=True)
            if not _EVENT.match(lines.last):
                yield _damaged(lines.last, lines.number, f"{lines.last.strip()[:_SHOWN]!r} cannot be read")
        begun = lines.number
        lines.again()


def _is_short(message: Any) -> bool:
    plain = not (message.is_remote_frame or message.is_error_frame)
    return plain and len(message.data or b"") < min(message.dlc, MOST)


def _unreadable(path: Path, error: Exception) -> RequestError:
    return RequestError(
        f"{path}: cannot be read as {path.suffix}", cause="it is damaged or of another format"
    )


class _Lines:
    """A text file as python-can's readers take one: they ask for its lines, and close it.

    `last` is the line that was read last, and `number` says which. After `again` a reader is begun anew in the midst:
    what looks for a header first gets what stands in for one, behind which its messages begin.
    """

    def __init__(self, file: TextIO, suffix: str) -> None:
        self.close: Final = file.close
        self.last = ""
        self.number = 0
        self._lines: Final = lines_of(file)
        self._gap: Final = _GAPS[suffix]
        self._frame: Final = _LIKE_A_FRAME[suffix]
        self._begun_anew = False
        self._like: list[Logged] = []

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        if self._begun_anew:
            self._begun_anew = False
            return self._gap
        self.last = next(self._lines)
        self.number += 1
        _bound(self.last, self.number)
        if self._frame.match(self.last.strip()):
            self._like.append(
                _damaged(self.last, self.number, "it looks like a frame and cannot be read as one")
            )
        return self.last

    def passed_over(self, *, but_last: bool) -> list[Logged]:
        """What was read since this was asked last, looks like a frame and gave none; not the last line if that did."""
        like, self._like = self._like, []
        return [one for one in like if not (but_last and one.line == self.number)]

    def again(self) -> None:
        """A reader begins anew."""
        self._begun_anew = True


def _bound(line: str, number: int) -> None:
    if len(line) >= LONGEST:
        raise RequestError(
            f"line {number} is longer than {LONGEST} characters, so this is no text that holds CAN frames",
            expected="a line for each frame",
        )


def _damaged(line: str, number: int, why: str) -> Logged:
    return Logged(line.strip()[:_SHOWN], None, fault=why, line=number)


def _from_message(message: Any, first: int) -> Logged:
    """`first` is the lowest channel in the file; python-can's readers of ASC and BLF call it 0."""
    identifier = message.arbitration_id
    word = f"{identifier:0{8 if message.is_extended_id else 3}X}#{bytes(message.data or b'').hex().upper()}"
    direction = "rx" if message.is_rx else "tx"
    channel = "" if message.channel is None else str(message.channel)
    if isinstance(message.channel, int):
        channel = str(message.channel + first)
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
        return _logged(
            f"{found['id']}##{data.replace(' ', '')}", None, at, _WAYS.get(found["way"], ""), found["channel"]
        )
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
        f"{word.strip()[:_SHOWN]!r} is no CAN frame: {why}",
        expected="as 625#2203600084030000, 00000625#40, 625#R",
    )
