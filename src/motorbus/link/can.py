"""CAN channels: `can://INTERFACE/CHANNEL`.

Options of the address go to `can.Bus` of python-can as they are, and its configuration files and CAN_* variables count
where the address says nothing. slcan is read by our own code. python-can is imported here only, when a port is opened.
Some back ends ignore an unknown option, and some take another bit rate for one that they do not have.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import re
import subprocess
import time
import warnings
from collections.abc import Mapping
from contextlib import nullcontext
from math import inf
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any, Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, LinkFull, LinkLost, MotorbusError, PortNotFound, RequestError
from motorbus.link import usb_adapters
from motorbus.link.errors import busy, lost
from motorbus.link.lock import PortLock, opening
from motorbus.link.serial import NO_DEVICE

BUS_OFF: Final = 0x40  # CAN_ERR_BUSOFF in the identifier of an error frame, linux/can/error.h
SLICE: Final = 0.02  # s of one wait inside python-can
AT_ONCE: Final = 0.001  # s; a read that has a frame waits no longer for a second one
SERIAL_WAIT: Final = 0.1  # s; time-out of the serial port in python-can's back ends
SOCKETCAND_PORT: Final = 29536
IP_TIME: Final = 2.0  # s; time-out for the program `ip`
EXAMPLES: Final = "can://slcan/dev/ttyACM0, can://socketcan/can0 or can://socketcand/localhost:29536/can0"

SERIAL_PORTS: Final = ("slcan", "serial", "robotell", "seeedstudio")
"""Interfaces whose channel is a serial port."""
SHARED: Final = ("virtual", "udp_multicast")
"""Interfaces without bit rate and wire, which any number of programs share."""
_WAITING: Final = ("serial", "seeedstudio")
"""Interfaces whose recv(0) waits for their serial port."""
_FRAME_DESCRIPTOR: Final = ("socketcan", "udp_multicast")
"""Interfaces whose descriptor is readable exactly when there is a frame."""
_IDENTIFIER: Final = ERROR_FLAG - 1
_FULL: Final = (errno.ENOBUFS, errno.EAGAIN)
_FULL_TEXTS: Final = ("full", "overflow", "could not send message to one or more")
_SWITCHES: Final[Mapping[object, bool]] = {"yes": True, "on": True, "no": False, "off": False}
LISTEN_ONLY: Final[Mapping[str, Mapping[str, Any]]] = {
    "slcan": {},  # by a command
    "socketcan": {},  # by the kernel
    "virtual": {},
    "udp_multicast": {},
    "pcan": {"state": "PASSIVE"},
    "kvaser": {"driver_mode": False},
    "vector": {"listen_only": True},
    "cantact": {"monitor": True},
    "seeedstudio": {"operation_mode": "silent"},
}
"""The settings with which a back end only listens; the others cannot."""


class CanAddress(NamedTuple):
    """A CAN channel of this machine; `options` are arguments of `can.Bus` that are part of the address.

    `lock_name` is the one name under which the adapter is locked; "" for a shared channel.
    `device` is the serial port of the adapter on this machine; "" for any other channel.
    """

    name: str
    interface: str
    channel: str
    options: Mapping[str, object]
    lock_name: str
    device: str

    @property
    def sets_rate(self) -> bool:
        """Whether the program that opens the channel sets its bit rate."""
        return self.interface not in (*SHARED, "socketcan", "socketcand", "serial")

    @property
    def no_wire(self) -> bool:
        """Whether only programs are on this channel, so that no device can be real."""
        virtual = self.interface == "socketcan" and self.channel.startswith(("vcan", "vxcan"))
        return virtual or self.interface in SHARED


def read_address(port: str) -> CanAddress:
    """The parts of `can://INTERFACE/CHANNEL`. Raises RequestError, or LinkError without python-can.

    The channel of a serial adapter that is neither a URL nor a COM port begins with `/`.
    """
    interface, _, channel = port.partition("://")[2].partition("/")
    interface, device = interface.lower(), ""
    options: dict[str, object] = {}
    lock_name = f"can://{interface}/{channel}"
    if interface == "socketcand":
        server, _, channel = channel.partition("/")
        host, _, number = server.partition(":")
        options = {"host": host, "port": number or SOCKETCAND_PORT}
        lock_name = f"can://socketcand/{host}:{options['port']}/{channel}"
    elif interface in SERIAL_PORTS:
        if channel and not re.match(r"/|\w+://|(?i:COM)\d", channel):
            channel = f"/{channel}"
        lock_name = channel.partition("@")[0]
        device = "" if "://" in channel else lock_name
    if not interface or (not channel and interface in (*SERIAL_PORTS, "socketcand")):
        problem = "does not name an interface and its channel"
    elif interface not in python_can(port).VALID_INTERFACES:
        problem = f"python-can has no interface {interface!r}"
    else:
        lock_name = "" if interface in SHARED else lock_name
        return CanAddress(port, interface, channel, options, lock_name, device)
    raise RequestError(f"{port!r}: {problem}", expected=f"can://INTERFACE/CHANNEL, as {EXAMPLES}")


def python_can(port: str) -> ModuleType:
    """The module python-can, without log output by default. Raises LinkError when it is not installed."""
    try:
        import can
    except ImportError as error:
        advice = 'pip install "motorbus[can]"'
        raise LinkError(f"{port} needs python-can, which is missing: {error}", advice=advice) from None
    log = logging.getLogger("can")
    if not log.handlers:
        log.addHandler(logging.NullHandler())
    return can


class CanLink:
    """An open CAN channel; a subclass opens it in `configure` and closes it in `shut`.

    `options` are `listen_only` (yes, no) and what the subclass knows. `shared`: the caller takes part beside a host of
    this machine, as simulated devices do, so SocketCAN is not locked. Other arguments are those of `open_link`.
    `lock_name`, `device` and `no_wire` are those of `CanAddress`. `queue` is the number of frames that the adapter
    takes at once, 0 if unknown. Raises RequestError for a bad option, PortNotFound, PortBusy, or LinkError: for a rate
    or mode that the adapter does not have, a missing driver, a refusal.
    """

    paced = False  # adapters do not report when a frame was on the wire
    virtual = False
    simulated = False
    latency = usb_adapters.DEVICE_LATENCY
    warnings: tuple[str, ...] = ()
    queue = 0
    now = staticmethod(time.monotonic)

    def __init__(
        self,
        address: CanAddress,
        *,
        rate: int = 0,
        default_rate: int = 0,
        options: Mapping[str, object] | None = None,
        shared: bool = False,
        lock: PortLock | None = None,
        connect_time: float | None = None,
    ) -> None:
        self.name = address.name
        self.address = address
        self.no_wire, self.lock_name, self.device = address.no_wire, address.lock_name, address.device
        self.options = {name: _SWITCHES.get(value, value) for name, value in (options or {}).items()}
        self.connect_time = connect_time
        self.rate = rate or default_rate
        self.listen_only = bool(listen_only := self.options.pop("listen_only", False))
        if not isinstance(listen_only, bool):
            raise RequestError(f"listen_only={listen_only}: neither yes nor no", expected="yes or no")
        if self.rate <= 0:
            raise RequestError(
                f"{self.name}: the bit rate is missing", expected="bitrate=500000, for example"
            )
        if listen_only and address.interface not in LISTEN_ONLY:
            raise LinkError(
                f"{self.name}: {address.interface} cannot only listen: its adapter would acknowledge frames",
                expected=f"listen_only with one of {', '.join(LISTEN_ONLY)}",
                advice="leave out listen_only where nothing else is on the bus",
            )
        is_kernel = address.interface == "socketcan"
        if is_kernel:
            self.queue = kernel_queue(address.channel)
            actual = kernel_rate(address, rate, listen_only)
            if actual is None:
                self.warnings = (f"the kernel did not tell the bit rate; {self.rate} bit/s is assumed",)
            self.rate = actual or self.rate
        is_free = not self.lock_name or (shared and is_kernel)
        with nullcontext(PortLock(self.name)) if is_free else opening(self.lock_name, lock) as self.lock:
            self.open_port()
            try:
                self.configure(self.rate)
            except BaseException:
                self.shut()
                raise

    def open_port(self) -> None:
        """Prepare for `configure`: open the serial port of the adapter, where that is apart from its channel."""

    def configure(self, rate: int) -> None:
        """Open the channel again, at this rate in bit/s. Raises LinkError for a rate or mode that it refuses."""
        raise NotImplementedError

    def shut(self) -> None:
        """Close the channel. A second call does nothing."""
        raise NotImplementedError

    def send(self, frame: CanFrame) -> None:
        """Send a frame; raises as `Link.write` does."""
        raise NotImplementedError

    def write(self, data: Data) -> None:
        assert isinstance(data, CanFrame)
        if self.listen_only:
            raise LinkError(f"{self.name} only listens and cannot send", sent=data)
        self.send(data)

    def tune(self, rate: int) -> None:
        if rate == self.rate:
            return
        if self.address.sets_rate:
            try:
                self.configure(rate)
            except MotorbusError:
                self.configure(self.rate)
                raise
        elif self.address.interface not in SHARED:
            raise LinkError(
                f"{self.name}: its bit rate cannot be changed from here",
                advice="set it where the adapter is: `ip link set` for SocketCAN",
            )
        self.rate = rate

    def trouble(self) -> str:
        """What the adapter has reported since the last call, for the error of a missing reply; "" for nothing."""
        return ""

    def port_at(self, device: str) -> str:
        """The address of this adapter at another serial port."""
        _, at, baud = self.address.channel.partition("@")
        return f"can://{self.address.interface}/{device.lstrip('/')}{at}{baud}"

    def close(self) -> None:
        self.shut()
        self.lock.release()


class PythonCanLink(CanLink):
    """A channel of python-can; `options` are arguments of `can.Bus`.

    `read` waits in short slices, so that another thread can close the link.
    """

    _bus: Any = None
    _descriptor: int | None = None

    def open_port(self) -> None:
        interface = self.address.interface
        self._can: Any = python_can(self.name)
        self._access = Lock()
        self._waits = interface in _WAITING  # so a read takes one frame
        if interface in SHARED:
            self.latency = usb_adapters.TERMINAL_LATENCY
        if self._waits:
            self.latency += SERIAL_WAIT
            wait = f"waits up to {1000 * SERIAL_WAIT:.0f} ms for a frame, so requests are slow"
            self.warnings = (f"python-can's {interface} {wait}",)

    def configure(self, rate: int) -> None:
        self.shut()
        address = self.address
        settings = {**self.options, **address.options}
        if address.sets_rate and "f_clock" not in settings:  # a bit timing of python-can
            settings["bitrate"] = rate
        if self.listen_only:
            settings.update(LISTEN_ONLY[address.interface])
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about adjusted clocks and deprecated names
                self._bus = self._can.Bus(address.channel or None, address.interface, **settings)
            if address.interface in _FRAME_DESCRIPTOR:
                self._descriptor = self._bus.fileno()
        except Exception as error:  # each back end has its own types
            raise open_error(address, error) from error

    def read(self, until: float) -> list[Data]:
        """See `Link.read`. Raises LinkLost too when an error frame of the kernel reports bus off."""
        frames: list[CanFrame] = []
        while not frames:
            pause = max(0.0, min(until - time.monotonic(), SLICE))
            with self._access:
                frames = self._receive(pause)
            if time.monotonic() >= until:
                break
        if self.address.interface.startswith("socketcan"):  # others have other bits
            for frame in frames:
                if frame.id & ERROR_FLAG and frame.id & BUS_OFF:
                    raise LinkLost(
                        f"{self.name} is off the bus: its controller has counted too many errors",
                        received=frame,
                        cause="a short circuit, another bit rate on the bus, no terminating resistors, no other node",
                        advice="check the bus; SocketCAN without restart-ms needs `ip link set can0 type can restart`",
                    )
        return [*frames]

    def _receive(self, pause: float) -> list[CanFrame]:
        """The frames that are there; waits so long (s) for the first."""
        frames: list[CanFrame] = []
        end = inf
        if self._bus is None:
            raise lost(self.name, "it is closed")
        try:
            while time.monotonic() < end and (message := self._bus.recv(pause)) is not None:
                pause = 0.0
                if (frame := frame_of(message)) is not None:
                    frames.append(frame)
                    end = 0.0 if self._waits else min(end, time.monotonic() + AT_ONCE)
        except Exception as error:  # each back end has its own types
            raise lost(self.name, error) from error
        return frames

    def send(self, frame: CanFrame) -> None:
        message = self._can.Message(
            arbitration_id=frame.id, data=bytearray(frame.data), is_extended_id=frame.extended
        )
        if self._bus is None:
            raise lost(self.name, "it is closed")
        try:
            self._bus.send(message, 0)
        except Exception as error:  # each back end has its own types
            text = str(error).lower()
            is_full = isinstance(error, TimeoutError) or _error_code(error) in _FULL
            if is_full or any(words in text for words in _FULL_TEXTS):
                raise LinkFull(
                    f"{self.name} takes no more frames: {error}",
                    cause="no node acknowledges, the bus is off, or frames are written faster than its rate",
                ) from error
            raise lost(self.name, error) from error

    def fileno(self) -> int | None:
        return self._descriptor

    def shut(self) -> None:
        bus, self._bus, self._descriptor = self._bus, None, None
        if bus is not None:
            with self._access, contextlib.suppress(Exception):  # it may be broken already
                bus.shutdown()


def frame_of(message: Any) -> CanFrame | None:
    """The frame of a python-can message; None for a remote or CAN FD frame, and for our own frames."""
    if message.is_fd or message.is_remote_frame or not message.is_rx:
        return None
    if message.is_error_frame:
        return CanFrame(message.arbitration_id & _IDENTIFIER | ERROR_FLAG, bytes(message.data or b"")[:8])
    return CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id)


def kernel_queue(channel: str, sysfs: Path = Path("/sys")) -> int:
    """Frames that a SocketCAN interface takes at once; 0 when the system does not tell."""
    try:
        return int((sysfs / "class" / "net" / channel / "tx_queue_len").read_text())
    except (OSError, ValueError):
        return 0


def kernel_rate(address: CanAddress, rate: int, listen_only: bool) -> int | None:
    """The bit rate (bit/s) of a SocketCAN interface; 0 for a virtual one, None when `ip` does not tell.

    Raises LinkError when the interface is off, or set to another rate or mode. `rate` is 0 for any.
    """
    channel = address.channel
    command = ["ip", "-details", "-json", "link", "show", "dev", channel]
    try:
        output = subprocess.run(command, capture_output=True, timeout=IP_TIME, check=True).stdout
        about = json.loads(output)[0]
        data = about.get("linkinfo", {}).get("info_data", {})
        actual = int(data.get("bittiming", {}).get("bitrate", 0))
        is_up = "UP" in about["flags"]
        listens = "LISTEN-ONLY" in data.get("ctrlmode", ())
    except (OSError, subprocess.SubprocessError, ValueError, LookupError, TypeError, AttributeError):
        return None
    if not is_up:
        problem = f"{channel} is switched off"
    elif actual and rate and rate != actual:
        problem = f"the kernel runs {channel} at {actual} bit/s, not at {rate}"
    elif actual and listen_only != listens:
        problem = f"the kernel {'only listens' if listens else 'takes full part'} on {channel}"
    else:
        return actual
    mode = "on" if listen_only else "off"
    raise LinkError(
        f"{address.name}: {problem}",
        cause="the system sets up a SocketCAN interface, not the program that uses it",
        advice=f"sudo ip link set {channel} down; "
        f"sudo ip link set {channel} up type can bitrate {rate or actual or 'RATE'} listen-only {mode}",
    )


def open_error(address: CanAddress, error: Exception) -> MotorbusError:
    """The error for what python-can has raised at open: a missing driver is an ImportError here, a NameError there."""
    name, interface, code = address.name, address.interface, _error_code(error)
    if isinstance(error, (NotImplementedError, ImportError, NameError)) or "library not found" in str(error):
        return LinkError(
            f"{name}: the driver of {interface} is missing: {error}",
            advice=f'install that of the maker, or pip install "python-can[{interface.replace("_", "-")}]"',
        )
    if isinstance(error, (ValueError, TypeError)):
        return RequestError(f"{name}: python-can's {interface} refuses this: {error}")
    if code in NO_DEVICE:
        return PortNotFound(f"{name}: there is no {interface} channel {address.channel}: {error}")
    if code == errno.EBUSY:
        return busy(name, None)
    return LinkError(
        f"{name} cannot be opened: {error}", advice="is the adapter plugged in, the channel right?"
    )


def _error_code(error: Exception) -> int | None:
    """The errno of an error of python-can, or of its cause."""
    cause = error.__cause__ if isinstance(error.__cause__, OSError) else error
    return getattr(cause, "errno", None) or getattr(error, "error_code", None)
