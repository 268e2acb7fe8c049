"""CAN channels: `can://INTERFACE/CHANNEL`.

Options of the address go to `can.Bus` of python-can as they are, and its configuration files and CAN_* variables count
where the address says nothing. slcan is read by our own code. python-can is imported here only, when a port is opened.
Some back ends ignore an unknown option, and some take another bit rate for one that they do not have.
"""

from __future__ import annotations

import contextlib
import difflib
import errno
import json
import logging
import os
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

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, LinkFull, LinkLost, MotorbusError, PortNotFound, RequestError
from motorbus.link import usb_adapters
from motorbus.link.errors import busy, lost
from motorbus.link.lock import PortLock, opening
from motorbus.link.serial import NO_DEVICE
from motorbus.link.slcan import SlcanChannel

BUS_OFF: Final = 0x40  # CAN_ERR_BUSOFF in the identifier of an error frame, linux/can/error.h
SLICE: Final = 0.02  # s of one wait inside python-can
AT_ONCE: Final = 0.001  # s; a read that has a frame waits no longer for a second one
WAITING: Final = 0.005  # s; a back end whose recv(0) takes longer waits for its serial port
MOST_LOOKS: Final = 64  # for frames that are there when the bus is opened
SERIAL_WAIT: Final = 0.1  # s; time-out of the serial port in python-can's back ends
_IDENTIFIER: Final = ERROR_FLAG - 1
_FULL: Final = (errno.ENOBUFS, errno.EAGAIN)
_FULL_TEXTS: Final = ("full", "overflow", "could not send message to one or more")
_FRAME_DESCRIPTOR: Final = ("socketcan", "udp_multicast")
"""Interfaces whose descriptor is readable exactly when there is a frame."""
_KERNEL_ERRORS: Final = ("socketcan", "socketcand")
"""Interfaces whose error frames are those of the Linux kernel."""
SERIAL_PORTS: Final = ("slcan", "serial", "robotell", "seeedstudio")
"""Interfaces whose channel is a serial port."""
SHARED: Final = ("virtual", "udp_multicast")
"""Interfaces without bit rate and wire, which any number of programs share."""
SOCKETCAND_PORT: Final = 29536
IP_TIME: Final = 2.0  # s; time-out for the program `ip`
EXAMPLES: Final = "can://slcan/dev/ttyACM0, can://socketcan/can0, can://socketcand/localhost/can0"
_SWITCHES: Final[Mapping[object, bool]] = {"yes": True, "on": True, "no": False, "off": False}
_LISTEN_ONLY: Final[Mapping[str, Mapping[str, Any]]] = {
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
    """A CAN channel of this machine; `options` are arguments of `can.Bus` that are part of the address."""

    name: str
    interface: str
    channel: str
    options: Mapping[str, object]

    @property
    def sets_rate(self) -> bool:
        """Whether the program that opens the channel sets its bit rate."""
        return self.interface not in (*SHARED, "socketcan", "socketcand", "serial")

    @property
    def no_wire(self) -> bool:
        """Whether only programs are on this channel, so that no device can be real."""
        virtual = self.interface == "socketcan" and self.channel.startswith(("vcan", "vxcan"))
        return virtual or self.interface in SHARED

    @property
    def device(self) -> str:
        """The serial port of this machine, for interfaces that use one; else ""."""
        is_local = self.interface in SERIAL_PORTS and "://" not in self.channel
        return self.channel.partition("@")[0] if is_local else ""

    @property
    def lock_name(self) -> str:
        """The one name under which the adapter is locked; "" for a shared channel."""
        if self.interface in SHARED:
            return ""
        if self.interface in SERIAL_PORTS:
            return self.device or self.channel.partition("@")[0]
        server = f"{self.options['host']}:{self.options['port']}/" if self.interface == "socketcand" else ""
        return f"can://{self.interface}/{server}{self.channel}"


def read_address(port: str) -> CanAddress:
    """The parts of `can://INTERFACE/CHANNEL`. Raises RequestError.

    The channel of a serial adapter that is neither a URL nor a COM port begins with `/`.
    """
    interface, _, channel = port.partition("://")[2].partition("/")
    interface, options = interface.lower(), dict[str, object]()
    if not interface:
        raise RequestError(
            f"{port!r}: the interface is missing", expected=f"can://INTERFACE/CHANNEL, as {EXAMPLES}"
        )
    if interface == "socketcand":
        host, _, channel = channel.partition("/")
        host, _, number = host.partition(":")
        if not channel:
            raise RequestError(
                f"{port!r} does not name a channel of a server",
                expected="can://socketcand/HOST:PORT/CHANNEL, as can://socketcand/localhost:29536/can0",
            )
        options = {"host": host, "port": number or SOCKETCAND_PORT}
    if interface in SERIAL_PORTS:
        if not channel:
            raise RequestError(
                f"{port}: the serial port of the adapter is missing",
                expected=f"can://{interface}/dev/ttyACM0",
            )
        has_name = channel.startswith("/") or "://" in channel or re.fullmatch(r"COM\d+(@\d+)?", channel)
        if not has_name and os.name != "nt":
            channel = f"/{channel}"
    return CanAddress(port, interface, channel, options)


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


def describe(port: str) -> CanAddress:
    """The parts of an address whose interface exists. Raises RequestError, or LinkError without python-can."""
    address = read_address(port)
    known = python_can(port).VALID_INTERFACES
    if address.interface not in known:
        near = difflib.get_close_matches(address.interface, known, 1)
        raise RequestError(
            f"{port!r}: python-can has no interface {address.interface!r}",
            advice=f"did you mean {near[0]}?" if near else f"for example {EXAMPLES}",
        )
    return address


class CanLink:
    """An open CAN channel. Arguments as for `open_link`. `queue`: frames that it takes at once, 0 if unknown.

    `options`  `listen_only` (yes, no), and arguments of `can.Bus`; see `SlcanChannel` for those of slcan
    `shared`   the caller takes part beside a host of this machine, as simulated devices do: SocketCAN is not locked

    `lock_name` names the adapter for its lock and its emergency stop; "" for a shared channel. `no_wire`: no device
    can be real. `device` is the serial port of the adapter; "" for any other channel. Raises RequestError for an
    unknown interface or option, PortNotFound, PortBusy, or LinkError: for a bit rate that the adapter does not have, a
    missing driver, a refusal.
    """

    paced = False  # adapters do not report when a frame was on the wire
    virtual = False
    simulated = False

    def __init__(
        self,
        port: str,
        *,
        rate: int = 0,
        default_rate: int = 0,
        options: Mapping[str, object] | None = None,
        shared: bool = False,
        lock: PortLock | None = None,
        connect_time: float | None = None,
    ) -> None:
        self.name = port
        self._address = address = describe(port)
        given = {name: _SWITCHES.get(value, value) for name, value in (options or {}).items()}
        listen_only = given.pop("listen_only", False)
        if not isinstance(listen_only, bool):
            raise RequestError(f"listen_only={listen_only}: neither yes nor no", expected="yes or no")
        self.listen_only = listen_only
        self.no_wire, self.lock_name, self.device = address.no_wire, address.lock_name, address.device
        self.rate = rate or default_rate
        if self.rate <= 0:
            raise RequestError(f"{port}: the bit rate is missing", expected="bitrate=500000, for example")
        warning = self._check_settings(rate, self.listen_only)
        is_free = not self.lock_name or (shared and address.interface == "socketcan")
        with nullcontext(PortLock(port)) if is_free else opening(self.lock_name, lock) as self.lock:
            self._channel = self._open(given, connect_time)
        self.latency = self._channel.latency
        self.warnings = self._channel.warnings + warning
        self.queue = kernel_queue(address.channel) if address.interface == "socketcan" else 0

    def _check_settings(self, rate: int, listen_only: bool) -> tuple[str, ...]:
        """Check rate (bit/s, 0 for any) and mode; a warning when the adapter does not tell its rate.

        Raises LinkError when the adapter cannot have them.
        """
        address, interface = self._address, self._address.interface
        if listen_only and interface not in _LISTEN_ONLY:
            raise LinkError(
                f"{self.name}: {interface} cannot only listen: its adapter would acknowledge frames",
                expected=f"listen_only with one of {', '.join(_LISTEN_ONLY)}",
                advice="leave out listen_only where nothing else is on the bus",
            )
        if interface == "socketcan":
            actual = kernel_rate(address, rate, listen_only)
            if actual is None:
                return (f"the kernel did not tell the bit rate; {self.rate} bit/s is assumed",)
            self.rate = actual or self.rate
        elif rate and not address.sets_rate and interface not in SHARED:
            return (f"the bit rate is set at the server; whether that is {rate} bit/s cannot be checked",)
        return ()

    def _open(self, options: Mapping[str, object], connect_time: float | None) -> SlcanChannel | BusChannel:
        address = self._address
        channel: SlcanChannel | BusChannel
        if address.interface == "slcan":
            channel = SlcanChannel(self.name, address.channel, options, connect_time)
        else:
            channel = BusChannel(address, options)
        try:
            channel.configure(self.rate, self.listen_only)
        except BaseException:
            channel.close()
            raise
        return channel

    def port_at(self, device: str) -> str:
        """The address of this adapter at another serial port."""
        _, at, baud = self._address.channel.partition("@")
        return f"can://{self._address.interface}/{device.lstrip('/')}{at}{baud}"

    def trouble(self) -> str:
        """What the adapter has reported since the last call, for the error of a missing reply; "" for nothing."""
        return self._channel.trouble()

    now = staticmethod(time.monotonic)

    def write(self, data: Data) -> None:
        assert isinstance(data, CanFrame)
        if self.listen_only:
            raise LinkError(f"{self.name} only listens and cannot send", sent=data)
        self._channel.write(data)

    def read(self, until: float) -> list[Data]:
        """See `Link.read`. Raises LinkLost too when an error frame of the kernel reports bus off."""
        frames = self._channel.read(until)
        if frames and self._address.interface in _KERNEL_ERRORS:
            for frame in frames:
                if isinstance(frame, CanFrame) and frame.id & ERROR_FLAG and frame.id & BUS_OFF:
                    raise LinkLost(
                        f"{self.name} is off the bus: its controller has counted too many errors",
                        received=frame,
                        cause="a short circuit, another bit rate on the bus, no terminating resistors, no other node",
                        advice="check the bus; SocketCAN without restart-ms needs `ip link set can0 type can restart`",
                    )
        return frames

    def tune(self, rate: int, listen_only: bool = False) -> None:
        before, wanted = (self.rate, self.listen_only), (rate or self.rate, listen_only)
        if wanted == before:
            return
        if self._check_settings(*wanted):
            raise LinkError(
                f"{self.name}: the bit rate cannot be changed to {wanted[0]} bit/s from here",
                advice="set it where the adapter is: `ip link set` for SocketCAN",
            )
        if self._address.sets_rate:
            try:
                self._channel.configure(*wanted)
            except MotorbusError:
                self._channel.configure(*before)
                raise
        self.rate, self.listen_only = wanted

    def fileno(self) -> int | None:
        return self._channel.fileno()

    def close(self) -> None:
        self._channel.close()
        self.lock.release()


class BusChannel:
    """A bus of python-can; `configure` opens it. `read` waits in short slices, so that another thread can close it."""

    warnings: tuple[str, ...] = ()

    def __init__(self, address: CanAddress, options: Mapping[str, object]) -> None:
        self.name = address.name
        is_shared = address.interface in SHARED
        self.latency = usb_adapters.TERMINAL_LATENCY if is_shared else usb_adapters.DEVICE_LATENCY
        self._address = address
        self._settings = {**options, **address.options}
        self._can: Any = python_can(address.name)
        self._bus: Any = None
        self._descriptor: int | None = None
        self._access = Lock()
        self._waits = False
        """recv(0) waits, so a read takes one frame."""

    def configure(self, rate: int, listen_only: bool) -> None:
        """Open the bus again, at this rate in bit/s. Raises LinkError, or RequestError for what it refuses."""
        self.close()
        address, settings = self._address, dict(self._settings)
        if address.sets_rate and "f_clock" not in settings:  # a bit timing of python-can
            settings["bitrate"] = rate
        if listen_only:
            settings.update(_LISTEN_ONLY[address.interface])
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about adjusted clocks and deprecated names
                self._bus = self._can.Bus(address.channel or None, address.interface, **settings)
            if address.interface in _FRAME_DESCRIPTOR:
                self._descriptor = self._bus.fileno()
            else:
                self._measure()
        except Exception as error:  # each back end has its own types
            raise open_error(address, error) from error

    def _measure(self) -> None:
        """Find out whether recv(0) waits; twice, as another program may have had the processor."""
        waits: list[float] = []
        with contextlib.suppress(Exception):  # a damaged frame, say
            for _ in range(MOST_LOOKS):
                begin = time.monotonic()
                is_empty = self._bus.recv(0.0) is None
                seconds = time.monotonic() - begin
                if is_empty or seconds > WAITING:  # a frame that is there tells nothing
                    waits.append(seconds)
                if len(waits) == 2:
                    break
        wait = min(waits, default=0.0)
        if wait > WAITING and not self._waits:
            wait = max(wait, SERIAL_WAIT)
            self._waits = True
            self.latency += wait
            interface = self._address.interface
            self.warnings = (
                f"python-can's {interface} waits up to {1000 * wait:.0f} ms for a frame, so requests are slow",
            )

    def read(self, until: float) -> list[Data]:
        frames: list[Data] = []
        while not frames:
            pause = max(0.0, min(until - time.monotonic(), SLICE))
            with self._access:
                frames = self._receive(pause)
            if time.monotonic() >= until:
                break
        return frames

    def _receive(self, pause: float) -> list[Data]:
        """The frames that are there; waits so long (s) for the first."""
        frames: list[Data] = []
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

    def write(self, frame: CanFrame) -> None:
        message = self._can.Message(
            arbitration_id=frame.id & _IDENTIFIER,
            data=bytearray(frame.data),
            dlc=len(frame.data),
            is_extended_id=frame.extended,
            is_remote_frame=bool(frame.id & REMOTE_FLAG),
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

    def trouble(self) -> str:
        return ""

    def fileno(self) -> int | None:
        return self._descriptor

    def close(self) -> None:
        bus, self._bus, self._descriptor = self._bus, None, None
        if bus is not None:
            with self._access, contextlib.suppress(Exception):  # it may be broken already
                bus.shutdown()


def kernel_queue(channel: str, sysfs: Path = Path("/sys")) -> int:
    """Frames that a SocketCAN interface takes at once; 0 when the system does not tell."""
    try:
        return int((sysfs / "class" / "net" / channel / "tx_queue_len").read_text())
    except (OSError, ValueError):
        return 0


def frame_of(message: Any) -> CanFrame | None:
    """The frame of a python-can message; None for CAN FD and for our own frames."""
    if message.is_fd or not message.is_rx:
        return None
    if message.is_error_frame:
        return CanFrame(message.arbitration_id & _IDENTIFIER | ERROR_FLAG, bytes(message.data or b"")[:8])
    if message.is_remote_frame:
        return CanFrame(message.arbitration_id | REMOTE_FLAG, bytes(message.dlc), message.is_extended_id)
    return CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id)


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
