"""The host's side of the two text protocols that carry CAN frames over bytes: slcan lines, socketcand elements.

python-can opens and sets up such an adapter; what comes from it is read here. python-can reads a serial adapter byte by
byte, raises at a damaged line and cannot go on after it, overlooks that an adapter refused something, and never
notices that a server has hung up. Sources: LAWICEL CAN232 manual, protocol description of linux-can socketcand.
"""

from __future__ import annotations

import re
from typing import Final, Protocol

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame

LONGEST: Final = 512
"""Bytes kept of a line or an element that does not end; the longest has fewer than 60."""
KEPT: Final = 16
"""Answers kept; a dialogue has three, and after it every frame that is sent brings one."""
STAMP: Final = 4
"""Hexadecimal digits of a timestamp that an slcan adapter may append."""

_LINE: Final = re.compile(
    rb"(?:([tr])([0-7][0-9A-Fa-f]{2})|([TRx])([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)
_FLEXIBLE: Final = b"dDbB"  # CAN FD, as CANable 2 writes it
_ANSWERS: Final = re.compile(rb"(?:[zZAQ]?|[VNF][0-9A-Za-z]{2,8})")
_END: Final = re.compile(rb"[\r\a]")
_ELEMENT: Final = re.compile(rb"<([^<>]*)>")
_ID: Final = re.compile(rb"[0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8}")


class Reader(Protocol):
    """Bytes of the adapter, cut anywhere -> frames.

    `damaged`  lines that are no frame, or whose length disagrees with their data
    `refused`  times the adapter said no
    `foreign`  frames that are no classic CAN
    """

    damaged: int
    refused: int
    foreign: int

    def feed(self, data: bytes) -> list[CanFrame]:
        """The frames that are complete with these bytes. Never raises."""


class SlcanReader:
    """What an slcan adapter says, as `Reader`.

    `answers` are its first answers since `forget`, in order: True for yes (CR), False for no (BEL). Timestamps
    are known by their length. So that a damaged length digit does not pass for one, a frame must have the form of
    the frame before; two in a row of the other form make it the usual one.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self.refused = 0
        self.foreign = 0
        self.answers: list[bool] = []
        self._rest = b""
        self._stamped = False
        self._other_form = 0

    def forget(self) -> None:
        """A new dialogue begins: what came before answers nothing that is asked now."""
        self.answers.clear()
        self._rest = b""

    def feed(self, data: bytes) -> list[CanFrame]:
        text = self._rest + data
        frames = []
        begin = 0
        for end in _END.finditer(text):
            line, begin = text[begin : end.start()].strip(b"\n"), end.end()
            if end[0] == b"\a":
                self._no(line)
            elif (frame := self._yes(line)) is not None:
                frames.append(frame)
        self._rest = text[begin:]
        if len(self._rest) > LONGEST:
            self._rest = b""
            self.damaged += 1
        return frames

    def _no(self, line: bytes) -> None:
        self.refused += 1
        self._answered(False)
        self.damaged += bool(line)

    def _answered(self, yes: bool) -> None:
        if len(self.answers) < KEPT:
            self.answers.append(yes)

    def _yes(self, line: bytes) -> CanFrame | None:
        frame = _LINE.fullmatch(line)
        if frame is not None:
            return self._frame(frame)
        if _ANSWERS.fullmatch(line):
            self._answered(True)
        elif line[:1] in _FLEXIBLE:
            self.foreign += 1
        else:
            self.damaged += 1
        return None

    def _frame(self, line: re.Match[bytes]) -> CanFrame | None:
        standard, short, extended, long, count, digits = line.groups()
        remote = (standard or extended) in b"rR"
        surplus = len(digits) - (0 if remote else 2 * int(count))
        if surplus not in (0, STAMP) or not self._is_usual(surplus == STAMP):
            self.damaged += 1
            return None
        id = int(short or long, 16)
        if remote:
            return CanFrame(id | REMOTE_FLAG, bytes(int(count)), extended is not None)
        return CanFrame(id, bytes.fromhex(digits[: 2 * int(count)].decode()), extended is not None)

    def _is_usual(self, stamped: bool) -> bool:
        if stamped == self._stamped:
            self._other_form = 0
            return True
        self._other_form += 1
        if self._other_form < 2:
            return False
        self._stamped, self._other_form = stamped, 0
        return True


class SocketcandReader:
    """What a socketcand server says in raw mode, as `Reader`. Its error frames tell no details: eight zero bytes."""

    def __init__(self) -> None:
        self.damaged = 0
        self.refused = 0
        self.foreign = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[CanFrame]:
        text = self._rest + data
        frames = []
        end = 0
        for element in _ELEMENT.finditer(text):
            self.damaged += bool(text[end : element.start()].strip())
            end = element.end()
            if (frame := self._element(element[1])) is not None:
                frames.append(frame)
        self._rest = text[end:]
        if len(self._rest) > LONGEST:
            self._rest = b""
            self.damaged += 1
        return frames

    def _element(self, text: bytes) -> CanFrame | None:
        name, *words = text.split()[:3] or [b""]
        if name in (b"frame", b"rtr") or (name == b"error" and len(words) == 2):
            try:
                return _frame(name, words, b"".join(text.split()[3:]))
            except ValueError:
                self.damaged += name != b"error"
        self.refused += name == b"error"
        return None


def _frame(name: bytes, words: list[bytes], rest: bytes) -> CanFrame:
    """Raises ValueError for what is no frame."""
    id, at = words
    float(at)
    if name == b"error":
        return CanFrame(int(id, 16) & (ERROR_FLAG - 1) | ERROR_FLAG, bytes(8))
    if not _ID.fullmatch(id):
        raise ValueError(id)
    number, extended = int(id, 16), len(id) == 8
    if number > (0x1FFF_FFFF if extended else 0x7FF):
        raise ValueError(id)
    if len(rest) > 16 or (name == b"rtr" and rest[1:]):
        raise ValueError(rest)
    data = bytes(int(rest or b"0")) if name == b"rtr" else bytes.fromhex(rest.decode())
    if len(data) > 8:
        raise ValueError(rest)
    return CanFrame(number | (REMOTE_FLAG if name == b"rtr" else 0), data, extended)


def slcan_line(frame: CanFrame) -> bytes:
    """A frame as an slcan adapter sends it."""
    remote = frame.id & REMOTE_FLAG
    id = frame.id & ~REMOTE_FLAG
    letter = ("R" if remote else "T") if frame.extended else ("r" if remote else "t")
    digits = "" if remote else frame.data.hex().upper()
    return f"{letter}{id:0{8 if frame.extended else 3}X}{len(frame.data)}{digits}\r".encode()


def socketcand_element(frame: CanFrame) -> bytes:
    """A frame as a socketcand server sends it."""
    id = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
    if frame.id & REMOTE_FLAG:
        return f"< sendrtr {id} {len(frame.data)} >".encode()
    data = "".join(f"{byte:02X} " for byte in frame.data)
    return f"< send {id} {len(frame.data)} {data}>".encode()
