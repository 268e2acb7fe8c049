"""What serial ports and TCP connections share: bytes through a descriptor that does not block."""

from __future__ import annotations

import errno
from collections.abc import Callable
from time import monotonic
from typing import Any

from motorbus.core.operation import Data
from motorbus.link.errors import full, lost
from motorbus.link.lock import PortLock
from motorbus.link.wait import Readiness

CHUNK = 4096


class StreamLink:
    """A link of bytes over a descriptor. `lock` is the lock of the port, released at `close`."""

    name: str
    rate: int
    latency: float
    paced: bool
    lock: PortLock
    virtual = False
    simulated = False
    warnings: tuple[str, ...] = ()
    _descriptor = -1
    _idle_at = 0.0
    """Moment (s) at which the last byte has left, at this rate."""

    def _attach(self, descriptor: int, receive: Callable[[int], bytes], send: Callable[[bytes], int]) -> None:
        """Use this descriptor, through these two functions."""
        self._descriptor = descriptor
        self._receive = receive
        self._send = send
        self._wait: Callable[[float], bool] = Readiness(descriptor).wait

    def _detach(self) -> None:
        """Use no descriptor: its number may soon belong to another file."""
        self._descriptor = -1
        self._receive = self._send = self._wait = _closed

    def now(self) -> float:
        return monotonic()

    def write(self, data: Data) -> None:
        assert isinstance(data, bytes)
        try:
            written = self._send(data)
        except BlockingIOError:
            written = 0
        except OSError as error:
            raise lost(self.name, error) from error
        if written != len(data):
            raise full(self.name, written, len(data))
        self._idle_at = max(self._idle_at, monotonic()) + 10 * written / self.rate

    def read(self, until: float) -> list[Data]:
        try:
            if not self._wait(until):
                return []
            data = self._receive(CHUNK)
        except BlockingIOError:
            return []
        except (OSError, ValueError) as error:  # ValueError: another thread has closed it
            raise lost(self.name, error) from error
        if not data:
            raise lost(self.name, "the other end hung up")
        return [data]

    def fileno(self) -> int | None:
        return self._descriptor


def _closed(_: object) -> Any:
    raise OSError(errno.EBADF, "it is closed")
