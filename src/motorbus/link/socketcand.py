"""socketcand servers: text over TCP that carries CAN frames.

python-can tries for ten seconds to reach a server, and waits without end for one that does not greet. So the server is
checked first, and every wait has a time-out. Source: protocol description of linux-can socketcand.
"""

from __future__ import annotations

import contextlib
import os
import re
import socket
import time
from typing import Any, Final

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError, PortNotFound, RequestError
from motorbus.link.can_channel import Counts, Port, TextChannel, open_bus
from motorbus.link.can_options import CanOptions
from motorbus.link.tcp import CONNECT_TIME, LOOPBACK_LATENCY, NETWORK_LATENCY, send_at_once

GREETING: Final = "< hi >"
REPLY_TIME: Final = 2.0  # s for each reply of the server
LONGEST: Final = 512  # bytes kept of an element without end; the longest element has fewer than 60
LONGEST_REPLY: Final = 256  # characters; the expected ones have six
CANCEL: Final = b" x >"  # ends an unfinished element and makes it invalid
_SOCKET: Final = "_SocketCanDaemonBus__socket"  # python-can offers neither its socket nor a descriptor
_ELEMENT: Final = re.compile(rb"<([^<>]*)>")
_IDENTIFIER: Final = re.compile(rb"[0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8}")
_SIZE: Final = re.compile(rb"[0-8]?")
_DATA: Final = re.compile(rb"(?:[0-9A-Fa-f]{2}){0,8}")


def encode(frame: CanFrame) -> bytes:
    """The element that sends this frame."""
    identifier = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
    if frame.id & REMOTE_FLAG:
        return f"< sendrtr {identifier} {len(frame.data)} >".encode()
    data = "".join(f"{byte:02X} " for byte in frame.data)
    return f"< send {identifier} {len(frame.data)} {data}>".encode()


class SocketcandDecoder:
    """Elements of a socketcand server in raw mode -> frames, as `Decoder`. Its error frames have eight zero bytes."""

    def __init__(self) -> None:
        self.counts = Counts()
        self._rest = b""

    def feed(self, data: bytes) -> list[CanFrame]:
        """The frames that these bytes complete. Never raises."""
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


def open_socketcand(options: CanOptions, back_end: Any) -> tuple[TextChannel, float]:
    """Open the channel; also its latency (s). Raises PortNotFound, LinkError, or what python-can raises."""
    check_server(options)

    class TimedBus(back_end):  # type: ignore[misc]
        """The back end with a time-out for every reply of the server."""

        def _expect_msg(self, msg: str) -> None:
            getattr(self, _SOCKET).settimeout(REPLY_TIME)
            super()._expect_msg(msg)

    bus = open_bus(TimedBus, options.channel, {"tcp_tune": os.name != "nt", **options.settings})
    connection: socket.socket = getattr(bus, _SOCKET)
    send_at_once(connection)
    connection.setblocking(False)
    near = connection.getpeername()[0].startswith("127.")

    def shut() -> None:
        with contextlib.suppress(Exception):  # it may be broken already
            bus.shutdown()

    port = Port(connection.recv, connection.send, connection.fileno())
    channel = TextChannel(options.name, port, SocketcandDecoder(), encode, CANCEL, shut)
    return channel, LOOPBACK_LATENCY if near else NETWORK_LATENCY


def check_server(options: CanOptions) -> None:
    """Check that a socketcand server answers and has the channel. Raises RequestError, PortNotFound or LinkError."""
    host, port = options.settings.get("host"), options.settings.get("port")
    if not host or not port or options.channel is None:
        raise RequestError(
            f"{options.name}: the server is missing", expected="can://socketcand/HOST:PORT/CHANNEL"
        )
    with socket.socket(socket.AF_INET) as connection:  # python-can has no IPv6
        connection.settimeout(CONNECT_TIME)
        try:
            connection.connect((str(host), int(port)))
        except (OSError, UnicodeError) as error:
            raise PortNotFound(
                f"{options.name} cannot be reached: {error}",
                advice="is the server or the simulator running, the port number right?",
            ) from error
        reply = _receive_reply(connection)
        if reply != GREETING:
            raise LinkError(
                f"{options.name}: it does not greet as a socketcand server does",
                received=reply,
                expected=GREETING,
                advice="is it another service, as a simulator's --tcp? That one is can://slcan/socket://HOST:PORT",
            )
        connection.sendall(f"< open {options.channel} >".encode())
        reply = _receive_reply(connection)
        if reply != "< ok >":
            raise LinkError(
                f"{options.name}: it does not open the channel {options.channel}",
                received=reply,
                expected="< ok >",
                advice="write can://socketcand/HOST:PORT/CHANNEL with a channel that the server has",
            )


def _receive_reply(connection: socket.socket) -> str:
    """One element; less when the server is silent, hangs up or sends too much."""
    reply = b""
    end = time.monotonic() + REPLY_TIME
    with contextlib.suppress(OSError):
        while b">" not in reply and len(reply) < LONGEST_REPLY and (left := end - time.monotonic()) > 0:
            connection.settimeout(left)
            data = connection.recv(LONGEST_REPLY)
            if not data:
                break
            reply += data
    return reply.decode("latin-1")
