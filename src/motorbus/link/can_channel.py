"""Frames through an open CAN adapter.

The text protocols slcan and socketcand go over a serial or TCP link: many frames in one system call. Every other back
end of python-can is asked for one frame at a time; where it has no descriptor, `read` waits inside it in short slices,
so that another thread can close it.
"""

from __future__ import annotations

import contextlib
import errno
import time
import warnings
from collections.abc import Callable
from threading import Lock
from typing import Any, Final, Protocol

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame, Data
from motorbus.errors import LinkError
from motorbus.link.errors import full, lost
from motorbus.link.serial import ByteLink
from motorbus.link.wait import Readiness

SLICE: Final = 0.02  # s of one wait inside python-can
MOST_FRAMES: Final = 256  # taken from python-can by one read
_FULL: Final = (errno.ENOBUFS, errno.EAGAIN)
_FULL_TEXTS: Final = ("full", "overflow", "could not send message to one or more")
_IDENTIFIER: Final = ERROR_FLAG - 1


class Counts:
    """`damaged` lines, commands that the adapter `refused`, and `dropped` frames: CAN FD, or our own."""

    def __init__(self) -> None:
        self.damaged = self.refused = self.dropped = 0


class Codec(Protocol):
    """A text protocol. `cancel` is text that makes an unfinished line invalid."""

    counts: Counts
    cancel: bytes

    def encode(self, frame: CanFrame) -> bytes:
        """The text that sends this frame."""

    def feed(self, data: bytes) -> list[CanFrame]:
        """The frames that these bytes of the adapter complete, cut anywhere. Never raises."""


class TextChannel:
    """A text protocol over a link of bytes. Methods as those of a link.

    A line that was sent in part must not become a frame later, so the codec's `cancel` is sent after it.
    """

    def __init__(self, name: str, link: ByteLink, codec: Codec) -> None:
        self.name = name
        self.counts = codec.counts
        self.latency = link.latency
        self.warnings = link.warnings
        self._link = link
        self._codec = codec
        self._unfinished = False
        self._access = Lock()

    def read(self, until: float) -> list[Data]:
        while True:
            frames: list[CanFrame] = []
            if self._link.wait(until):
                with self._access:
                    frames = self._decode(self._link.receive())
            if frames or time.monotonic() >= until:
                return list(frames)

    def _decode(self, data: bytes) -> list[CanFrame]:
        return self._codec.feed(data) if data else []

    def write(self, frame: CanFrame) -> None:
        self._send(self._codec.encode(frame))

    def _send(self, text: bytes) -> None:
        cancel = self._codec.cancel
        if self._unfinished and self._link.send(cancel) == len(cancel):
            self._unfinished = False
        written = 0 if self._unfinished else self._link.send(text)
        if written != len(text):
            self._unfinished = self._unfinished or written > 0
            raise full(self.name, written, len(text))

    def fileno(self) -> int | None:
        return self._link.fileno()

    def close(self) -> None:
        with self._access:
            self._link.close()


class BusChannel:
    """Any other back end: an open bus of python-can. Methods as those of a link.

    `message` is its message class; `descriptor` is readable exactly when there is a frame, or None.
    """

    def __init__(self, name: str, bus: Any, message: Callable[..., Any], descriptor: int | None) -> None:
        self.name = name
        self.counts = Counts()
        self._bus = bus
        self._message = message
        self._descriptor = descriptor
        self._wait = None if descriptor is None else Readiness(descriptor).wait
        self._access = Lock()

    def read(self, until: float) -> list[Data]:
        if self._wait is not None:
            try:
                if not self._wait(until):
                    return []
            except (OSError, ValueError) as error:  # ValueError: another thread has closed it
                raise lost(self.name, error) from error
            with self._access:
                return self._receive(0.0)
        while True:
            pause = max(0.0, min(until - time.monotonic(), SLICE))
            frames: list[Data] = []
            if self._access.acquire(blocking=pause > 0, timeout=pause or -1):
                try:
                    frames = self._receive(pause)
                finally:
                    self._access.release()
            if frames or time.monotonic() >= until:
                return frames

    def _receive(self, pause: float) -> list[Data]:
        """The frames that are there; waits so long (s) for the first."""
        bus = self._open_bus()
        frames: list[Data] = []
        for _ in range(MOST_FRAMES):
            try:
                message = bus.recv(pause)
            except Exception as error:  # each back end has its own types
                raise lost(self.name, error) from error
            if message is None:
                break
            pause = 0.0
            frame = frame_of(message)
            if frame is None:
                self.counts.dropped += 1
            else:
                frames.append(frame)
        return frames

    def _open_bus(self) -> Any:
        if self._bus is None:
            raise lost(self.name, "it is closed")
        return self._bus

    def write(self, frame: CanFrame) -> None:
        message = self._message(
            arbitration_id=frame.id & _IDENTIFIER,
            data=bytearray(frame.data),
            dlc=len(frame.data),
            is_extended_id=frame.extended,
            is_remote_frame=bool(frame.id & REMOTE_FLAG),
        )
        bus = self._open_bus()
        try:
            bus.send(message, 0)
        except Exception as error:  # each back end has its own types
            text = str(error).lower()
            code = getattr(error, "error_code", None) or getattr(error, "errno", None)
            is_full = isinstance(error, TimeoutError) or code in _FULL
            if is_full or any(words in text for words in _FULL_TEXTS):
                raise LinkError(
                    f"{self.name} takes no more frames: {error}",
                    cause="no node acknowledges, the bus is off, or frames are written faster than its rate",
                ) from error
            raise lost(self.name, error) from error

    def fileno(self) -> int | None:
        return self._descriptor

    def close(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with self._access, contextlib.suppress(Exception):  # it may be broken already
                bus.shutdown()


def frame_of(message: Any) -> CanFrame | None:
    """The frame of a python-can message; None for CAN FD and for our own frames."""
    if message.is_fd or not message.is_rx:
        return None
    if message.is_error_frame:
        return CanFrame(message.arbitration_id & _IDENTIFIER | ERROR_FLAG, bytes(message.data or b"")[:8])
    if message.is_remote_frame:
        return CanFrame(message.arbitration_id | REMOTE_FLAG, bytes(message.dlc), message.is_extended_id)
    return CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id)


def open_bus(back_end: Any, channel: Any, settings: dict[str, Any]) -> Any:
    """Open a bus of python-can, and shut it down when its constructor raises."""
    bus = back_end.__new__(back_end)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about adjusted clocks and deprecated names
            bus.__init__(**settings) if channel is None else bus.__init__(channel, **settings)
    except BaseException:
        with contextlib.suppress(Exception):
            bus.shutdown()
        raise
    return bus
