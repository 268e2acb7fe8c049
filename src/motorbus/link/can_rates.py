"""Check a CAN bit rate before the adapter is opened.

Back ends of python-can differ for a rate that they do not have: one raises, one takes 500 kbit/s instead, one passes a
number to its driver that means another rate. A wrong rate disturbs the whole bus, so it is an error here.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any, Final, NamedTuple

from motorbus.errors import LinkError
from motorbus.link.can_options import TIMING, CanOptions

IP_TIME: Final = 2.0  # s; time-out for the program `ip`
SLCAN_COMMANDS: Final = {
    10_000: "S0",
    20_000: "S1",
    50_000: "S2",
    100_000: "S3",
    125_000: "S4",
    250_000: "S5",
    500_000: "S6",
    1_000_000: "S8",
}
"""bit/s and commands of an slcan adapter. S7 is 800 kbit/s in the LAWICEL manual and 750 kbit/s in python-can."""
LAWICEL_CLOCK: Final = 8_000_000  # Hz of BTR0 and BTR1 of an slcan adapter (SJA1000 at 16 MHz)
_TABLES: Final = {
    "pcan": "PCAN_BITRATES",
    "kvaser": "BITRATE_OBJS",
    "ixxat": "CHANNEL_BITRATES",
    "systec": "BITRATES",
    "iscan": "BAUDRATES",
    "seeedstudio": "BITRATE",
}
"""Where the back ends of python-can keep their rates: an attribute of the class or of its module."""
_REASONS: Final = {
    "slcan": " (S7 is 800 kbit/s in the LAWICEL manual and 750 kbit/s in python-can, so neither is used)",
    "pcan": " (python-can would take 500 kbit/s instead)",
    "kvaser": " (python-can would pass the bare number to the driver)",
}
_TIMING_ADVICE: Final = "give the bit timing instead of a rate"
_TIMING_800K: Final = "f_clock=8000000,brp=1,tseg1=7,tseg2=2,sjw=1,nof_samples=1"
"""800 kbit/s with the clock of an slcan adapter, sampled at 80 %."""


def known_rates(interface: str, back_end: Any) -> frozenset[int]:
    """The bit rates in the table of this back end; empty when it takes any number, or has no table."""
    if interface == "slcan":
        return frozenset(SLCAN_COMMANDS)
    name = _TABLES.get(interface)
    if name is None or back_end is None:
        return frozenset()
    table: Any = getattr(back_end, name, None) or getattr(sys.modules[back_end.__module__], name, ())
    return frozenset(table[0] if interface == "ixxat" and table else table)


def check_rate(options: CanOptions, back_end: Any, rate: int) -> None:
    """Raise LinkError when the back end does not make this rate (bit/s)."""
    interface = options.interface
    if options.timing_rate:
        if rate != options.timing_rate:
            raise LinkError(
                f"{options.name}: the bit timing makes {options.timing_rate} bit/s, not {rate}",
                advice="leave out the bit rate, or the timing",
            )
        clock = options.settings["timing"].f_clock
        if interface == "slcan" and clock != LAWICEL_CLOCK:
            raise LinkError(
                f"{options.name}: an slcan adapter counts in {LAWICEL_CLOCK} Hz, not {clock}",
                expected=f"f_clock={LAWICEL_CLOCK}",
            )
        return
    rates = known_rates(interface, back_end)
    if rates and rate not in rates and "tseg1" not in options.settings:
        expected = f"one of {', '.join(map(str, sorted(rates)))} bit/s"
    elif interface == "usb2can" and (rate % 1000 or rate > 1_000_000):
        expected = "whole kbit/s, at most 1000"
    else:
        return
    reason = _REASONS.get(interface, "")
    advice = f"{_TIMING_ADVICE} ({', '.join(TIMING)}), or change the rate of the bus"
    if interface == "slcan":
        reason = reason if rate in (750_000, 800_000) else ""
        advice = f"{_TIMING_ADVICE}: {_TIMING_800K} is 800 kbit/s"
    raise LinkError(
        f"{options.name}: {interface} has no bit rate of {rate} bit/s{reason}",
        expected=expected,
        advice=advice,
    )


class KernelState(NamedTuple):
    """State of a SocketCAN interface: bit/s (0 for vcan, which has none), switched on, listen-only."""

    rate: int
    up: bool
    listen_only: bool


def kernel_state(channel: str) -> KernelState | None:
    """The state of this interface from the program `ip`; None when it does not tell."""
    command = ["ip", "-details", "-json", "link", "show", "dev", channel]
    try:
        output = subprocess.run(command, capture_output=True, timeout=IP_TIME, check=True).stdout
        about = json.loads(output)[0]
        data = about.get("linkinfo", {}).get("info_data", {})
        rate = int(data.get("bittiming", {}).get("bitrate", 0))
        return KernelState(rate, "UP" in about["flags"], "LISTEN-ONLY" in data.get("ctrlmode", ()))
    except (OSError, subprocess.SubprocessError, ValueError, LookupError, TypeError, AttributeError):
        return None


def kernel_rate(options: CanOptions, rate: int, default_rate: int) -> tuple[int, tuple[str, ...]]:
    """Rate of a SocketCAN interface (bit/s), which the system sets, and warnings. `rate` is 0 when not given.

    Raises LinkError when the interface is switched off, or its settings are not those of the options.
    """
    name, channel = options.name, str(options.channel)
    state = kernel_state(channel)
    wanted = rate or default_rate
    if state is None:
        return wanted, (f"the kernel did not tell the bit rate of {channel}; {wanted} bit/s is assumed",)
    if not state.up:
        advice = ip_command(channel, wanted, state.listen_only)
        raise LinkError(f"{name}: {channel} is switched off", advice=advice)
    if rate and state.rate and rate != state.rate:
        raise LinkError(
            f"{name}: the kernel runs {channel} at {state.rate} bit/s, not at {rate}",
            cause="the system sets the bit rate of a SocketCAN interface, not the program that uses it",
            advice=ip_command(channel, rate, state.listen_only),
        )
    if options.listen_only != state.listen_only and state.rate:
        advice = ip_command(channel, rate or state.rate, options.listen_only)
        raise LinkError(
            f"{name}: the kernel {'only listens' if state.listen_only else 'takes full part'} on {channel}",
            advice=advice if options.listen_only else f"{advice}; or say listen_only=yes",
        )
    return state.rate or wanted, ()


def ip_command(channel: str, rate: int, listen_only: bool) -> str:
    """The shell commands that set up this interface."""
    mode = "on" if listen_only else "off"
    return (
        f"sudo ip link set {channel} down; "
        f"sudo ip link set {channel} up type can bitrate {rate} listen-only {mode}"
    )
