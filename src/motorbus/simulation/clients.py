"""A program on a simulated bus: its bytes and, on CAN, the slcan adapter that it talks to."""

from __future__ import annotations

from typing import Final, Protocol

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.simulation.slcan import SlcanAdapter

MAX_UNREAD: Final = 4096  # bytes kept for a program that does not read


class Stream(Protocol):
    """Bytes from and to one program; no call blocks. `gone`: the program has left."""

    gone: bool

    def fileno(self) -> int: ...

    def read(self) -> bytes:
        """The bytes that have arrived."""

    def write(self, data: bytes) -> int:
        """Send bytes; return how many fitted."""

    def rate(self) -> int | None:
        """Bit/s that the program has set; None: unknown."""

    def close(self) -> None: ...


class Client:
    """A program on the bus: its stream and, on CAN, an slcan adapter.

    `lost` counts the bytes of a serial line, or the CAN frames, that the program did not read in time.
    """

    def __init__(self, stream: Stream, adapter: SlcanAdapter | None = None) -> None:
        self.stream = stream
        self.adapter = adapter
        self.lost = 0
        self._rate: int | None = None
        self._unsent = bytearray()
        self._is_behind = False

    def fileno(self) -> int:
        return self.stream.fileno()

    @property
    def gone(self) -> bool:
        """Whether the program has left."""
        return self.stream.gone

    def receive(self) -> list[Data]:
        """What the program has sent."""
        data = self.stream.read()
        if self.adapter is None:
            self._rate = self.stream.rate()
            return [data] if data else []
        frames: list[Data] = [*self.adapter.receive(data)]
        self._rate = self.adapter.bitrate if self.adapter.is_open or frames else None
        answer = self.adapter.take_answer()
        if len(self._unsent) < MAX_UNREAD:
            self._unsent += answer
        return frames

    def rate(self) -> int | None:
        """Bit/s that the program had set when it sent last; None: unknown, or its channel is closed."""
        return self._rate

    def send(self, data: Data, at: float) -> None:
        """Give data to the program with the next `flush`; a CAN frame reaches it whole or not at all."""
        if isinstance(data, CanFrame) != (self.adapter is not None):
            raise RequestError("a serial line carries bytes, and a CAN adapter carries frames")
        if not isinstance(data, CanFrame):
            self._unsent += data
        elif self.adapter is not None and (line := self.adapter.encode(data, at)):
            if self._is_behind:
                self.lost += 1
            else:
                self._unsent += line

    def flush(self) -> bool:
        """Send; whether all has been sent. On a serial line, bytes that do not fit are lost."""
        if self._unsent:
            del self._unsent[: self.stream.write(bytes(self._unsent))]
        if self.adapter is None:
            self.lost += len(self._unsent)
            self._unsent.clear()
        self._is_behind = bool(self._unsent)
        return not self._is_behind

    def close(self) -> None:
        self.stream.close()
