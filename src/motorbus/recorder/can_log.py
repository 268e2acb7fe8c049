"""Recorded CAN frames: the text of candump is parsed here, ASC, BLF and TRC files by python-can."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import RequestError

MAX_DATA: Final = 8  # bytes of a classic CAN frame
TEXT: Final = (".log", ".txt", ".candump", "")
BINARY: Final = (".asc", ".blf", ".trc")
_SHOWN: Final = 60  # characters of a line in an error
_WORD: Final = re.compile(
    r"(?P<id>[0-9A-F]{3}|[0-9A-F]{8})#((?P<remote>R[0-8]?)|(?P<data>([0-9A-F]{2}\.?){0,8}))", re.I
)
_LOG: Final = re.compile(
    r"\((?P<at>\d{1,11}(?:\.\d*)?)\)\s+(?P<channel>\S+)\s+(?P<word>\S+#\S*)(?:\s+(?P<way>[RT]))?"
)
_SCREEN: Final = re.compile(
    r"(?:\((?P<at>\d{1,11}(?:\.\d*)?)\)\s+)?(?P<channel>\S+)\s+(?:(?P<way>RX|TX)\b[\s\-BE]*)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<length>\d{1,3})\]\s*(?P<data>.*?)\s*(?:'.*')?"
)
_EVENT: Final = re.compile(r"\s*\d+\.\d+\s+CANFD\s+(?!Rx\b|Tx\b)[A-Z]", re.I)
_WAYS: Final = {"R": "rx", "T": "tx", "RX": "rx", "TX": "tx", None: ""}


class Logged(NamedTuple):
    """One recorded frame.

    `frame`      None for a damaged line and a CAN FD frame; `fault` gives the reason
    `at`         time (s), since 1970 if it is above 1e8; None where the log has none
    `direction`  "rx" or "tx" as the recorder saw it, "" where the log has none
    `line`       number of a damaged line, else 0
    """

    text: str
    frame: CanFrame | None
    at: float | None = None
    direction: str = ""
    channel: str = ""
    fault: str = ""
    line: int = 0


def parse_word(word: str) -> CanFrame:
    """Parse `625#2203600084030000`: 3 digits are an 11-bit identifier, 8 a 29-bit one, `#R` a remote frame.

    Raises RequestError for any other text.
    """
    found = _WORD.fullmatch(word)
    if found is None:
        raise _invalid(word, "expected IDENTIFIER#DATA with 3 or 8 digits, and up to 8 pairs of digits")
    identifier = int(found["id"], 16)
    extended = len(found["id"]) == 8
    if extended and identifier >> 29 == 1:  # SocketCAN: the adapter reports a bus error
        extended = False
    elif identifier > (0x1FFFFFFF if extended else 0x7FF):
        raise _invalid(word, f"the highest identifier is {'1FFFFFFF' if extended else '7FF'}")
    if found["remote"]:
        return CanFrame(identifier | REMOTE_FLAG, b"", extended)
    return CanFrame(identifier, bytes.fromhex(found["data"].replace(".", "")), extended)


def parse_line(line: str) -> Logged | None:
    """Parse a line that candump prints or logs, or one frame; None for an empty line and a comment.

    Raises RequestError for any other line.
    """
    text = line.strip()
    if not text or text.startswith(("#", ";", "//")):
        return None
    if found := _LOG.fullmatch(text):
        word = found["word"]
    elif found := _SCREEN.fullmatch(text):
        data = found["data"].replace(" ", "").partition("ERRORFRAME")[0]
        word = f"{found['id']}#{'R' if data.startswith('remote') else data}"
    else:
        return Logged(text, parse_word(text))
    frame = parse_word(word)
    if (
        "length" in found.groupdict()
        and not frame.id & REMOTE_FLAG
        and found["length"] != str(len(frame.data))
    ):
        raise _invalid(text, f"its length is [{found['length']}], {len(frame.data)} bytes follow")
    at = float(found["at"]) if found["at"] else None
    return Logged(word, frame, at, _WAYS[found["way"]], found["channel"])


def read_lines(lines: Iterable[str]) -> Iterator[Logged]:
    """Read the text of candump. A damaged line gives a `Logged` with its number and fault."""
    for number, line in enumerate(lines, 1):
        try:
            found = parse_line(line)
        except RequestError as error:
            found = Logged(line.strip()[:_SHOWN], None, fault=error.summary, line=number)
        if found is not None:
            yield found


def read_log(path: Path) -> Iterator[Logged]:
    """Read every frame of a log: the text of candump, ASC, BLF or TRC, by the ending of its name.

    In the text of candump a damaged line gives a `Logged` with its number. python-can skips lines of ASC and TRC that
    do not look like frames. Raises RequestError for another ending, for a file that python-can cannot read, and with
    its number for a line that it cannot read; LinkError without python-can; OSError if the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix in BINARY:
        yield from _read_with_python_can(path, suffix)
    elif suffix in TEXT:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            yield from read_lines(file)
    else:
        names = ", ".join([*filter(None, TEXT), *BINARY])
        raise RequestError(
            f"{path}: not a log of CAN frames", expected=f"a name that ends in {names}, or in nothing"
        )


def _read_with_python_can(path: Path, suffix: str) -> Iterator[Logged]:
    from motorbus.link.can import python_can  # the one place where it is imported

    can = python_can(f"reading {path}")
    reader = {".asc": can.ASCReader, ".blf": can.BLFReader, ".trc": can.TRCReader}[suffix]
    first = 0 if suffix == ".trc" else 1  # channel: python-can numbers from 0 in ASC and BLF
    file = path.open("rb") if suffix == ".blf" else _CountedLines(path)
    try:
        for message in reader(file):
            if not message.is_remote_frame and len(message.data) < min(message.dlc, MAX_DATA):
                raise ValueError("data bytes are missing")
            yield _from_message(message, first)
    except OSError:
        raise
    except Exception as error:  # python-can documents no exceptions of its readers
        where = f"line {file.number} of " if isinstance(file, _CountedLines) else ""
        raise RequestError(
            f"{where}{path} cannot be read",
            cause="it is damaged or of another format",
            advice="correct the file",
        ) from error
    finally:
        file.close()


class _CountedLines:
    """The lines of a file for python-can's readers, without events that they take for CAN FD frames."""

    def __init__(self, path: Path) -> None:
        self._file: Final = path.open(encoding="utf-8-sig", errors="replace")
        self.close: Final = self._file.close
        self.number = 0

    def __iter__(self) -> Iterator[str]:
        for line in self._file:
            self.number += 1
            if not _EVENT.match(line):
                yield line


def _from_message(message: Any, first: int) -> Logged:
    data = bytes(message.data or b"")[:64]
    digits = 8 if message.is_extended_id else 3
    word = f"{message.arbitration_id:0{digits}X}#{data.hex().upper()}"
    channel = message.channel
    if isinstance(channel, int):
        channel += first
    frame: CanFrame | None
    if message.is_fd:
        frame = None
    elif message.is_error_frame:
        frame = CanFrame((message.arbitration_id & 0x1FFFFFFF) | ERROR_FLAG, data[:MAX_DATA])
    elif message.is_remote_frame:
        frame = CanFrame(message.arbitration_id | REMOTE_FLAG, b"", message.is_extended_id)
    else:
        frame = CanFrame(message.arbitration_id, data, message.is_extended_id)
    fault = "a CAN FD frame; these devices use classic CAN" if frame is None else ""
    direction = "rx" if message.is_rx else "tx"
    return Logged(word, frame, message.timestamp, direction, "" if channel is None else str(channel), fault)


def _invalid(word: str, reason: str) -> RequestError:
    return RequestError(f"{word[:_SHOWN]!r} is not a CAN frame: {reason}")
