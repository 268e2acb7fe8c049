"""CAN channels that python-can opens: `can://INTERFACE/CHANNEL`.

Every interface of python-can works, with its configuration files and CAN_* variables. Where python-can would silently
take another bit rate, ignore an option or wait without end, this link raises an error. python-can is imported here
only, when a port is opened.
"""

from __future__ import annotations

import errno
import logging
import os
import time
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any, Final

from motorbus.core.operation import ERROR_FLAG, CanFrame, Data
from motorbus.errors import LinkError, LinkLost, MotorbusError, PortNotFound, RequestError
from motorbus.link import usb_adapters
from motorbus.link.can_channel import BusChannel, Counts, TextChannel, open_bus
from motorbus.link.can_options import SHARED, TEXT_OPTIONS, CanOptions, read_options
from motorbus.link.can_rates import check_rate, ip_command, kernel_rate
from motorbus.link.errors import busy
from motorbus.link.lock import PortLock, opening
from motorbus.link.serial import NO_DEVICE
from motorbus.link.slcan import SlcanChannel, open_slcan, rate_command
from motorbus.link.socketcand import open_socketcand

BUS_OFF: Final = 0x40  # CAN_ERR_BUSOFF in the identifier of an error frame, linux/can/error.h
INSTALL: Final = 'pip install "motorbus[can]"'
_FRAME_DESCRIPTOR: Final = ("socketcan", "udp_multicast")
"""Interfaces whose descriptor is readable exactly when there is a frame."""
_KERNEL_ERRORS: Final = ("socketcan", "socketcand")
"""Interfaces whose error frames are those of the Linux kernel."""
_LATENCY: Final = {
    "virtual": usb_adapters.TERMINAL_LATENCY,  # two threads are scheduled
    "udp_multicast": usb_adapters.TERMINAL_LATENCY,
    "socketcan": usb_adapters.USB_TIME,  # of the USB adapter below the kernel
}
"""s; any other adapter has the latency of a USB device."""
_EXTRAS: Final = {
    "gs_usb": "gs-usb",
    "udp_multicast": "multicast",
    **{name: name for name in ("canalystii", "cantact", "neovi", "nixnet", "serial", "seeedstudio")},
}
"""The extra of python-can that a back end needs."""
_DRIVERS: Final = {
    "pcan": "PEAK's PCAN-Basic library",
    "kvaser": "Kvaser's CANlib",
    "ixxat": "the VCI driver (Windows)",
    "vector": "Vector's XL driver (Windows)",
}
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


def python_can(port: str) -> ModuleType:
    """The module python-can, without log output by default. Raises LinkError when it is not installed."""
    try:
        import can
    except ImportError as error:
        raise LinkError(f"{port} needs python-can, which is missing: {error}", advice=INSTALL) from None
    log = logging.getLogger("can")
    if not log.handlers:
        log.addHandler(logging.NullHandler())
    return can


def describe(port: str, options: Mapping[str, object]) -> CanOptions:
    """What this address means, without opening it. Raises RequestError, or LinkError without python-can."""
    return read_options(python_can(port), port, 0, options)


class CanLink:
    """An open CAN channel.

    `rate`          bit/s from the user; 0 when not given
    `default_rate`  bit/s of the family
    `options`       `listen_only` (yes, no), `config_context` (a section of python-can's configuration), and what the
                    back end's constructor takes
    `shared`        takes part beside a host of this machine, as simulated devices do: SocketCAN is not locked
    `lock`          a lock that the caller already holds
    `connect_time`  time-out in s for a host of the network

    `lock_name` names the adapter for its lock and its emergency stop; "" for a shared channel. `no_wire`: no device
    can be real. Raises RequestError for an unknown interface or option, PortNotFound, PortBusy, or LinkError: for a bit
    rate that the adapter does not have, a missing driver, a refusal.
    """

    paced = False  # adapters do not report when a frame was on the wire
    virtual = False
    simulated = False
    timeless = False  # frames through a pseudo-terminal take no time

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
        self._connect_time = connect_time
        self._can = python_can(port)
        self._options = found = read_options(self._can, port, rate, options or {})
        self._back_end: Any = None
        if found.interface not in TEXT_OPTIONS:
            try:
                self._back_end = self._can.interface._get_class_for_interface(found.interface)
            except Exception as error:
                raise open_error(found, error) from error
        self.warnings = found.warnings
        self.latency = _LATENCY.get(found.interface, usb_adapters.DEVICE_LATENCY)
        self.rate = self._checked_rate(default_rate)
        self.listen_only = found.listen_only
        self.no_wire = found.no_wire
        self.lock_name = found.lock_name
        self._changing = False
        self._reported = (0, 0)
        if self.lock_name and not (shared and found.interface == "socketcan"):
            with opening(self.lock_name, lock) as self.lock:
                self._channel = self._open(self.rate, self.listen_only)
        else:
            self.lock = PortLock(port)
            self._channel = self._open(self.rate, self.listen_only)

    def _checked_rate(self, default_rate: int) -> int:
        """The rate to open with. Raises LinkError when the adapter would make another one."""
        options = self._options
        if options.interface == "socketcan":
            rate, warnings = kernel_rate(options, options.rate, default_rate)
            self.warnings += warnings
            return rate
        rate = options.rate or options.timing_rate or default_rate
        if rate <= 0:
            raise RequestError(
                f"{self.name}: the bit rate is missing", expected="bitrate=500000, for example"
            )
        if options.sets_rate:
            check_rate(options, self._back_end, rate)
        elif options.rate and options.interface not in SHARED:
            place = "server" if options.interface == "socketcand" else "adapter"
            self.warnings += (
                f"the bit rate is set at the {place}; whether that is {rate} bit/s cannot be checked",
            )
        return rate

    def _open(self, rate: int, listen_only: bool) -> TextChannel | BusChannel:
        options = self._options
        if listen_only:
            self._check_can_listen()
        if options.interface in TEXT_OPTIONS:
            return self._open_text(rate, listen_only)
        try:
            settings = dict(options.settings)
            if options.sets_rate and "timing" not in settings:
                settings["bitrate"] = rate
            if listen_only:
                settings.update(_LISTEN_ONLY[options.interface])
                if "state" in settings:
                    settings["state"] = self._can.BusState[settings["state"]]
            bus = open_bus(self._back_end, options.channel, settings)
            descriptor = bus.fileno() if options.interface in _FRAME_DESCRIPTOR else None
            return BusChannel(self.name, bus, self._can.Message, descriptor)
        except MotorbusError:
            raise
        except Exception as error:  # each back end has its own types
            raise open_error(options, error) from error

    def _open_text(self, rate: int, listen_only: bool) -> TextChannel:
        options = self._options
        if options.interface == "socketcand":
            channel = open_socketcand(options, self._connect_time)
            self.latency = channel.latency
            return channel
        slcan = open_slcan(options, self.lock.borrow(), self._connect_time)
        try:
            slcan.configure(rate_command(options, rate), rate, listen_only=listen_only)
        except BaseException:
            slcan.close()
            raise
        self.latency = slcan.latency
        self.warnings += slcan.warnings
        self.timeless = os.path.realpath(options.device).startswith(usb_adapters.PSEUDO_TERMINALS)
        return slcan

    def _check_can_listen(self) -> None:
        interface = self._options.interface
        if interface not in _LISTEN_ONLY:
            raise LinkError(
                f"{self.name}: {interface} cannot only listen: its adapter would acknowledge frames",
                expected=f"listen_only with one of {', '.join(_LISTEN_ONLY)}",
                advice="leave out listen_only where nothing else is on the bus",
            )

    @property
    def device(self) -> str:
        """The serial port of the adapter; "" for any other channel."""
        return self._options.device

    def port_at(self, device: str) -> str:
        """The address of this adapter at another serial port."""
        _, at, baud = str(self._options.channel).partition("@")
        return f"can://{self._options.interface}/{device.lstrip('/')}{at}{baud}"

    @property
    def counts(self) -> Counts:
        """Damaged lines, refused commands and dropped frames."""
        return self._channel.counts

    def trouble(self) -> str:
        """What the adapter has reported since the last call, for the error of a missing reply; "" for nothing."""
        refused, damaged = self.counts.refused, self.counts.damaged
        before, self._reported = self._reported, (refused, damaged)
        if refused > before[0]:
            return (
                f"the adapter refused {refused - before[0]} frames: no node on the bus acknowledges them, the bit rate "
                "is another, or its buffer is full"
            )
        if damaged > before[1]:
            return f"{damaged - before[1]} lines of the adapter were damaged: its cable, or another program on its port"
        return ""

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: Data) -> None:
        if not isinstance(data, CanFrame):
            raise RequestError(f"{self.name} carries CAN frames, not bytes", sent=data)
        if self.listen_only:
            raise LinkError(f"{self.name} only listens and cannot send", sent=data)
        self._channel.write(data)

    def read(self, until: float) -> list[Data]:
        channel = self._channel
        try:
            frames = channel.read(until)
        except LinkLost:
            if channel is self._channel and not self._changing:
                raise
            time.sleep(0.001)
            return []  # another thread reopens it for another rate
        if frames and self._options.interface in _KERNEL_ERRORS:
            check_bus_off(self.name, frames)
        return frames

    def tune(self, rate: int, listen_only: bool = False) -> None:
        if rate < 0:
            raise RequestError(f"{rate} is not a rate in bit/s")
        rate = rate or self.rate
        if (rate, listen_only) == (self.rate, self.listen_only):
            return
        if listen_only:
            self._check_can_listen()
        options = self._options
        if options.interface == "socketcan":
            self._check_kernel(rate, listen_only)
        elif options.interface not in SHARED:
            if not options.sets_rate and rate != self.rate:
                raise LinkError(
                    f"{self.name}: the bit rate of {options.interface} cannot be changed to {rate} bit/s from here",
                    advice="set it where the adapter is",
                )
            check_rate(options, self._back_end, rate)
            self._change(rate, listen_only)
        self.rate, self.listen_only = rate, listen_only

    def _check_kernel(self, rate: int, listen_only: bool) -> None:
        _, unknown = kernel_rate(self._options._replace(listen_only=listen_only), rate, rate)
        if unknown:
            raise LinkError(
                f"{self.name}: the bit rate of a SocketCAN interface is set by the system",
                advice=ip_command(str(self._options.channel), rate, listen_only),
            )

    def _change(self, rate: int, listen_only: bool) -> None:
        """Set up the adapter again; as before when that fails."""
        self._changing = True
        try:
            self._set_up(rate, listen_only)
        except MotorbusError:
            self._set_up(self.rate, self.listen_only)
            raise
        finally:
            self._changing = False

    def _set_up(self, rate: int, listen_only: bool) -> None:
        if isinstance(self._channel, SlcanChannel):
            command = rate_command(self._options, rate)
            self._channel.configure(command, rate, listen_only=listen_only)
        else:
            self._channel.close()
            self._channel = self._open(rate, listen_only)

    def fileno(self) -> int | None:
        return self._channel.fileno()

    def close(self) -> None:
        self._channel.close()
        self.lock.release()


def check_bus_off(name: str, frames: Iterable[Data]) -> None:
    """Raise LinkLost for an error frame of the kernel that reports bus off: the controller sends nothing any more."""
    for frame in frames:
        if isinstance(frame, CanFrame) and frame.id & ERROR_FLAG and frame.id & BUS_OFF:
            raise LinkLost(
                f"{name} is off the bus: its controller has counted too many errors",
                received=frame,
                cause="a short circuit, another bit rate on the bus, no terminating resistors, or no other node",
                advice="check the bus; an interface without restart-ms needs `ip link set can0 type can restart`",
            )


def open_error(options: CanOptions, error: Exception) -> MotorbusError:
    """The error for what python-can has raised at open: a missing driver is an ImportError here, a NameError there."""
    name, interface = options.name, options.interface
    source = error.__cause__ if isinstance(error.__cause__, OSError) else error
    code = getattr(source, "errno", None) or getattr(error, "error_code", None)
    if isinstance(error, (NotImplementedError, ImportError, NameError)) or "library not found" in str(error):
        advice = f"install {_DRIVERS.get(interface, 'the driver that comes with the adapter')}"
        if interface in _EXTRAS:
            advice = f'pip install "python-can[{_EXTRAS[interface]}]"'
        return LinkError(f"{name}: the driver of {interface} is missing: {error}", advice=advice)
    if isinstance(error, (ValueError, TypeError)):
        return RequestError(f"{name}: python-can's {interface} refuses this: {error}")
    if code in NO_DEVICE:
        return PortNotFound(f"{name}: there is no {interface} channel {options.channel}: {error}")
    if code == errno.EAFNOSUPPORT:
        return LinkError(
            f"{name}: the kernel of this system has no CAN",
            advice="sudo modprobe can-raw; where there is none, use the adapter by can://slcan/…",
        )
    if code == errno.EBUSY:
        return busy(name, None)
    return LinkError(
        f"{name} cannot be opened: {error}", advice="is the adapter plugged in, the channel right?"
    )
