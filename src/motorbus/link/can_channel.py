"""Frames through an open CAN adapter.

The text protocols slcan and socketcand are read from the descriptor like a serial port: many frames in one system call.
Every other back end of python-can is asked for one frame at a time; where it has no descriptor, `read` waits inside it
in short slices, so that another thread can close it.
"""

from __future__ import annotations

import contextlib
import errno
import time
import warnings
from collections.abc import Callable
from threading import Lock
from typing import Any, Final, NamedTuple, Protocol

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame, Data
from motorbus.errors import LinkError
from motorbus.link.errors import full, lost
from motorbus.link.stream import CHUNK
from motorbus.link.wait import Readiness

POLL_TIME: Final = 0.001  # s between two reads of a port without descriptor
SLICE: Final = 0.02  # s of one wait inside python-can
MOST_FRAMES: Final = 256  # taken from python-can by one read
_FULL: Final = (errno.ENOBUFS, errno.EAGAIN)
_FULL_TEXTS: Final = ("full", "overflow", "could not send message to one or more")
_IDENTIFIER: Final = ERROR_FLAG - 1


class Counts:
    """`damaged` lines, commands that the adapter `refused`, and `dropped` frames: CAN FD, or our own."""

    def __init__(self) -> None:
        self.damaged = self.refused = self.dropped = 0


class Decoder(Protocol):
    """Text of an adapter, cut anywhere -> frames. `feed` returns the frames that it completes, and never raises."""

    counts: Counts

    def feed(self, data: bytes) -> list[CanFrame]: ...


class Port(NamedTuple):
    """A port that does not block. `receive` raises BlockingIOError for no data and returns b"" at the end."""

    receive: Callable[[int], bytes]
    send: Callable[[bytes], int]
    descriptor: int | None


class TextChannel:
    """A text protocol on a port; `shut` closes the port. Methods as those of a link.

    `cancel` is text that makes an unfinished line invalid. It is sent after a line that was sent in part, which must
    not become a frame later.
    """

    def __init__(
        self,
        name: str,
        port: Port,
        decoder: Decoder,
        encode: Callable[[CanFrame], bytes],
        cancel: bytes,
        shut: Callable[[], None],
    ) -> None:
        self.name = name
        self.counts = decoder.counts
        self._port = port
        self._feed = decoder.feed
        self._encode = encode
        self._cancel = cancel
        self._shut = shut
        self._unfinished = False
        self._access = Lock()
        self._closed = False
        self._wait = _pause if port.descriptor is None else Readiness(port.descriptor).wait

    def read(self, until: float) -> list[Data]:
        while True:
            try:
                if until > time.monotonic():
                    self._wait(until)
                with self._access:
                    self._check()
                    frames = self._read_port()
            except LinkError:
                raise
            except (OSError, ValueError) as error:  # ValueError: another thread has closed it
                raise lost(self.name, error) from error
            if frames or time.monotonic() >= until:
                return list(frames)

    def _read_port(self) -> list[CanFrame]:
        try:
            data = self._port.receive(CHUNK)
        except BlockingIOError:
            return []
        if not data:
            raise lost(self.name, "the other end hung up")
        return self._feed(data)

    def write(self, frame: CanFrame) -> None:
        self._send(self._encode(frame))

    def _send(self, text: bytes) -> None:
        self._check()
        if self._unfinished and self._send_port(self._cancel) == len(self._cancel):
            self._unfinished = False
        written = 0 if self._unfinished else self._send_port(text)
        if written != len(text):
            self._unfinished = self._unfinished or written > 0
            raise full(self.name, written, len(text))

    def _send_port(self, text: bytes) -> int:
        try:
            return self._port.send(text)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise lost(self.name, error) from error

    def _check(self) -> None:
        if self._closed:
            raise lost(self.name, "it is closed")

    def fileno(self) -> int | None:
        return None if self._closed else self._port.descriptor

    def close(self) -> None:
        with self._access:
            if not self._closed:
                self._closed = True
                self._shut()


def _pause(until: float) -> bool:
    time.sleep(max(0.0, min(POLL_TIME, until - time.monotonic())))
    return True


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
