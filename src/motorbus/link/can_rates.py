"""Which bit rate a CAN adapter will really run at, found out before it is opened.

python-can's back ends differ in what they do with a rate they do not have: one raises, one takes 500 kbit/s instead,
one hands a number to its driver that means something else. A wrong rate disturbs everybody on the bus, so what cannot
be done is an error here, and what cannot be known is said.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from motorbus.errors import LinkError
from motorbus.link.can_config import CanConfig

IP_TIME: Final = 2.0
"""s that `ip` may take to say how an interface is set."""
AMBIGUOUS: Final = 750_000
"""bit/s that python-can's slcan asks for with S7, by which the LAWICEL manual means 800 kbit/s."""
LAWICEL_CLOCK: Final = 8_000_000
"""Hz that BTR0 and BTR1 of an slcan adapter count in (SJA1000 at 16 MHz)."""
_TABLES: Final = {
    "slcan": "_BITRATES",
    "pcan": "PCAN_BITRATES",
    "kvaser": "BITRATE_OBJS",
    "ixxat": "CHANNEL_BITRATES",
    "systec": "BITRATES",
    "iscan": "BAUDRATES",
    "seeedstudio": "BITRATE",
}
"""Where python-can's back ends keep the rates they have: an attribute of the class or of its module."""
_ANY_TIMING: Final = "f_clock=8000000,brp=1,tseg1=7,tseg2=2,sjw=1,nof_samples=1"
"""800 kbit/s with the clock of an slcan adapter, sampled at 80 %."""


def known_rates(interface: str, back_end: Any) -> frozenset[int]:
    """The bit rates that this back end has names for; empty when it takes any number, or cannot be asked."""
    name = _TABLES.get(interface)
    if name is None or back_end is None:
        return frozenset()
    table: Any = getattr(back_end, name, None) or getattr(sys.modules[back_end.__module__], name, ())
    rates = frozenset(table[0] if interface == "ixxat" and table else table)
    return rates - {AMBIGUOUS} if interface == "slcan" else rates


def check_rate(config: CanConfig, back_end: Any, rate: int) -> None:
    """The back end really makes this rate. Raises LinkError when it does not."""
    if config.bits:
        _check_timing(config, rate)
        return
    rates = known_rates(config.interface, back_end)
    if rates and rate not in rates and "tseg1" not in config.settings:
        raise cannot(config, rate, rates)
    if config.interface == "usb2can" and (rate % 1000 or rate > 1_000_000):
        raise cannot(config, rate, ())


def _check_timing(config: CanConfig, rate: int) -> None:
    if rate != config.bits:
        raise LinkError(
            f"{config.name}: the bit timing makes {config.bits} bit/s, not {rate}",
            advice="leave out the bit rate, or the timing",
        )
    clock = config.settings["timing"].f_clock
    if config.interface == "slcan" and clock != LAWICEL_CLOCK:
        raise LinkError(
            f"{config.name}: an slcan adapter counts in {LAWICEL_CLOCK} Hz, not {clock}",
            expected=f"f_clock={LAWICEL_CLOCK}",
        )


def cannot(config: CanConfig, rate: int, rates: Iterable[int]) -> LinkError:
    """This back end has no such rate."""
    why = {
        "slcan": " (S7 is 800 kbit/s in the LAWICEL manual and 750 kbit/s in python-can, so neither is used)",
        "pcan": " (python-can would take 500 kbit/s instead)",
        "kvaser": " (python-can would hand the bare number to the driver)",
    }
    known = sorted(rates)
    is_trap = config.interface == "slcan" and rate in (AMBIGUOUS, 800_000)
    return LinkError(
        f"{config.name}: {config.interface} has no bit rate of {rate} bit/s"
        f"{why.get(config.interface, '') if is_trap or config.interface != 'slcan' else ''}",
        expected=f"one of {', '.join(map(str, known))} bit/s" if known else "whole kbit/s, at most 1000",
        advice=f"give the bit timing instead of a rate: {_ANY_TIMING} is 800 kbit/s"
        if config.interface == "slcan"
        else "give the bit timing instead of a rate (f_clock, brp, tseg1, tseg2, sjw, nof_samples), or change the"
        " rate of the bus",
    )


class KernelLink(NamedTuple):
    """What the Linux kernel says of a CAN interface: bit/s (0: it has none, as vcan), switched on, only listening."""

    rate: int
    up: bool
    listen_only: bool


def kernel_link(channel: str) -> KernelLink | None:
    """How this interface is set, as `ip` tells it; None when nobody tells."""
    command = ["ip", "-details", "-json", "link", "show", "dev", channel]
    try:
        told = subprocess.run(command, capture_output=True, timeout=IP_TIME, check=True).stdout
        about = json.loads(told)[0]
        data = about.get("linkinfo", {}).get("info_data", {})
        rate = int(data.get("bittiming", {}).get("bitrate", 0))
        return KernelLink(rate, "UP" in about["flags"], "LISTEN-ONLY" in data.get("ctrlmode", ()))
    except (OSError, subprocess.SubprocessError, ValueError, LookupError, TypeError, AttributeError):
        return None


def kernel_rate(config: CanConfig, rate: int, usual: int) -> tuple[int, tuple[str, ...]]:
    """The rate of a SocketCAN interface, which is the kernel's, and what to warn of. `rate` is 0 when nobody said.

    Raises LinkError when the interface is switched off, or set otherwise than was said.
    """
    channel = str(config.channel)
    link = kernel_link(channel)
    if link is None:
        return rate or usual, (
            f"the kernel did not tell the bit rate of {channel}; {rate or usual} bit/s is assumed",
        )
    if not link.up:
        raise LinkError(
            f"{config.name}: {channel} is switched off",
            advice=ip_line(channel, rate or usual, link.listen_only),
        )
    if rate and link.rate and rate != link.rate:
        raise LinkError(
            f"{config.name}: the kernel runs {channel} at {link.rate} bit/s, not at {rate}",
            cause="the bit rate of a SocketCAN interface is set by the system, not by the program that uses it",
            advice=ip_line(channel, rate, link.listen_only),
        )
    if config.listen_only != link.listen_only and link.rate:
        raise LinkError(
            f"{config.name}: the kernel {'only listens' if link.listen_only else 'takes full part'} on {channel}",
            advice=ip_line(channel, rate or link.rate, config.listen_only)
            + ("" if config.listen_only else "; or say listen_only=yes"),
        )
    return link.rate or rate or usual, ()


def ip_line(channel: str, rate: int, listen_only: bool) -> str:
    """What to say to the kernel."""
    mode = "on" if listen_only else "off"
    return (
        f"sudo ip link set {channel} down; "
        f"sudo ip link set {channel} up type can bitrate {rate} listen-only {mode}"
    )
