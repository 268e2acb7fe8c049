"""Which wire an address means, so that two spellings of one port are known for one.

What the machine file says of a joint holds whatever the port is called: by a relative path, by a symbolic link, in
other letters, or by another name of the same host. The family is part of it: who speaks another protocol on the same
wire means other devices.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import NamedTuple

from motorbus.errors import MotorbusError

NETWORK = ("socket://", "rfc2217://")
"""Ports that are a server of the network."""


class Line(NamedTuple):
    """A family on a port; the port by the name under which it is locked, whatever the user called it."""

    family: str
    port: str

    @classmethod
    def of(cls, address: str) -> Line:
        """What this address means; nothing is opened. Raises RequestError for what is no address."""
        from motorbus.link.lock import real_name
        from motorbus.session import lock_name, parse_address

        spot = parse_address(address)
        port = spot.port
        with suppress(MotorbusError):  # an adapter that cannot be: whoever opens it is told
            port = lock_name(spot.bus, {}) or port  # many programs meet there, and it is locked by none
        return cls(spot.family, real_name(port))

    def is_same(self, other: Line) -> bool:
        """Whether both are one wire; names of hosts are looked up only where no more than they differ."""
        if self.family != other.family:
            return False
        return self.port == other.port or _one_server(self.port, other.port)


def same_line(one: str, other: str) -> bool:
    """Whether two addresses mean the same family on the same port. Raises RequestError for what is no address."""
    return Line.of(one).is_same(Line.of(other))


def _one_server(one: str, other: str) -> bool:
    if not (one.startswith(NETWORK) and other.startswith(NETWORK)):
        return False
    from motorbus.link.tcp import split_address

    with suppress(MotorbusError):
        (host, port), (second, its) = split_address(one), split_address(other)
        return port == its and (host == second or bool(_numbers(host) & _numbers(second)))
    return False


def _numbers(host: str) -> set[object]:
    """The addresses of a host; none where nobody knows it."""
    with suppress(OSError, UnicodeError):
        return {found[4][0] for found in socket.getaddrinfo(host, None)}
    return set()
