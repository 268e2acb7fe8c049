"""The programs on a simulated bus: each with its connection and, on CAN, with the adapter it believes to talk to.

A serial line has one client, who gets the bytes as they are. On CAN there may be several at once, by different
protocols; each has an adapter of its own, and frames that one sends are seen by the others.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import deepcopy
from typing import Any, Final, Protocol

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.simulation.adapter import Adapter
from motorbus.simulation.listener import TcpClient, TcpPort

MOST_CLIENTS: Final = 16
_UNREAD: Final = 4096
"""Bytes kept for a client who does not read."""


class Endpoint(Protocol):
    """A port that a client opens: `pty.PtyMaster`, `listener.TcpListener` or `TcpClient`. Nothing of it blocks."""

    def fileno(self) -> int:
        """Turns readable when there is something to `read`."""

    def read(self) -> bytes:
        """What clients have sent; b"" when nothing."""

    def write(self, data: bytes) -> int:
        """Send to the client; returns how many bytes had room."""

    def rate(self) -> int | None:
        """Bit/s that the client has set; None: unknown."""


class Participant(ABC):
    """Whoever takes part in a simulated bus beside the devices.

    `lost` counts what found no room because it does not read: bytes of a serial line, else frames. `shared`: behind it
    is a bus with devices of others. `real` names a bus on which there may be real ones; "": there are none.
    """

    lost = 0
    shared = False
    real = ""

    @abstractmethod
    def fileno(self) -> int | None:
        """Turns readable when it has said something; None: ask `read` with patience instead."""

    @abstractmethod
    def read(self, at: float, patience: float = 0.0) -> list[Data]:
        """What it has said, at this moment (s); without a descriptor it waits so long (s) for the first of it."""

    @abstractmethod
    def tell(self, data: Data, at: float) -> None:
        """It gets this, seen at this moment (s), with the next `flush`."""

    def flush(self) -> None:  # noqa: B027 - who sends at once has nothing to do here
        """Send what it has been told."""

    def rate(self) -> int | None:
        """Bit/s that it has set; None when it has not."""
        return None

    def is_stuck(self) -> bool:
        """A part of what it was told has had no room yet; wait until it is writable."""
        return False

    def is_gone(self) -> bool:
        """It has left, or is to be left."""
        return False

    @property
    def fixed(self) -> str:
        """Why its port cannot be pulled; "" when it can."""
        return "this channel is not ours to pull"

    def unplug(self) -> None:  # noqa: B027 - whose port cannot be pulled is not asked to
        """The port vanishes, and whoever has it open loses it."""

    def plug(self) -> None:  # noqa: B027 - as above
        """The port is there again, as new."""

    def close(self) -> None:  # noqa: B027 - most do not own their port
        """Hang up."""


class SerialClient(Participant):
    """Whoever has the port of a simulated serial line open: bytes as they are, and what has no room is lost.

    `follows`: the bit rate that it has set matters.
    """

    def __init__(self, endpoint: Endpoint, *, follows: bool = False) -> None:
        self._endpoint = endpoint
        self._follows = follows
        self._out = bytearray()

    @property
    def fixed(self) -> str:
        return _fixed(self._endpoint)

    def unplug(self) -> None:
        self._out.clear()
        _pullable(self._endpoint).unplug()

    def plug(self) -> None:
        _pullable(self._endpoint).plug()

    def fileno(self) -> int:
        return self._endpoint.fileno()

    def read(self, at: float, patience: float = 0.0) -> list[Data]:
        data = self._endpoint.read()
        return [data] if data else []

    def rate(self) -> int | None:
        return self._endpoint.rate() if self._follows else None

    def tell(self, data: Data, at: float) -> None:
        if isinstance(data, CanFrame):
            raise RequestError("this simulator speaks CAN frames, which a serial line cannot carry")
        self._out += data

    def flush(self) -> None:
        if self._out:
            self.lost += len(self._out) - self._endpoint.write(bytes(self._out))
            self._out.clear()


class CanClient(Participant):
    """A program behind an adapter. A frame reaches it whole or, when it does not read, not at all."""

    def __init__(self, endpoint: Endpoint, adapter: Adapter) -> None:
        self.adapter = adapter
        self._endpoint = endpoint
        self._rate: int | None = None
        self._stuck = False
        self._as_new = deepcopy(adapter)
        self._out = bytearray()

    @property
    def fixed(self) -> str:
        return _fixed(self._endpoint)

    def unplug(self) -> None:
        _pullable(self._endpoint).unplug()

    def plug(self) -> None:
        _pullable(self._endpoint).plug()
        self.adapter = deepcopy(self._as_new)
        self._rate, self._stuck = None, False
        self._out = bytearray()

    def fileno(self) -> int:
        return self._endpoint.fileno()

    def read(self, at: float, patience: float = 0.0) -> list[Data]:
        said = self._endpoint.read()
        frames: list[Data] = [*self.adapter.feed(said, at)]
        answer = self.adapter.take()
        if len(self._out) < _UNREAD:  # who never reads misses answers at last
            self._out += answer
        self._rate = self.adapter.bitrate if self.adapter.open or frames else None
        return frames

    def rate(self) -> int | None:
        return self._rate

    def tell(self, data: Data, at: float) -> None:
        if not isinstance(data, CanFrame):
            raise RequestError("this simulator speaks bytes, which a CAN adapter cannot carry")
        said = self.adapter.deliver(data, at)
        if self._stuck:
            self.lost += bool(said)
        else:
            self._out += said

    def flush(self) -> None:
        if self._out:
            del self._out[: self._endpoint.write(bytes(self._out))]
            self._stuck = bool(self._out)

    def is_stuck(self) -> bool:
        return self._stuck

    def is_gone(self) -> bool:
        return isinstance(self._endpoint, TcpClient) and self._endpoint.gone

    def close(self) -> None:
        if isinstance(self._endpoint, TcpClient):
            self._endpoint.close()


class Door:
    """A TCP port by which clients come to a simulated CAN bus, several at once, each with an adapter of its own."""

    def __init__(self, port: TcpPort, adapter: Callable[[], Adapter]) -> None:
        self.port = port
        self.clients: list[CanClient] = []
        self._adapter = adapter

    def fileno(self) -> int:
        """Turns readable when somebody knocks."""
        return self.port.fileno()

    def admit(self) -> None:
        """Let in who knocks; when there are too many, turn him away."""
        connection = self.port.accept()
        if connection is None:
            return
        if len(self.clients) >= MOST_CLIENTS:
            connection.close()
        else:
            self.clients.append(CanClient(connection, self._adapter()))

    def sweep(self) -> list[CanClient]:
        """Forget those who have left; these were they."""
        gone = [client for client in self.clients if client.is_gone()]
        for client in gone:
            client.close()
            self.clients.remove(client)
        return gone

    @property
    def fixed(self) -> str:
        """Why the port cannot be pulled; it can."""
        return ""

    def unplug(self) -> None:
        """Hang up on everyone, and refuse whoever comes until `plug`."""
        self.port.unplug()  # first, or whoever is hung up on comes back at once
        for client in self.clients:
            client.close()
        self.clients.clear()

    def plug(self) -> None:
        """Listen again."""
        self.port.plug()

    def close(self) -> None:
        """Hang up on everyone and give the port back; calling it again does nothing."""
        for client in self.clients:
            client.close()
        self.clients.clear()
        self.port.close()


def _fixed(endpoint: Endpoint) -> str:
    if hasattr(endpoint, "unplug"):
        return str(getattr(endpoint, "fixed", ""))
    return "this port cannot be pulled"


def _pullable(endpoint: Endpoint) -> Any:
    """A port that can be pulled, as `_fixed` has said."""
    return endpoint
