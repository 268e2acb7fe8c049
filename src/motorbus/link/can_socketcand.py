"""A socketcand server: asked first whether it is one and has the channel, then opened by python-can.

python-can tries for ten seconds to reach a server that is not there, and waits without end for one that does not
greet. So somebody knocks first, and then each of its waits is given an end. Source: protocol description of linux-can
socketcand.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from typing import Any, Final

from motorbus.errors import LinkError, PortNotFound, RequestError
from motorbus.link.can_config import CanConfig
from motorbus.link.can_port import Descriptor, Port, SocketObject
from motorbus.link.can_text import SocketcandReader, socketcand_element
from motorbus.link.can_wire import TextWire, build, quietly
from motorbus.link.tcp import CONNECT_TIME, LOOPBACK_LATENCY, NETWORK_LATENCY, give_up_soon

GREETING: Final = b"< hi >"
ANSWER_TIME: Final = 2.0
"""s in which a server says each of its words."""
LONGEST: Final = 256
"""Characters of a word; the longest that is waited for has six."""
MEND: Final = b" x >"
"""Ends an element that went out in part, so that it is none."""
_SOCKET: Final = "_SocketCanDaemonBus__socket"
"""Where python-can keeps its connection; it offers no other way to it, and no descriptor."""


def open_socketcand(config: CanConfig, back_end: Any) -> tuple[TextWire, float]:
    """Open the channel, and tell its latency (s). Raises PortNotFound, LinkError, or what python-can raises."""
    settings = {"tcp_tune": os.name != "nt", **config.settings}
    knock(config)

    class Patient(back_end):  # type: ignore[misc]
        """python-can's, which waits for each word of the server without end."""

        def _expect_msg(self, msg: str) -> None:
            getattr(self, _SOCKET).settimeout(ANSWER_TIME)
            super()._expect_msg(msg)

    bus = build(Patient, config.channel, settings)
    connection: socket.socket = getattr(bus, _SOCKET)
    give_up_soon(connection)
    near = connection.getpeername()[0].startswith("127.")
    port: Port = SocketObject(connection) if os.name == "nt" else Descriptor(connection.fileno())
    wire = TextWire(
        config.name, port, SocketcandReader(), socketcand_element, MEND, lambda: quietly(bus.shutdown)
    )
    return wire, LOOPBACK_LATENCY if near else NETWORK_LATENCY


def knock(config: CanConfig) -> None:
    """Somebody is there, speaks socketcand and has this channel.

    Raises RequestError for an incomplete address, PortNotFound or LinkError.
    """
    host, port = config.settings.get("host"), config.settings.get("port")
    if not host or not port or config.channel is None:
        raise RequestError(
            f"{config.name}: no server was said", expected="can://socketcand/HOST:PORT/CHANNEL"
        )
    with socket.socket(socket.AF_INET) as connection:  # python-can knows no other
        connection.settimeout(CONNECT_TIME)
        try:
            connection.connect((str(host), int(port)))
        except (OSError, UnicodeError) as error:
            raise PortNotFound(
                f"{config.name} cannot be reached: {error}",
                advice="is the server or the simulator running, the port number right?",
            ) from error
        _expect(config, connection, GREETING, "it does not greet as a socketcand server does")
        connection.sendall(f"< open {config.channel} >".encode())
        _expect(config, connection, b"< ok >", f"it does not open the channel {config.channel}")


def _expect(config: CanConfig, connection: socket.socket, word: bytes, complaint: str) -> None:
    heard = b""
    end = time.monotonic() + ANSWER_TIME
    with contextlib.suppress(OSError):  # it said nothing, or went away
        while b">" not in heard and len(heard) < LONGEST and (left := end - time.monotonic()) > 0:
            connection.settimeout(left)
            more = connection.recv(LONGEST)
            if not more:
                break
            heard += more
    if heard != word:
        raise LinkError(
            f"{config.name}: {complaint}",
            received=heard.decode("latin-1"),
            expected=word.decode(),
            advice="say can://socketcand/HOST:PORT/CHANNEL with a channel that the server has"
            if word != GREETING
            else "is it another service, as a simulator's --tcp? That one is can://slcan/socket://HOST:PORT",
        )
