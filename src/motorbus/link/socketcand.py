"""socketcand servers: text over TCP that carries CAN frames.

The back end of python-can tries for ten seconds to reach a server, waits without end for its greeting and does not
notice its end. Source: protocol description of linux-can socketcand.
"""

from __future__ import annotations

import contextlib
import re
import time
from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.link.can_options import CanOptions
from motorbus.link.can_text import LONGEST, TextChannel, TextCodec
from motorbus.link.lock import PortLock
from motorbus.link.tcp import CONNECT_TIME, TcpLink

REPLY_TIME: Final = 2.0  # s for each reply of the server
RATE: Final = 1_000_000  # bit/s; the line behind the server is a CAN bus, so this has no effect
_FRAME: Final = re.compile(
    rb"\s*(frame|rtr|error)\s+([0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8})\s+[\d.]+\s*([0-9A-Fa-f\s]*)"
)


class SocketcandCodec(TextCodec):
    """Elements of socketcand in raw mode. The data of an error frame is eight zero bytes."""

    line = re.compile(rb"([^>]*)>")
    cancel = b" x >"

    def encode(self, frame: CanFrame) -> bytes:
        identifier = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
        if frame.id & REMOTE_FLAG:
            return f"< sendrtr {identifier} {len(frame.data)} >".encode()
        data = "".join(f"{byte:02X} " for byte in frame.data)
        return f"< send {identifier} {len(frame.data)} {data}>".encode()

    def decode(self, line: re.Match[bytes]) -> CanFrame | None:
        before, begin, element = line[1].rpartition(b"<")
        name = element.split(None, 1)[:1]
        if before.strip() or not begin:
            self.damaged += 1
        if begin and (match := _FRAME.fullmatch(element)):
            with contextlib.suppress(ValueError):
                return _decode_frame(match)
        self.damaged += name in ([b"frame"], [b"rtr"])
        self.refused += name == [b"error"]
        return None


def _decode_frame(match: re.Match[bytes]) -> CanFrame:
    """Raises ValueError for what is no frame."""
    name, identifier, rest = match.groups()
    number, extended = int(identifier, 16), len(identifier) == 8
    digits = b"".join(rest.split())
    if name == b"error":
        return CanFrame(number & (ERROR_FLAG - 1) | ERROR_FLAG, bytes(8))
    data = bytes(int(digits or b"0")) if name == b"rtr" else bytes.fromhex(digits.decode())
    if len(data) > 8 or number > (0x1FFF_FFFF if extended else 0x7FF):
        raise ValueError(rest)
    return CanFrame(number | REMOTE_FLAG if name == b"rtr" else number, data, extended)


def open_socketcand(options: CanOptions, connect_time: float | None) -> TextChannel:
    """Connect to the server and open the channel in raw mode. Raises RequestError, PortNotFound or LinkError."""
    host, port = options.settings.get("host"), options.settings.get("port")
    if not host or not port or not options.channel:
        raise RequestError(
            f"{options.name} does not name a channel of a server",
            expected="can://socketcand/HOST:PORT/CHANNEL, as can://socketcand/localhost:29536/can0",
        )
    url = f"socket://{host}:{port}"
    lock = PortLock(url)  # the caller has locked the channel; a server may have several
    link = TcpLink(url, rate=RATE, lock=lock, connect_time=connect_time or CONNECT_TIME)
    try:
        _expect(options.name, link, "< hi >", "it does not greet as a socketcand server does")
        for command in (f"open {options.channel}", "rawmode"):
            link.write(f"< {command} >".encode())
            _expect(options.name, link, "< ok >", f"the server refuses `{command}`")
    except BaseException:
        link.close()
        raise
    return TextChannel(options.name, link, SocketcandCodec())


def _expect(name: str, link: TcpLink, expected: str, failure: str) -> None:
    """Receive one element. Raises LinkError when it is another, or the server is silent or hangs up."""
    text = b""
    end = time.monotonic() + REPLY_TIME
    with contextlib.suppress(LinkError):
        while b">" not in text and len(text) < LONGEST and time.monotonic() < end:
            text += b"".join(data for data in link.read(end) if isinstance(data, bytes))
    received = (text[: text.find(b">") + 1] or text).decode("latin-1")
    if received != expected:
        raise LinkError(
            f"{name}: {failure}",
            received=received,
            expected=expected,
            advice="write can://socketcand/HOST:PORT/CHANNEL; a simulator's --tcp is can://slcan/socket://HOST:PORT",
        )
