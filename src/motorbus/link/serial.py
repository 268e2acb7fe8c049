"""Serial ports: opened and configured by serialx, then read and written through their descriptor.

serialx is imported when a port is opened or the ports are listed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import stat
import struct
import sys
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from motorbus.core.request import Data
from motorbus.errors import LinkError, PortNotFound, RequestError
from motorbus.link import usb_adapters
from motorbus.link.errors import busy, lost, no_permission, not_a_port, not_found, unsupported_rate
from motorbus.link.lock import PortLock, opening
from motorbus.link.port_users import find_user
from motorbus.link.stream import CHUNK, StreamLink
from motorbus.link.tcp import CONNECT_TIME, TcpLink, send_at_once, split_address
from motorbus.link.usb_adapters import PortInfo

if TYPE_CHECKING:
    from serialx import BaseSerial, SerialPortInfo

TOLERANCE = 0.025  # of the rate; with a larger error the stop bit of a byte is missed
POLL_TIME = 0.001  # s between two reads of a port that has no descriptor
NEGOTIATION_TIME = 0.5  # s; the least time-out for the options of an RFC 2217 server, a few round trips
REMOTE_LATENCY = 0.020  # s for an RFC 2217 server: the network and the adapter behind it
MEMORY_DEVICES = 1  # major number of /dev/null and the like; Linux Documentation/admin-guide/devices.txt
NO_DEVICE = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
UNREACHABLE = (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ECONNREFUSED)
TCGETS2 = 0x802C542A  # asm-generic/ioctls.h, sizeof(struct termios2) = 44; MIPS, PowerPC and SPARC differ
TERMIOS2 = struct.Struct("=4I20s2I")


def ports(lister: Callable[[], Iterable[SerialPortInfo]] | None = None) -> list[PortInfo]:
    """The serial ports of this machine, USB adapters first."""
    import serialx

    found = [
        PortInfo(
            device=port.resolved_device,
            stable=port.device if port.device != port.resolved_device else "",
            vid=port.vid,
            pid=port.pid,
            serial_number=port.serial_number or "",
            manufacturer=port.manufacturer or "",
            product=port.product or "",
            guess=usb_adapters.ADAPTERS.get((port.vid, port.pid), ""),
            part=(port.interface_num, port.port_number),
        )
        for port in (lister or serialx.list_serial_ports)()
    ]
    return sorted(found, key=lambda port: (port.vid is None, port.device))


class SerialLink(StreamLink):
    """A serial port of a POSIX system: a real device or a pseudo-terminal.

    `sysfs` is where the kernel describes adapters; `lock` is a lock that the caller already holds. While it is open,
    no other program can open it. Raises PortNotFound (with the ports there are), PortBusy (with the owner), LinkError.
    """

    def __init__(
        self, port: str, *, rate: int, sysfs: Path = Path("/sys"), lock: PortLock | None = None
    ) -> None:
        import fcntl
        import termios

        self.name = port
        device = os.path.realpath(port)
        self.paced = not device.startswith(usb_adapters.PSEUDO_TERMINALS)
        if not os.path.exists(device):
            raise not_found(port, ports())
        status = os.stat(device)
        is_memory = sys.platform == "linux" and os.major(status.st_rdev) == MEMORY_DEVICES
        if is_memory or not stat.S_ISCHR(status.st_mode):
            raise not_a_port(port, ports())
        with opening(port, lock) as self.lock:
            user = find_user(device)
            if user is not None:
                raise busy(port, user)
            self._serial: BaseSerial | None = _open_serial(port, device, rate)
            try:
                descriptor = self._serial.fileno()
                os.set_blocking(descriptor, False)
                self.attach(descriptor, partial(os.read, descriptor), partial(os.write, descriptor))
                if self.paced:  # a pseudo-terminal would keep the mark while its simulator has it open
                    with contextlib.suppress(OSError):
                        fcntl.ioctl(descriptor, termios.TIOCEXCL)  # later opens fail, except those of root
                self._take_rate(rate)
            except BaseException:
                self.close()
                raise
        self.latency, self.warnings = usb_adapters.device_latency(device, sysfs)

    def tune(self, rate: int) -> None:
        time.sleep(max(0.0, self._idle_at - time.monotonic()))  # bytes on their way keep their rate
        _set_rate(self.name, self._serial, rate)
        self._take_rate(rate)

    def _take_rate(self, rate: int) -> None:
        """Keep a rate that was set. Raises LinkError when the adapter has rounded it too far."""
        self.rate = rate
        actual = line_speed(self._descriptor) if sys.platform == "linux" else None
        if actual is not None and abs(actual - rate) > TOLERANCE * rate:
            raise unsupported_rate(self.name, rate, f"the adapter makes {actual} of it")

    def close(self) -> None:
        serial, self._serial = self._serial, None
        if serial is not None:
            self.detach()
            with contextlib.suppress(OSError):
                serial.close()
        self.lock.release()


class PolledLink(StreamLink):
    """A port without a descriptor, polled every ms: a COM port of Windows, or an RFC 2217 server.

    `connect_time` is a time-out in s for a server. Other arguments and errors as for `SerialLink`.
    """

    paced = False  # what is behind a server is unknown, and the clock of Windows is coarse

    def __init__(
        self, port: str, *, rate: int, lock: PortLock | None = None, connect_time: float = CONNECT_TIME
    ) -> None:
        import serialx

        self.name = port
        self.rate = rate
        self.latency = usb_adapters.WINDOWS_LATENCY
        if "://" in port:
            split_address(port)  # raises
            self.latency = REMOTE_LATENCY
        self._failure = serialx.SerialException
        self._access = Lock()
        with opening(port, lock) as self.lock:
            self._serial: BaseSerial | None = _open_serial(port, port, rate, connect_time)
        connection = getattr(self._serial, "_socket", None)
        if connection is not None:
            send_at_once(connection)

    def read(self, until: float) -> list[Data]:
        buffer = bytearray(CHUNK)
        while True:
            with self._access:
                try:
                    count = _opened(self.name, self._serial).readinto(buffer, timeout=0)
                except (OSError, self._failure) as error:
                    raise lost(self.name, error) from error
            pause = until - time.monotonic()
            if count or pause <= 0.0:
                return [bytes(buffer[:count])] if count else []
            time.sleep(min(POLL_TIME, pause))

    def send(self, data: bytes) -> int:
        with self._access:
            try:
                _opened(self.name, self._serial).write(data, timeout=0)
            except TimeoutError:
                return 0
            except (OSError, self._failure) as error:
                raise lost(self.name, error) from error
        return len(data)

    def tune(self, rate: int) -> None:
        with self._access:
            _set_rate(self.name, self._serial, rate)
        self.rate = rate

    def close(self) -> None:
        with self._access, contextlib.suppress(OSError):
            serial, self._serial = self._serial, None
            if serial is not None:
                serial.close()
        self.lock.release()


def open_stream(
    port: str, *, rate: int, lock: PortLock | None = None, connect_time: float | None = None
) -> SerialLink | PolledLink | TcpLink:
    """Open a device, a COM port, or a socket:// or rfc2217:// URL. `connect_time` is a time-out in s.

    Errors as for the classes.
    """
    limit = CONNECT_TIME if connect_time is None else connect_time
    if port.lower().startswith("socket://"):
        return TcpLink(port, rate=rate, lock=lock, connect_time=limit)
    if "://" in port or os.name == "nt":
        return PolledLink(port, rate=rate, lock=lock, connect_time=max(limit, NEGOTIATION_TIME))
    return SerialLink(port, rate=rate, lock=lock)


def _open_serial(port: str, target: str, rate: int, connect_time: float = CONNECT_TIME) -> BaseSerial:
    import serialx

    try:
        serial = serialx.serial_for_url(target, baudrate=rate, connect_timeout=connect_time)
        serial.open()
    except OSError as error:
        raise _open_error(port, target, connect_time, error) from error
    except serialx.UnsupportedSetting as error:
        raise unsupported_rate(port, rate, error) from error
    except (serialx.SerialException, ValueError) as error:
        raise LinkError(f"{port} cannot be opened: {error}") from error
    return serial


def _open_error(port: str, device: str, connect_time: float, error: OSError) -> LinkError:
    """The error for what serialx has raised at open."""
    if "://" in port and isinstance(error, TimeoutError):
        return LinkError(
            f"{port}: no RFC 2217 answer within {connect_time:g} s",
            cause="the host is off, or it passes bytes on without that protocol",
            advice="try socket:// in place of rfc2217://",
        )
    if isinstance(error, socket.gaierror) or error.errno in UNREACHABLE:
        return PortNotFound(f"{port} cannot be reached: {error}", advice="is the server running?")
    if error.errno in NO_DEVICE:
        return not_found(port, ports())
    if error.errno == errno.EBUSY or (os.name == "nt" and isinstance(error, PermissionError)):
        return busy(port, find_user(device))
    if isinstance(error, PermissionError):
        return no_permission(port, device)
    if error.errno == errno.ENOTTY:
        return not_a_port(port, ports())
    return LinkError(f"{port} cannot be opened: {error.strerror or error}")


def _opened(port: str, serial: BaseSerial | None) -> BaseSerial:
    if serial is None:
        raise lost(port, "it is closed")
    return serial


def _set_rate(port: str, serial: BaseSerial | None, rate: int) -> None:
    import serialx

    if rate <= 0:
        raise RequestError(f"{rate} is not a rate in bit/s")
    try:
        _opened(port, serial).reconfigure_port(baudrate=rate)
    except serialx.UnsupportedSetting as error:
        raise unsupported_rate(port, rate, error) from error
    except (OSError, serialx.SerialException) as error:
        raise lost(port, error) from error


def line_speed(descriptor: int) -> int | None:
    """Rate (bit/s) of a terminal, or of the pseudo-terminal of a master; None when the system does not tell."""
    import fcntl
    import termios

    try:
        if sys.platform == "linux":  # any number, such as 76 800 and 128 000
            speed: int = TERMIOS2.unpack(fcntl.ioctl(descriptor, TCGETS2, bytes(TERMIOS2.size)))[-1]
        else:
            speed = termios.tcgetattr(descriptor)[5]
    except (OSError, termios.error):
        return None
    return speed or None
