"""How frames go through an adapter that python-can has opened.

Two ways. The text protocols (slcan, socketcand) are bytes on a descriptor, and are read from it as serial ports are:
one system call to wait, one to read, many frames. Every other back end is asked through python-can, one frame at a
time; where it has no descriptor, somebody has to wait inside it, and does so in slices, so that closing is quick.
"""

from __future__ import annotations

import contextlib
import errno
import time
import warnings
from collections.abc import Callable, Iterable
from threading import Lock
from typing import Any, Final, Protocol

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame, Data
from motorbus.errors import LinkError, LinkLost
from motorbus.link.can_port import ASK_AGAIN, Port
from motorbus.link.can_text import Reader
from motorbus.link.refusal import full, lost
from motorbus.link.waiting import wait_readable

SLICE: Final = 0.02
"""s that somebody waits inside python-can at a time."""
MOST: Final = 256
"""Frames taken from python-can in one go."""
_IDENTIFIER: Final = ERROR_FLAG - 1
BUS_OFF: Final = 0x40
"""Of the identifier of an error frame."""
_FULL: Final = (errno.ENOBUFS, errno.EAGAIN)
_NO_ROOM: Final = ("full", "overflow", "could not send message to one or more")


class Wire(Protocol):
    """Frames to and from an open adapter.

    `damaged` counts what came and was no whole frame, `refused` what the adapter said no to, `dropped` frames that
    are no classic CAN, or our own.
    """

    @property
    def damaged(self) -> int:
        """Lines or elements."""

    @property
    def refused(self) -> int:
        """Commands."""

    @property
    def dropped(self) -> int:
        """Frames."""

    def read(self, until: float) -> list[Data]:
        """As `Link.read`."""

    def write(self, frame: CanFrame) -> None:
        """As `Link.write`."""

    def fileno(self) -> int | None:
        """As `Link.fileno`."""

    def close(self) -> None:
        """Give the adapter back. Raises nothing; calling it again does nothing."""


class TextWire:
    """A text protocol on a port; `shut` closes the port, and what python-can has around it.

    `mend` follows what went out in part, and makes of it what no adapter takes for a frame: it must not be carried
    out later.
    """

    def __init__(
        self,
        name: str,
        port: Port,
        reader: Reader,
        encode: Callable[[CanFrame], bytes],
        mend: bytes,
        shut: Callable[[], None],
    ) -> None:
        self.name = name
        self._mend = mend
        self._torn = False
        self._port = port
        self._reader = reader
        self._encode = encode
        self._shut = shut
        self._turn = Lock()
        self._closed = False

    @property
    def damaged(self) -> int:
        return self._reader.damaged

    @property
    def refused(self) -> int:
        return self._reader.refused

    @property
    def dropped(self) -> int:
        return self._reader.foreign

    def read(self, until: float) -> list[Data]:
        while True:
            frames = self._arrived(until)
            if frames or time.monotonic() >= until:
                return list(frames)

    def _arrived(self, until: float) -> list[CanFrame]:
        """The frames in the next bytes; [] as well when these were none, or none came."""
        try:
            pause = until - time.monotonic()
            if pause > 0:
                self._wait(pause)
            with self._turn:
                self._check()
                data = self._port.read()
                return self._reader.feed(data) if data else []
        except (OSError, ValueError) as error:  # ValueError: closed by another thread
            raise _lost(self.name, error) from error

    def _wait(self, pause: float) -> None:
        descriptor = self._port.fileno()
        if descriptor is None:
            time.sleep(min(ASK_AGAIN, pause))
        else:
            wait_readable(descriptor, pause)

    def write(self, frame: CanFrame) -> None:
        self._put(self._encode(frame))

    def _put(self, data: bytes) -> None:
        try:
            self._check()
            if self._torn and self._port.write(self._mend) == len(self._mend):
                self._torn = False
            written = 0 if self._torn else self._port.write(data)
        except OSError as error:
            raise _lost(self.name, error) from error
        if written != len(data):
            self._torn = self._torn or written > 0
            raise full(self.name, written, len(data))

    def _check(self) -> None:
        if self._closed:
            raise lost(self.name, "it is closed")

    def fileno(self) -> int | None:
        return None if self._closed else self._port.fileno()

    def close(self) -> None:
        with self._turn:
            if self._closed:
                return
            self._closed = True
            self._shut()


class BusWire:
    """Any other back end: a bus of python-can. `message` makes a message of it, `descriptor` tells when to ask."""

    damaged = 0
    refused = 0

    def __init__(self, name: str, bus: Any, message: Callable[..., Any], descriptor: int | None) -> None:
        self.name = name
        self.dropped = 0
        self._bus = bus
        self._message = message
        self._descriptor = descriptor
        self._turn = Lock()

    def read(self, until: float) -> list[Data]:
        if self._descriptor is not None:
            return self._by_descriptor(self._descriptor, until)
        while True:
            pause = max(0.0, min(until - time.monotonic(), SLICE))
            frames: list[Data] = []
            if self._turn.acquire(blocking=pause > 0, timeout=pause or -1):
                try:
                    frames = self._take(pause)
                finally:
                    self._turn.release()
            if frames or time.monotonic() >= until:
                return frames

    def _by_descriptor(self, descriptor: int, until: float) -> list[Data]:
        try:
            pause = until - time.monotonic()
            if pause > 0 and not wait_readable(descriptor, pause):
                return []
        except (OSError, ValueError) as error:  # ValueError: closed by another thread
            raise _lost(self.name, error) from error
        with self._turn:
            return self._take(0.0)

    def _take(self, pause: float) -> list[Data]:
        """What has come, after waiting so long (s) for the first of it."""
        frames: list[Data] = []
        for _ in range(MOST):
            message = self._receive(pause)
            if message is None:
                break
            pause = 0.0
            frame = frame_of(message)
            if frame is None:
                self.dropped += 1
            else:
                frames.append(frame)
        return frames

    def _receive(self, pause: float) -> Any:
        bus = self._open_bus()
        try:
            return bus.recv(pause)
        except Exception as error:  # each back end has its own
            raise _lost(self.name, error) from error

    def _open_bus(self) -> Any:
        if self._bus is None:
            raise lost(self.name, "it is closed")
        return self._bus

    def write(self, frame: CanFrame) -> None:
        bus = self._open_bus()
        try:
            bus.send(
                self._message(
                    arbitration_id=frame.id & _IDENTIFIER,
                    data=bytearray(frame.data),
                    dlc=len(frame.data),
                    is_extended_id=frame.extended,
                    is_remote_frame=bool(frame.id & REMOTE_FLAG),
                ),
                0,
            )
        except Exception as error:  # each back end has its own
            raise _unsent(self.name, error) from error

    def fileno(self) -> int | None:
        return self._descriptor

    def close(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with self._turn:  # nobody waits inside it any more
                quietly(bus.shutdown)


def frame_of(message: Any) -> CanFrame | None:
    """A message of python-can as a frame; None for CAN FD, and for what we sent ourselves."""
    if message.is_fd or not message.is_rx:
        return None
    if message.is_error_frame:
        return CanFrame(message.arbitration_id & _IDENTIFIER | ERROR_FLAG, bytes(message.data or b"")[:8])
    if message.is_remote_frame:
        return CanFrame(message.arbitration_id | REMOTE_FLAG, bytes(message.dlc), message.is_extended_id)
    return CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id)


def refuse_bus_off(name: str, frames: Iterable[Data]) -> None:
    """Raise LinkLost where the controller says that it has left the bus: it sends nothing from then on.

    So says the kernel's error frame, CAN_ERR_BUSOFF (linux/can/error.h).
    """
    for frame in frames:
        if isinstance(frame, CanFrame) and frame.id & ERROR_FLAG and frame.id & BUS_OFF:
            raise LinkLost(
                f"{name} is off the bus: its controller has counted too many errors",
                received=frame,
                cause="a short circuit, another bit rate on the bus, no terminating resistors, or nobody else there",
                advice="see to that; an interface without restart-ms needs `ip link set can0 type can restart`",
            )


def build(back_end: Any, channel: Any, settings: dict[str, Any]) -> Any:
    """An open bus of python-can; one that fails leaves nothing open. Raises what its constructor raises."""
    bus = back_end.__new__(back_end)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a clock that it has adjusted, names that it will give up
            bus.__init__(**settings) if channel is None else bus.__init__(channel, **settings)
    except BaseException:
        quietly(bus.shutdown)
        raise
    return bus


def quietly(end: Callable[[], object]) -> None:
    """End something that may already be dead, for which nobody needs to be told again."""
    with contextlib.suppress(Exception):  # each back end has its own
        end()


def _lost(name: str, error: Exception) -> LinkError:
    return error if isinstance(error, LinkError) else lost(name, error)


def _unsent(name: str, error: Exception) -> LinkError:
    """The adapter has no room, or is gone; python-can's back ends say it in their own words."""
    text = str(error).lower()
    code = getattr(error, "error_code", None) or getattr(error, "errno", None)
    if isinstance(error, TimeoutError) or code in _FULL or any(words in text for words in _NO_ROOM):
        refusal = full(name, 0, 1)
        refusal.cause = "nobody on the bus acknowledges, the bus is off, or frames come faster than its rate"
        refusal.summary = f"{name} takes no more frames: {error}"
        return refusal
    return lost(name, error)
