"""The bytes below a text protocol for CAN: a serial port or a socket that python-can has opened, used without waiting.

Where the system has descriptors, one system call reads all there is. pyserial would take two, and more for each byte.
"""

from __future__ import annotations

import os
from typing import Any, Final, Protocol

CHUNK: Final = 4096
ASK_AGAIN: Final = 0.001
"""s between two looks at a port without descriptor."""


class Port(Protocol):
    """Bytes without waiting."""

    def fileno(self) -> int | None:
        """Turns readable when bytes have come; None: look again and again."""

    def read(self) -> bytes:
        """What has come; b"" when nothing. Raises OSError when it is gone."""

    def write(self, data: bytes) -> int:
        """How many of these bytes had room. Raises OSError when it is gone."""


class Descriptor:
    """A serial port or a socket of a POSIX system."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        os.set_blocking(descriptor, False)
        if os.isatty(descriptor):
            _tell_silence_from_end(descriptor)

    def fileno(self) -> int | None:
        return self._descriptor

    def read(self) -> bytes:
        try:
            data = os.read(self._descriptor, CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionError("it hung up")
        return data

    def write(self, data: bytes) -> int:
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0


def _tell_silence_from_end(descriptor: int) -> None:
    """pyserial sets a terminal so that nothing to read looks like a hang-up."""
    import termios

    settings = termios.tcgetattr(descriptor)
    settings[6][termios.VMIN] = 1
    termios.tcsetattr(descriptor, termios.TCSANOW, settings)


class SerialObject:
    """A port of pyserial that has no descriptor: a COM port, an RFC 2217 server."""

    def __init__(self, serial: Any) -> None:
        self._serial = serial
        serial.timeout = serial.write_timeout = 0

    def fileno(self) -> int | None:
        return None

    def read(self) -> bytes:
        return bytes(self._serial.read(self._serial.in_waiting or 1))

    def write(self, data: bytes) -> int:
        written = self._serial.write(data)
        return len(data) if written is None else int(written)


class SocketObject:
    """A socket where it is no descriptor of the system's."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        socket.setblocking(False)

    def fileno(self) -> int | None:
        return int(self._socket.fileno())

    def read(self) -> bytes:
        try:
            data = bytes(self._socket.recv(CHUNK))
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionError("it hung up")
        return data

    def write(self, data: bytes) -> int:
        try:
            return int(self._socket.send(data))
        except BlockingIOError:
            return 0
