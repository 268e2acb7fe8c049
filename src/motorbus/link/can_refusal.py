"""Why python-can could not open a channel, told in our words and with what to do about it.

Its back ends raise whatever they like: a missing driver is an ImportError here and a NameError there.
"""

from __future__ import annotations

import errno
import os
from typing import Final

from motorbus.errors import LinkError, MotorbusError, PortNotFound, RequestError
from motorbus.link.can_config import CanConfig
from motorbus.link.foreign import who_holds
from motorbus.link.refusal import busy, forbidden, not_found
from motorbus.link.serial import GONE, ports

INSTALL: Final = 'pip install "motorbus[can]"'
_EXTRAS: Final = {
    "gs_usb": "gs-usb",
    "udp_multicast": "multicast",
    **{name: name for name in ("canalystii", "cantact", "neovi", "nixnet", "serial", "seeedstudio")},
}
"""What python-can calls the extra that a back end needs."""
_DRIVERS: Final = {
    "pcan": "PEAK's PCAN-Basic library",
    "kvaser": "Kvaser's CANlib",
    "ixxat": "the VCI driver (Windows)",
    "vector": "Vector's XL driver (Windows)",
}


def refused(config: CanConfig, error: Exception) -> MotorbusError:
    """What to raise for what python-can raised when this was opened."""
    interface = config.interface
    why = error.__cause__ if isinstance(error.__cause__, OSError) else error
    code = getattr(why, "errno", None) or getattr(error, "error_code", None)
    if isinstance(error, (NotImplementedError, ImportError, NameError)) or "library not found" in str(error):
        return _without_driver(config, error)
    if interface == "slcan" and not isinstance(error, (ValueError, TypeError)):
        return _no_serial_port(config, str(error), code)
    if code in GONE:
        return PortNotFound(f"{config.name}: there is no {interface} channel {config.channel}: {error}")
    if code == errno.EAFNOSUPPORT:
        return LinkError(
            f"{config.name}: the kernel of this system has no CAN",
            advice="sudo modprobe can-raw; where there is none, use the adapter by can://slcan/…",
        )
    if code == errno.EBUSY:
        return busy(config.name, None)
    if isinstance(error, (ValueError, TypeError)):
        return RequestError(f"{config.name}: python-can's {interface} refuses this: {error}")
    return LinkError(
        f"{config.name} cannot be opened: {error}", advice="is the adapter plugged in, the channel right?"
    )


def _no_serial_port(config: CanConfig, why: str, code: int | None) -> MotorbusError:
    device = device_of(config)
    if not device:
        return PortNotFound(
            f"{config.name} cannot be reached: {why}",
            advice="is the bridge switched on, the simulator running, the port number right?",
        )
    if code in GONE:
        return not_found(config.name, ports())
    if code in (errno.EACCES, errno.EPERM):
        return forbidden(config.name, device)
    if code == errno.EBUSY:
        return busy(config.name, who_holds(os.path.realpath(device)))
    return LinkError(f"{config.name} cannot be opened as a serial port: {why}")


def _without_driver(config: CanConfig, error: Exception) -> LinkError:
    extra, driver = _EXTRAS.get(config.interface), _DRIVERS.get(config.interface)
    advice = f"install {driver or 'the driver that comes with the adapter'}"
    if config.interface == "slcan":
        advice = INSTALL
    elif extra:
        advice = f'pip install "python-can[{extra}]"'
    return LinkError(f"{config.name}: the driver of {config.interface} is missing: {error}", advice=advice)


def device_of(config: CanConfig) -> str:
    """The serial port of an slcan adapter on this machine; "" for any other channel."""
    channel = str(config.channel or "")
    return channel.partition("@")[0] if config.interface == "slcan" and "://" not in channel else ""
