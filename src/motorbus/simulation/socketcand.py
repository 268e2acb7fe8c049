"""The server's side of socketcand, the text protocol that carries CAN over TCP.

A simulated bus speaks it, so that every program that knows socketcand can open it, on a machine without CAN as well.
No I/O and no clock: bytes go in, frames and answers come out. Sources: the protocol description of linux-can
socketcand, and its server for what that leaves open.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import inf
from typing import Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame

PORT: Final = 29536
"""The usual TCP port."""
LONGEST_NAME: Final = 16
LONGEST_ELEMENT: Final = 4096
"""Characters kept of one element that does not end."""
SETTLING: Final = 0.05
"""s after the answer to `rawmode` in which the host misses the frames of the bus, unless it says something sooner:
hosts such as python-can demand that the answer arrives alone."""

UNKNOWN: Final = b"< error unknown command >"
_ELEMENT: Final = re.compile(rb"<([^<>]*)>")
_ID: Final = re.compile(r"[0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8}")
_BYTE: Final = re.compile(r"[0-9A-Fa-f]{1,2}")
_NUMBER: Final = re.compile(r"[0-9]{1,9}")
_MODES: Final = ("bcmmode", "rawmode", "controlmode")
_CYCLIC: Final = ("add", "update", "delete")


class Subscription(NamedTuple):
    """What a host wants to see of one identifier: not oftener than `interval` (s), and with a `mask` only when one
    of its bits has changed."""

    interval: float
    mask: bytes | None
    last_at: float | None = None
    last: bytes = b""


class SocketcandAdapter:
    """One connection, as `adapter.Adapter`.

    `epoch` (s) is added to the moments of frames, so that hosts get the time of day. Cyclic sending (add, update,
    delete), muxfilter and isotpmode are answered by an error.
    """

    listen_only = False
    bitrate: int | None = None  # the rate is the server's

    def __init__(self, *, epoch: float = 0.0) -> None:
        self.epoch = epoch
        self.open = False
        self.finished = False
        self.mode = ""
        self._text = b""
        self._answer = bytearray()
        self._frames: list[CanFrame] = []
        self._subscriptions: dict[tuple[int, bool], Subscription] = {}
        self._settled_at = -inf
        self._counts = [0, 0, 0, 0]  # bytes and frames received, bytes and frames sent
        self._statistics = 0.0
        self._told_at = 0.0

    def greet(self) -> bytes:
        """The first word is the server's."""
        return b"< hi >"

    def feed(self, data: bytes, at: float = 0.0) -> list[CanFrame]:
        """Bytes of the host, cut anywhere: the frames it sends with them. Never raises."""
        self._text += data
        end = 0
        for element in _ELEMENT.finditer(self._text):
            end = element.end()
            if not self.finished:
                self._obey(element[1].decode("latin-1").split(), at)
        self._text = self._text[end:]
        start = self._text.rfind(b"<")
        self._text = self._text[start:] if start >= 0 and len(self._text) - start < LONGEST_ELEMENT else b""
        frames, self._frames = self._frames, []
        return frames

    def take(self) -> bytes:
        """The answers to what was fed."""
        answer = bytes(self._answer)
        self._answer.clear()
        return answer

    def deliver(self, frame: CanFrame, at: float) -> bytes:
        """A frame of the bus, seen at this moment (s), as the host gets it in the mode it has chosen."""
        if not self.open:
            return b""
        self._count(0, frame)
        if self.mode == "rawmode":
            return _element(frame, at + self.epoch) if at >= self._settled_at else b""
        if self.mode == "bcmmode":
            return self._subscribed(frame, at)
        if self._statistics and at - self._told_at >= self._statistics:
            self._told_at = at
            return self._stat()
        return b""

    # -- one element ----------------------------------------------------------------------------------------

    def _obey(self, words: list[str], at: float) -> None:
        name, arguments = (words[0], words[1:]) if words else ("", [])
        self._settled_at = -inf  # it has read our last answer, for it goes on
        if name == "echo" and not arguments and self.open:
            self._answer += b"< echo >"
        elif not self.open:
            self._open(name, arguments)
        elif name in _MODES and not arguments:
            self._switch(name, at)
        elif self.mode in ("bcmmode", "rawmode") and name in ("send", "sendrtr"):
            self._send(arguments, remote=name == "sendrtr")
        elif self.mode == "bcmmode" and name in ("subscribe", "filter", "unsubscribe"):
            self._subscribe(name, arguments)
        elif self.mode == "bcmmode" and name in _CYCLIC:
            self._answer += b"< error cyclic sending is not simulated >"
        elif self.mode == "controlmode" and name == "statistics":
            self._set_statistics(arguments)
        else:
            self._answer += UNKNOWN

    def _open(self, name: str, arguments: Sequence[str]) -> None:
        if name != "open":
            self._answer += UNKNOWN
        elif len(arguments) == 1 and len(arguments[0]) <= LONGEST_NAME:
            self.open, self.mode = True, "bcmmode"
            self._answer += b"< ok >"
        else:
            self.finished = True
            self._answer += b"< error could not open bus >"

    def _switch(self, mode: str, at: float) -> None:
        if mode != self.mode:
            self._subscriptions.clear()
            self._statistics = 0.0
        self.mode = mode
        self._settled_at = at + SETTLING
        self._answer += b"< ok >"

    def _send(self, arguments: Sequence[str], *, remote: bool) -> None:
        """A frame; one that is malformed is ignored without a word, as the server does."""
        frame = _remote(arguments) if remote else _frame(arguments)
        if frame is not None:
            self._count(2, frame)
            self._frames.append(frame)

    def _subscribe(self, name: str, arguments: Sequence[str]) -> None:
        if name == "unsubscribe":
            one = _id(arguments[0]) if len(arguments) == 1 else None
            if one is not None:
                self._subscriptions.pop(one, None)
            return
        times, rest = arguments[:2], arguments[2:]
        if len(times) < 2 or not all(map(_NUMBER.fullmatch, times)):
            return
        interval = int(times[0]) + int(times[1]) / 1e6
        if name == "filter":
            frame = _frame(rest)
            if frame is not None:
                self._subscriptions[frame.id, frame.extended] = Subscription(interval, frame.data)
        elif len(rest) == 1 and (one := _id(rest[0])) is not None:
            self._subscriptions[one] = Subscription(interval, None)

    def _set_statistics(self, arguments: Sequence[str]) -> None:
        if len(arguments) == 1 and _NUMBER.fullmatch(arguments[0]):
            self._statistics = int(arguments[0]) / 1000
            if self._statistics:
                self._answer += self._stat()

    # -- to the host ----------------------------------------------------------------------------------------

    def _subscribed(self, frame: CanFrame, at: float) -> bytes:
        key = frame.id, frame.extended
        wanted = self._subscriptions.get(key)
        if wanted is None:
            return b""
        first = wanted.last_at is None
        if not first and at - (wanted.last_at or 0.0) < wanted.interval:
            return b""
        if not first and wanted.mask is not None and not _differ(frame.data, wanted.last, wanted.mask):
            return b""
        self._subscriptions[key] = wanted._replace(last_at=at, last=frame.data)
        return _element(frame, at + self.epoch, between=" ")

    def _count(self, place: int, frame: CanFrame) -> None:
        self._counts[place] += len(frame.data)
        self._counts[place + 1] += 1

    def _stat(self) -> bytes:
        return b"< stat %d %d %d %d >" % tuple(self._counts)


def _differ(data: bytes, last: bytes, mask: bytes) -> bool:
    if len(data) != len(last):
        return True
    return any((one ^ other) & bits for one, other, bits in zip(data, last, mask, strict=False))


def _id(text: str) -> tuple[int, bool] | None:
    """Three digits are an 11-bit identifier, eight a 29-bit one."""
    if not _ID.fullmatch(text):
        return None
    number, extended = int(text, 16), len(text) == 8
    return (number, extended) if number <= (0x1FFF_FFFF if extended else 0x7FF) else None


def _frame(words: Sequence[str]) -> CanFrame | None:
    """ID, LENGTH and so many bytes."""
    one = _id(words[0]) if len(words) >= 2 else None
    data = words[2:]
    if one is None or not re.fullmatch("[0-8]", words[1]) or len(data) != int(words[1]):
        return None
    if not all(map(_BYTE.fullmatch, data)):
        return None
    return CanFrame(one[0], bytes(int(byte, 16) for byte in data), one[1])


def _remote(words: Sequence[str]) -> CanFrame | None:
    one = _id(words[0]) if len(words) == 2 else None
    if one is None or not re.fullmatch("[0-8]", words[1]):
        return None
    return CanFrame(one[0] | REMOTE_FLAG, bytes(int(words[1])), one[1])


def _element(frame: CanFrame, at: float, between: str = "") -> bytes:
    moment = f"{at:.6f}"
    if frame.id & ERROR_FLAG:
        return f"< error {frame.id & (ERROR_FLAG - 1):03X} {moment} >".encode()
    id = f"{frame.id & (ERROR_FLAG - 1):0{8 if frame.extended else 3}X}"
    if frame.id & REMOTE_FLAG:
        return f"< rtr {id} {moment} {len(frame.data)} >".encode()
    data = frame.data.hex(between).upper() if between else frame.data.hex().upper()
    return f"< frame {id} {moment} {data} >".encode()
