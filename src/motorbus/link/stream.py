"""Byte streams: what serial ports and TCP connections share, and waiting for their descriptors."""

from __future__ import annotations

import errno
import select
from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any

from motorbus.core.request import Data
from motorbus.link.errors import full, lost
from motorbus.link.lock import PortLock

CHUNK = 4096
SELECT_LIMIT = 1024  # FD_SETSIZE: select knows lower descriptors only
LONGEST = 86_400.0  # s; some systems refuse longer waits


class StreamLink:
    """A link of bytes through a descriptor that does not block. `lock` is released at `close`."""

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

    def attach(self, descriptor: int, receive: Callable[[int], bytes], send: Callable[[bytes], int]) -> None:
        """Use this open descriptor. It is registered once, so that a wait is one call of `poll`."""
        self._descriptor = descriptor
        self._receive = receive
        self._send = send
        if hasattr(select, "poll"):
            registered = select.poll()
            registered.register(descriptor, select.POLLIN)
            self._poll: Callable[[int], Any] = registered.poll
        else:  # Windows
            self._poll = lambda milliseconds: wait_any((descriptor,), milliseconds / 1000)

    def detach(self) -> None:
        """Use no descriptor: its number may soon belong to another file."""
        self._descriptor = -1
        self._receive = self._send = self._poll = _raise_closed

    now = staticmethod(monotonic)

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

    def read(self, until: float) -> list[Data]:
        pause = until - monotonic()
        try:
            ready = self._poll(int(min(pause, LONGEST) * 1000) if pause > 0.0 else 0)
            if not ready and pause > 0.0:  # poll counts whole milliseconds; this waits for the rest
                ready = wait_any((self._descriptor,), until - monotonic())
            if not ready:
                return []
            data = self._receive(CHUNK)
        except (BlockingIOError, RuntimeError):  # another thread reads, and gets what comes
            return []
        except (OSError, ValueError) as error:
            raise lost(self.name, error) from error
        if not data:
            raise lost(self.name, "the other end hung up")
        return [data]

    def fileno(self) -> int | None:
        """The descriptor; None when there is none, or it is closed."""
        return self._descriptor if self._descriptor >= 0 else None


def _raise_closed(_: object) -> Any:
    raise OSError(errno.EBADF, "it is closed")


def wait_any(descriptors: Sequence[int], seconds: float) -> list[int]:
    """Wait for data, or the end of a stream, and return all readable descriptors; none after the time-out.

    Raises OSError or ValueError for a closed descriptor.
    """
    seconds = min(max(seconds, 0.0), LONGEST)
    if max(descriptors) < SELECT_LIMIT:
        return select.select(descriptors, (), (), seconds)[0]
    ready = select.poll()
    for descriptor in descriptors:
        ready.register(descriptor, select.POLLIN)
    events = ready.poll(seconds * 1000)
    if any(event & select.POLLNVAL for _, event in events):
        raise ValueError("a descriptor is closed")
    return [descriptor for descriptor, _ in events]
