"""What serial ports and TCP connections share: bytes through a port that does not block."""

from __future__ import annotations

import errno
from collections.abc import Callable
from time import monotonic
from typing import Any

from motorbus.core.operation import Data
from motorbus.link.errors import full, lost
from motorbus.link.lock import PortLock

CHUNK = 4096


class StreamLink:
    """A link of bytes. `lock` is the lock of the port, released at `close`."""

    name: str
    rate: int
    latency: float
    paced: bool
    lock: PortLock
    virtual = False
    simulated = False
    warnings: tuple[str, ...] = ()
    _descriptor: int | None = None
    _idle_at = 0.0
    """Moment (s) at which the last byte has left, at this rate."""

    def _attach(
        self,
        descriptor: int | None,
        receive: Callable[[int], bytes],
        send: Callable[[bytes], int],
        wait: Callable[[float], bool],
    ) -> None:
        """Use these functions of an open port, and its descriptor where it has one."""
        self._descriptor = descriptor
        self._receive = receive
        self._send = send
        self._wait = wait

    def _detach(self) -> None:
        """Use no descriptor: its number may soon belong to another file."""
        self._descriptor = None
        self._receive = self._send = self._wait = _closed

    def now(self) -> float:
        return monotonic()

    def send(self, data: bytes) -> int:
        """Send what fits into the buffer; the number of bytes. Raises LinkLost."""
        try:
            return self._send(data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise lost(self.name, error) from error

    def write(self, data: Data) -> None:
        assert isinstance(data, bytes)
        written = self.send(data)
        if written != len(data):
            raise full(self.name, written, len(data))
        self._idle_at = max(self._idle_at, monotonic()) + 10 * written / self.rate

    def wait(self, until: float) -> bool:
        """Wait for data or the end of the stream until this moment (s); False when none came. Raises LinkLost."""
        try:
            return self._wait(until)
        except (OSError, ValueError) as error:  # another thread has closed it
            raise lost(self.name, error) from error

    def receive(self) -> bytes:
        """The bytes that have arrived, without waiting. Raises LinkLost."""
        try:
            data = self._receive(CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise lost(self.name, error) from error
        if not data:
            raise lost(self.name, "the other end hung up")
        return data

    def read(self, until: float) -> list[Data]:
        data = self.receive() if self.wait(until) else b""
        return [data] if data else []

    def fileno(self) -> int | None:
        return self._descriptor


def _closed(_: object) -> Any:
    raise OSError(errno.EBADF, "it is closed")
