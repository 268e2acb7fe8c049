"""socketcand servers: text over TCP that carries CAN frames.

The back end of python-can tries for ten seconds to reach a server, waits without end for its greeting and does not
notice its end. So this one goes over our own TCP link. Source: protocol description of linux-can socketcand.
"""

from __future__ import annotations

import contextlib
import re
from typing import Final

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.link.can_channel import Counts, TextChannel
from motorbus.link.can_options import CanOptions
from motorbus.link.lock import PortLock
from motorbus.link.tcp import CONNECT_TIME, TcpLink

GREETING: Final = b"< hi >"
ACCEPTED: Final = b"< ok >"
REPLY_TIME: Final = 2.0  # s for each reply of the server
RATE: Final = 1_000_000  # bit/s; the line behind the server is a CAN bus, so this has no effect
LONGEST: Final = 512  # bytes kept of an element without end; the longest element has fewer than 60
_ELEMENT: Final = re.compile(rb"<([^<>]*)>")
_IDENTIFIER: Final = re.compile(rb"[0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8}")
_SIZE: Final = re.compile(rb"[0-8]?")
_DATA: Final = re.compile(rb"(?:[0-9A-Fa-f]{2}){0,8}")


class SocketcandCodec:
    """Elements of socketcand in raw mode, as `Codec`. Its error frames have eight zero bytes."""

    cancel = b" x >"

    def __init__(self) -> None:
        self.counts = Counts()
        self._rest = b""

    def encode(self, frame: CanFrame) -> bytes:
        identifier = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
        if frame.id & REMOTE_FLAG:
            return f"< sendrtr {identifier} {len(frame.data)} >".encode()
        data = "".join(f"{byte:02X} " for byte in frame.data)
        return f"< send {identifier} {len(frame.data)} {data}>".encode()

    def feed(self, data: bytes) -> list[CanFrame]:
        text = self._rest + data
        frames = []
        end = 0
        for element in _ELEMENT.finditer(text):
            self.counts.damaged += bool(text[end : element.start()].strip())
            end = element.end()
            name, *words = element[1].split() or [b""]
            if name in (b"frame", b"rtr") or (name == b"error" and len(words) == 2):
                try:
                    frames.append(_frame(name, words))
                    continue
                except ValueError:
                    self.counts.damaged += name != b"error"
            self.counts.refused += name == b"error"
        self._rest = text[end:]
        if len(self._rest) > LONGEST:
            self._rest = b""
            self.counts.damaged += 1
        return frames


def _frame(name: bytes, words: list[bytes]) -> CanFrame:
    """Raises ValueError for what is no frame."""
    identifier, moment, *rest = [*words, b"", b""][: max(len(words), 2)]
    float(moment)
    number, extended = int(identifier, 16), len(identifier) == 8
    if name == b"error":
        return CanFrame(number & (ERROR_FLAG - 1) | ERROR_FLAG, bytes(8))
    digits = b"".join(rest)
    is_valid = _IDENTIFIER.fullmatch(identifier) and (_SIZE if name == b"rtr" else _DATA).fullmatch(digits)
    if not is_valid or number > (0x1FFF_FFFF if extended else 0x7FF):
        raise ValueError(words)
    if name == b"rtr":
        return CanFrame(number | REMOTE_FLAG, bytes(int(digits or b"0")), extended)
    return CanFrame(number, bytes.fromhex(digits.decode()), extended)


def open_socketcand(options: CanOptions, connect_time: float | None) -> TextChannel:
    """Connect to the server and open the channel in raw mode. Raises RequestError, PortNotFound or LinkError."""
    host, port = options.settings.get("host"), options.settings.get("port")
    if not host or not port or options.channel is None:
        raise RequestError(
            f"{options.name}: the server is missing", expected="can://socketcand/HOST:PORT/CHANNEL"
        )
    url = f"socket://{host}:{port}"
    unlocked = PortLock(url).borrow()  # the lock is that of the channel; a server may have several
    link = TcpLink(url, rate=RATE, lock=unlocked, connect_time=connect_time or CONNECT_TIME)
    try:
        greeting = _receive(link)
        if greeting != GREETING:
            raise LinkError(
                f"{options.name}: it does not greet as a socketcand server does",
                received=greeting.decode("latin-1"),
                expected=GREETING.decode(),
                advice="is it another service, as a simulator's --tcp? That one is can://slcan/socket://HOST:PORT",
            )
        for command in (f"open {options.channel}", "rawmode"):
            link.write(f"< {command} >".encode())
            reply = _receive(link)
            if reply != ACCEPTED:
                raise LinkError(
                    f"{options.name}: the server refuses `{command}`",
                    received=reply.decode("latin-1"),
                    expected=ACCEPTED.decode(),
                    advice="write can://socketcand/HOST:PORT/CHANNEL with a channel that the server has",
                )
    except BaseException:
        link.close()
        raise
    return TextChannel(options.name, link, SocketcandCodec())


def _receive(link: TcpLink) -> bytes:
    """One element; less when the server is silent, hangs up or sends too much. Frames after it are dropped."""
    text = b""
    end = link.now() + REPLY_TIME
    with contextlib.suppress(LinkError):
        while b">" not in text and len(text) < LONGEST and link.now() < end:
            if link.wait(end):
                text += link.receive()
    return text[: text.find(b">") + 1] or text
