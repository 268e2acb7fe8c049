"""CAN channels, opened by python-can: `can://INTERFACE/CHANNEL`.

Whatever python-can opens can be used: socketcan, slcan, socketcand, pcan, kvaser, gs_usb, virtual and the rest, with
its configuration files and CAN_* variables. Where it falls back in silence (another bit rate, an option it does not
know), waits without end or reads a byte at a time, this link does not follow. python-can is imported here, when a
port is opened, and nowhere else.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, Final

from motorbus.core.operation import CanFrame, Data
from motorbus.errors import LinkError, LinkLost, MotorbusError, RequestError
from motorbus.link import adapters
from motorbus.link.can_config import NO_WIRE, SERIAL_PORTS, CanConfig, configured
from motorbus.link.can_port import ASK_AGAIN
from motorbus.link.can_rates import check_rate, ip_line, kernel_rate
from motorbus.link.can_refusal import INSTALL, device_of, refused
from motorbus.link.can_slcan import SlcanWire, command_of, open_slcan
from motorbus.link.can_socketcand import open_socketcand
from motorbus.link.can_wire import BusWire, Wire, build, refuse_bus_off
from motorbus.link.foreign import who_holds
from motorbus.link.identity import PSEUDO_TERMINALS
from motorbus.link.lock import PortLock, taken
from motorbus.link.refusal import busy, no_port, not_found
from motorbus.link.serial import could_be_a_port, ports

BY_DESCRIPTOR: Final = ("socketcan", "udp_multicast")
"""Back ends in which a readable descriptor means a frame, and a silent one that there is none."""
TELLS_ERRORS: Final = ("socketcan", "socketcand")
"""Back ends whose error frames say what is wrong in the words of the kernel."""
LATENCY: Final = {
    "virtual": adapters.TERMINAL_LATENCY,  # two threads have to be scheduled
    "udp_multicast": adapters.TERMINAL_LATENCY,
    "socketcan": adapters.USB_TIME,  # the kernel takes no time, the USB adapter below it may
}
"""s; any other adapter hands frames over as a USB device does."""


def python_can(wanted: str) -> ModuleType:
    """python-can, silent unless somebody listens to its log. Raises LinkError, naming how to install it."""
    try:
        import can
    except ImportError as error:
        raise LinkError(f"{wanted} needs python-can, which is missing: {error}", advice=INSTALL) from None
    log = logging.getLogger("can")
    if not log.handlers:
        log.addHandler(logging.NullHandler())
    return can


class CanLink:
    """An open CAN channel. `rate` in bit/s is what the user said (0: nothing), `usual` what the family expects.

    `options`: `listen_only` (yes, no), `config_context` (a section of python-can's configuration), and whatever the
    back end's constructor takes. `shared`: takes part beside a host of this machine, as simulated devices on a
    SocketCAN interface do, so that one is not locked. Raises RequestError for an unknown interface or option,
    PortNotFound, PortBusy, or LinkError: for a bit rate that this adapter does not really have, a missing driver, a
    refusal. `kept` is a lock that we have already, maybe this one. `lock_name` is the name of the adapter by which it
    is locked and listens for an emergency stop. `no_wire`: it is made of programs alone.
    """

    paced = False  # adapters say nothing of when a frame was on the wire
    virtual = False
    simulated = False
    timeless = False  # behind a pseudo-terminal frames need no time: how soon an answer comes says nothing

    def __init__(
        self,
        port: str,
        *,
        rate: int = 0,
        usual: int = 0,
        options: Mapping[str, object] | None = None,
        shared: bool = False,
        kept: PortLock | None = None,
    ) -> None:
        self.name = port
        self._can = python_can(port)
        self._config = configured(self._can, port, rate, options or {})
        self._back_end = self._class()
        self.warnings = self._config.warnings
        self.latency = LATENCY.get(self._config.interface, adapters.DEVICE_LATENCY)
        self.rate = self._settled_rate(usual)
        self.listen_only = self._config.listen_only
        self.no_wire = self._config.no_wire
        self._tells = self._config.interface in TELLS_ERRORS
        self._tuning = False
        self._told = (0, 0)
        self.lock_name = _lock_name(self._config)
        alone = self.lock_name and not (shared and self._config.interface == "socketcan")
        self.lock = taken(self.lock_name, kept) if alone else PortLock(self.lock_name or port)
        try:
            self._wire: Wire = self._opened(self.rate, self.listen_only)
        except BaseException:
            self.lock.release()
            raise

    def _class(self) -> Any:
        try:
            return self._can.interface._get_class_for_interface(self._config.interface)
        except Exception as error:
            raise refused(self._config, error) from error

    def _settled_rate(self, usual: int) -> int:
        """The rate to open at. Raises LinkError when the adapter would make another of it."""
        config = self._config
        if config.interface == "socketcan":
            rate, warnings = kernel_rate(config, config.rate, usual)
            self.warnings += warnings
            return rate
        rate = config.rate or config.bits or usual
        if rate <= 0:
            raise RequestError(f"{self.name}: no bit rate was said", expected="bitrate=500000, for example")
        if config.sets_rate:
            check_rate(config, self._back_end, rate)
        elif config.rate and config.interface not in NO_WIRE:
            whose = "server" if config.interface == "socketcand" else "adapter"
            self.warnings += (
                f"the bit rate is set at the {whose}; whether that is {rate} bit/s cannot be checked",
            )
        return rate

    # -- opening --------------------------------------------------------------------------------------------

    def _opened(self, rate: int, listen_only: bool) -> Wire:
        config = self._config
        if listen_only:
            self._check_listening()
        try:
            if config.interface == "slcan":
                return self._opened_slcan(rate, listen_only)
            if config.interface == "socketcand":
                wire, self.latency = open_socketcand(config, self._back_end)
                return wire
            return self._opened_bus(rate, listen_only)
        except MotorbusError:
            raise
        except Exception as error:  # each back end has its own
            raise refused(self._config, error) from error

    def _opened_slcan(self, rate: int, listen_only: bool) -> SlcanWire:
        device = device_of(self._config)
        self.timeless = os.path.realpath(device).startswith(PSEUDO_TERMINALS) if device else False
        if device and os.name != "nt":
            if not os.path.exists(device):
                raise not_found(self.name, ports())
            if not could_be_a_port(device):
                raise no_port(self.name, ports(), device)
            holder = who_holds(os.path.realpath(device))
            if holder is not None:
                raise busy(self.name, holder)
        wire, self.latency, warnings = open_slcan(self._config, self._back_end)
        self.warnings += warnings
        try:
            wire.configure(command_of(self._config, self._back_end, rate), rate, listen_only=listen_only)
        except BaseException:
            wire.close()
            raise
        return wire

    def _opened_bus(self, rate: int, listen_only: bool) -> BusWire:
        config = self._config
        settings = dict(config.settings)
        if config.sets_rate and "timing" not in settings:
            settings["bitrate"] = rate
        if listen_only:
            settings.update(self._listening().get(config.interface, {}))
        bus = build(self._back_end, config.channel, settings)
        descriptor = bus.fileno() if config.interface in BY_DESCRIPTOR else None
        return BusWire(self.name, bus, self._can.Message, descriptor)

    def _listening(self) -> dict[str, dict[str, Any]]:
        """What makes a back end only listen; the kernel's interfaces are asked instead, the rest cannot."""
        return {
            "slcan": {},
            "socketcan": {},
            "virtual": {},
            "udp_multicast": {},
            "pcan": {"state": self._can.BusState.PASSIVE},
            "kvaser": {"driver_mode": False},
            "vector": {"listen_only": True},
            "cantact": {"monitor": True},
            "seeedstudio": {"operation_mode": "silent"},
        }

    def _check_listening(self) -> None:
        if self._config.interface not in self._listening():
            raise LinkError(
                f"{self.name}: {self._config.interface} cannot only listen: its adapter would acknowledge frames",
                expected=f"listen_only with one of {', '.join(self._listening())}",
                advice="leave out listen_only where nothing else is on the bus",
            )

    # -- the link -------------------------------------------------------------------------------------------

    @property
    def device(self) -> str:
        """The serial port of this machine that the adapter is; "" for any other channel."""
        serial = self._config.interface in SERIAL_PORTS and "://" not in self.lock_name
        return self.lock_name if serial else ""

    def port_at(self, device: str) -> str:
        """The port, as an address says it, where that serial port is called so."""
        _, at, baud = str(self._config.channel).partition("@")
        return f"can://{self._config.interface}/{device.lstrip('/')}{at}{baud}"

    @property
    def damaged(self) -> int:
        """Lines or elements that came and were no whole frame."""
        return self._wire.damaged

    @property
    def refused(self) -> int:
        """How often the adapter said no, as far as it says so at all."""
        return self._wire.refused

    @property
    def dropped(self) -> int:
        """Frames left out: CAN FD, and echoes of our own."""
        return self._wire.dropped

    def trouble(self) -> str:
        """What the adapter has said since this was last asked, for whoever waits in vain; "" for nothing."""
        refused, damaged = self._wire.refused, self._wire.damaged
        before, self._told = self._told, (refused, damaged)
        if refused > before[0]:
            return (
                f"the adapter refused {refused - before[0]} frames: nobody on the bus acknowledges them, the bit rate "
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
            raise LinkError(f"{self.name} only listens: nothing was sent", sent=data)
        self._wire.write(data)

    def read(self, until: float) -> list[Data]:
        wire = self._wire
        try:
            frames = wire.read(until)
        except LinkLost:
            if wire is self._wire and not self._tuning:
                raise
            time.sleep(ASK_AGAIN)
            return []  # it is being opened anew
        if frames and self._tells:
            refuse_bus_off(self.name, frames)
        return frames

    def tune(self, rate: int, listen_only: bool = False) -> None:
        if rate < 0:
            raise RequestError(f"{rate} is not a rate in bit/s")
        rate = rate or self.rate
        if (rate, listen_only) == (self.rate, self.listen_only):
            return
        if listen_only:
            self._check_listening()
        self._retune(rate, listen_only)
        self.rate, self.listen_only = rate, listen_only

    def _retune(self, rate: int, listen_only: bool) -> None:
        config = self._config
        if config.interface in NO_WIRE:
            return
        if config.interface == "socketcan":
            self._ask_kernel(rate, listen_only)
        elif not config.sets_rate and rate != self.rate:
            raise LinkError(
                f"{self.name}: the bit rate of {config.interface} cannot be changed to {rate} bit/s from here",
                advice="set it where the adapter is",
            )
        else:
            check_rate(config, self._back_end, rate)
            again = self._configure if isinstance(self._wire, SlcanWire) else self._reopen
            self._or_as_before(again, rate, listen_only)

    def _ask_kernel(self, rate: int, listen_only: bool) -> None:
        _, unknown = kernel_rate(self._config._replace(listen_only=listen_only), rate, rate)
        if unknown:
            raise LinkError(
                f"{self.name}: the bit rate of a SocketCAN interface is set by the system",
                advice=ip_line(str(self._config.channel), rate, listen_only),
            )

    def _or_as_before(self, again: Callable[[int, bool], None], rate: int, listen_only: bool) -> None:
        self._tuning = True
        try:
            again(rate, listen_only)
        except MotorbusError:
            again(self.rate, self.listen_only)
            raise
        finally:
            self._tuning = False

    def _configure(self, rate: int, listen_only: bool) -> None:
        assert isinstance(self._wire, SlcanWire)
        command = command_of(self._config, self._back_end, rate)
        self._wire.configure(command, rate, listen_only=listen_only)

    def _reopen(self, rate: int, listen_only: bool) -> None:
        self._wire.close()
        self._wire = self._opened(rate, listen_only)

    def fileno(self) -> int | None:
        return self._wire.fileno()

    def close(self) -> None:
        self._wire.close()
        self.lock.release()


def no_wire(port: str, options: Mapping[str, object]) -> bool:
    """Whether a port that need not be open is made of programs alone. Raises as `lock_name`."""
    return configured(python_can(port), port, 0, options).no_wire


def lock_name(port: str, options: Mapping[str, object]) -> str:
    """The `CanLink.lock_name` of a port that need not be open. Raises as `CanLink` does for what is no port."""
    return _lock_name(configured(python_can(port), port, 0, options))


def _lock_name(config: CanConfig) -> str:
    """One name for one adapter, whatever it was called; "" where any number of programs meet."""
    if config.interface in NO_WIRE:
        return ""
    if config.interface in SERIAL_PORTS:  # the name by which anything else locks it
        channel = str(config.channel)
        return channel if "://" in channel else channel.partition("@")[0]
    if config.interface == "socketcand":
        return (
            f"can://socketcand/{config.settings.get('host')}:{config.settings.get('port')}/{config.channel}"
        )
    return f"can://{config.interface}/{config.channel}"
