"""Serial ports: opened and set up by serialx, then used by their descriptor.

Opening is where systems differ and where people are stuck, so that is left to a library, and every refusal is told
with its reason: the ports there are, the process that holds it, the group to join. What runs a thousand times a
second is one system call to write and two to read. serialx is imported when a port is opened or ports are listed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import stat
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, NoReturn

from motorbus.core.operation import Data
from motorbus.errors import LinkError, PortNotFound, RequestError
from motorbus.link import adapters
from motorbus.link.adapters import PortInfo
from motorbus.link.foreign import who_holds
from motorbus.link.identity import PSEUDO_TERMINALS
from motorbus.link.lock import PortLock, taken
from motorbus.link.refusal import busy, forbidden, full, lost, no_port, not_found, wrong_rate
from motorbus.link.speed import line_speed
from motorbus.link.tcp import CONNECT_TIME, give_up_soon, split_address
from motorbus.link.waiting import is_readable, wait_readable

if TYPE_CHECKING:
    from serialx import BaseSerial, SerialPortInfo

CHUNK = 4096
TOLERANCE = 0.025  # of the rate; beyond it the stop bit of a byte is missed
ASK_AGAIN = 0.001  # s between two looks at a port that has no descriptor
AGREEING = 0.5  # s for a server that is looked for anew to agree on its options: a few ways there and back
REMOTE_LATENCY = 0.020  # s for an RFC 2217 server: the network, and whatever adapter is at its other end
MEMORY_DEVICES = 1  # Linux Documentation/admin-guide/devices.txt
SHARP = 1e-4  # s; a clock that ticks more slowly cannot tell how long a frame took
GONE = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
UNREACHABLE = (errno.EHOSTUNREACH, errno.ENETUNREACH)


def ports(lister: Callable[[], Iterable[SerialPortInfo]] | None = None) -> list[PortInfo]:
    """The serial ports of this machine, USB adapters first, and what each of them probably is."""
    found = [_about(port) for port in (lister or listed)()]
    return sorted(found, key=lambda port: (port.vid is None, port.device))


def listed() -> list[SerialPortInfo]:
    """The serial ports of this machine, as the system tells of them."""
    import serialx

    return list(serialx.list_serial_ports())


def _about(port: SerialPortInfo) -> PortInfo:
    return PortInfo(
        device=port.resolved_device,
        stable=port.device if port.device != port.resolved_device else "",
        vid=port.vid,
        pid=port.pid,
        serial_number=port.serial_number or "",
        manufacturer=port.manufacturer or "",
        product=port.product or "",
        guess=adapters.guess(port.vid, port.pid),
    )


class SerialLink:
    """A serial port of a POSIX system: a real device or a pseudo-terminal.

    Nobody else can open it meanwhile. Raises PortNotFound (naming the ports there are), PortBusy (naming the owner)
    or LinkError. `sysfs` is where the kernel tells about adapters; `kept` a lock that we have already, maybe this one.
    """

    virtual = False
    simulated = False

    def __init__(
        self, port: str, *, rate: int, sysfs: Path = Path("/sys"), kept: PortLock | None = None
    ) -> None:
        self.name = port
        self.rate = rate
        self.warnings: tuple[str, ...] = ()
        self._device = os.path.realpath(port)
        self._descriptor = -1
        self._clear_at = 0.0
        self._serial: BaseSerial | None = None
        self.paced = not self._device.startswith(PSEUDO_TERMINALS)
        if not os.path.exists(self._device):
            raise not_found(port, ports())
        if not could_be_a_port(self._device):
            raise no_port(port, ports())
        self.lock = taken(port, kept)
        try:
            self._open(sysfs)
        except BaseException:
            self.close()
            raise

    def _open(self, sysfs: Path) -> None:
        holder = who_holds(self._device)
        if holder is not None:
            raise busy(self.name, holder)
        self._serial = _opened(self.name, self._device, self.rate)
        self._descriptor = self._serial.fileno()
        os.set_blocking(self._descriptor, False)
        _check_rate(self.name, self._descriptor, self.rate)
        if self.paced:  # on a pseudo-terminal the mark would outlive us while its simulator has it open
            _exclude_others(self._descriptor, exclude=True)
        timer = adapters.latency_timer(self._device, sysfs)
        if timer is not None:
            self.latency = timer / 1000 + adapters.USB_TIME
            if timer > adapters.FAST_TIMER:
                self.warnings = (adapters.latency_warning(self._device, timer),)
        else:
            self.latency = adapters.DEVICE_LATENCY if self.paced else adapters.TERMINAL_LATENCY

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: Data) -> None:
        assert isinstance(data, bytes)
        try:
            written = os.write(self._descriptor, data)
        except BlockingIOError:
            written = 0
        except OSError as error:
            raise lost(self.name, error) from error
        if written != len(data):
            raise full(self.name, written, len(data))
        self._clear_at = max(self._clear_at, time.monotonic()) + 10 * written / self.rate

    def read(self, until: float) -> list[Data]:
        try:
            pause = until - time.monotonic()
            if not (wait_readable(self._descriptor, pause) if pause > 0 else is_readable(self._descriptor)):
                return []
            data = os.read(self._descriptor, CHUNK)
        except BlockingIOError:
            return []
        except (OSError, ValueError) as error:  # ValueError: closed by another thread
            raise lost(self.name, error) from error
        if not data:
            raise lost(self.name, "it hung up")
        return [data]

    def tune(self, rate: int, listen_only: bool = False) -> None:
        time.sleep(max(0.0, self._clear_at - time.monotonic()))  # what is still going out keeps its rate
        if self._serial is None:
            raise lost(self.name, "it is closed")
        _retune(self.name, self._serial, rate)
        self.rate = rate
        _check_rate(self.name, self._descriptor, rate)

    def fileno(self) -> int | None:
        return self._descriptor

    def close(self) -> None:
        serial, self._serial = self._serial, None
        if serial is not None:
            if self.paced:
                _exclude_others(self._descriptor, exclude=False)
            self._descriptor = -1
            with contextlib.suppress(OSError):
                serial.close()
        self.lock.release()


class PolledLink:
    """A port without a descriptor to wait for: a COM port of Windows, or a server that speaks RFC 2217.

    It is looked at once a millisecond while somebody waits. Arguments and errors as for `SerialLink`; a server may take
    so many s of `patience`.
    """

    virtual = False
    simulated = False

    def __init__(
        self, port: str, *, rate: int, kept: PortLock | None = None, patience: float = CONNECT_TIME
    ) -> None:
        remote = "://" in port
        if remote:
            split_address(port)
        self.name = port
        self.rate = rate
        self.paced = not remote and is_sharp()  # what is behind a server cannot be known
        self.latency = REMOTE_LATENCY if remote else adapters.WINDOWS_LATENCY
        self.warnings: tuple[str, ...] = ()
        self._turn = Lock()
        self._closed = False
        self.lock = taken(port, kept)
        try:
            self._serial = _opened(port, port, rate, patience)
        except BaseException:
            self.lock.release()
            raise
        _send_at_once(self._serial)

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: Data) -> None:
        assert isinstance(data, bytes)
        with self._turn:
            self._check()
            try:
                self._serial.write(data, timeout=0)
            except (BlockingIOError, TimeoutError):
                raise full(self.name, 0, len(data)) from None
            except _failures() as error:
                raise lost(self.name, error) from error

    def read(self, until: float) -> list[Data]:
        while True:
            data = self._ask()
            pause = until - time.monotonic()
            if data or pause <= 0:
                return [data] if data else []
            time.sleep(min(ASK_AGAIN, pause))

    def _ask(self) -> bytes:
        """What has arrived, without waiting."""
        room = bytearray(CHUNK)
        with self._turn:
            self._check()
            try:
                return bytes(room[: self._serial.readinto(room, timeout=0)])
            except _failures() as error:
                raise lost(self.name, error) from error

    def tune(self, rate: int, listen_only: bool = False) -> None:
        with self._turn:
            self._check()
            _retune(self.name, self._serial, rate)
            self.rate = rate

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        with self._turn, contextlib.suppress(OSError):
            self._closed = True
            self._serial.close()
        self.lock.release()

    def _check(self) -> None:
        if self._closed:
            raise lost(self.name, "it is closed")


def open_serial(
    port: str, *, rate: int, kept: PortLock | None = None, patience: float | None = None
) -> SerialLink | PolledLink:
    """Open a device, a COM port or an rfc2217:// URL. Errors as for `SerialLink`.

    A server that is waited for with `patience` (s) gets a while to agree on its options all the same.
    """
    if "://" in port or os.name == "nt":
        allowed = CONNECT_TIME if patience is None else max(patience, AGREEING)
        return PolledLink(port, rate=rate, kept=kept, patience=allowed)
    return SerialLink(port, rate=rate, kept=kept)


# -- opening ----------------------------------------------------------------------------------------------------


def is_sharp() -> bool:
    """Whether the clock can tell how long a frame took. That of Windows before Python 3.13 ticks every 15.6 ms: an
    answer that comes within a tick would seem to have come sooner than it can."""
    return time.get_clock_info("monotonic").resolution <= SHARP


def could_be_a_port(device: str) -> bool:
    """A character device, and not one like /dev/null that half of all programs have open."""
    about = os.stat(device)
    is_memory = sys.platform == "linux" and os.major(about.st_rdev) == MEMORY_DEVICES
    return stat.S_ISCHR(about.st_mode) and not is_memory


def _opened(port: str, target: str, rate: int, patience: float = CONNECT_TIME) -> BaseSerial:
    import serialx

    try:
        serial = serialx.serial_for_url(target, baudrate=rate, connect_timeout=patience)
        serial.open()
    except OSError as error:
        if "://" in port:
            _refuse_remote(port, patience, error)
        _refuse(port, target, error)
    except serialx.UnsupportedSetting as error:
        raise wrong_rate(port, rate, error) from error
    except (serialx.SerialException, ValueError) as error:
        raise LinkError(f"{port} cannot be opened: {error}") from error
    return serial


def _refuse(port: str, device: str, error: OSError) -> NoReturn:
    """Say why a port cannot be opened."""
    if error.errno in GONE:
        raise not_found(port, ports()) from error
    if error.errno == errno.EBUSY or (os.name == "nt" and isinstance(error, PermissionError)):
        raise busy(port, who_holds(device)) from error
    if isinstance(error, PermissionError):
        raise forbidden(port, device) from error
    if error.errno == errno.ENOTTY:
        raise no_port(port, ports()) from error
    raise LinkError(f"{port} cannot be opened: {error.strerror or error}") from error


def _refuse_remote(port: str, patience: float, error: OSError) -> NoReturn:
    """Say why a server cannot be used."""
    if isinstance(error, TimeoutError):
        raise LinkError(
            f"{port}: no RFC 2217 answer within {patience:g} s",
            cause="the host is off, or it passes bytes on without that protocol",
            advice="try socket:// in place of rfc2217://",
        ) from error
    if isinstance(error, (ConnectionRefusedError, socket.gaierror)) or error.errno in UNREACHABLE:
        raise PortNotFound(f"{port} cannot be reached: {error}", advice="is the server running?") from error
    raise LinkError(f"{port} cannot be opened: {error}") from error


def _exclude_others(descriptor: int, *, exclude: bool) -> None:
    """Have the kernel refuse whoever opens the port after us; those with root's rights it never refuses."""
    import fcntl
    import termios

    with contextlib.suppress(OSError):
        fcntl.ioctl(descriptor, termios.TIOCEXCL if exclude else termios.TIOCNXCL)


def _send_at_once(serial: BaseSerial) -> None:
    """serialx leaves it to TCP when a request to a server goes out; that may cost 40 ms behind one without reply."""
    connection = getattr(serial, "_socket", None)
    if connection is not None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        give_up_soon(connection)


# -- rates ------------------------------------------------------------------------------------------------------


def _retune(port: str, serial: BaseSerial, rate: int) -> None:
    import serialx

    if rate <= 0:
        raise RequestError(f"{rate} is not a rate in bit/s")
    try:
        serial.reconfigure_port(baudrate=rate)
    except serialx.UnsupportedSetting as error:
        raise wrong_rate(port, rate, error) from error
    except (OSError, serialx.SerialException) as error:
        raise lost(port, error) from error


def _check_rate(port: str, descriptor: int, rate: int) -> None:
    """An adapter may round what it was asked for, and a byte survives only so much."""
    told = line_speed(descriptor) if sys.platform == "linux" else None
    if told is not None and abs(told - rate) > TOLERANCE * rate:
        raise wrong_rate(port, rate, f"the adapter makes {told} of it")


def _failures() -> tuple[type[Exception], ...]:
    import serialx

    return (OSError, serialx.SerialException)
