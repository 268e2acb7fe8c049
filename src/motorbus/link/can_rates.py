"""Check a CAN bit rate before the adapter is opened.

Back ends of python-can differ for a rate that they do not have: one raises, one takes 500 kbit/s instead, one passes a
number to its driver that means another rate. A wrong rate disturbs the whole bus, so it is an error here.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any, Final

from motorbus.errors import LinkError
from motorbus.link.can_options import CanOptions

IP_TIME: Final = 2.0  # s; time-out for the program `ip`
SLCAN_RATES: Final = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 0, 1_000_000)
"""bit/s of the commands S0 to S8. S7 is not used: 800 kbit/s in the LAWICEL manual, 750 kbit/s in python-can."""
LAWICEL_CLOCK: Final = 8_000_000  # Hz of BTR0 and BTR1 of an slcan adapter (SJA1000 at 16 MHz)
SLCAN_ADVICE: Final = (
    "S7 is 800 kbit/s in the LAWICEL manual and 750 kbit/s in python-can, so neither is used; "
    "f_clock=8000000,brp=1,tseg1=7,tseg2=2,sjw=1,nof_samples=1 is 800 kbit/s"
)
_TABLES: Final = {
    "pcan": "PCAN_BITRATES",
    "kvaser": "BITRATE_OBJS",
    "ixxat": "CHANNEL_BITRATES",
    "systec": "BITRATES",
    "iscan": "BAUDRATES",
    "seeedstudio": "BITRATE",
}
"""Where the back ends of python-can keep their rates: an attribute of the class or of its module."""


def known_rates(options: CanOptions) -> frozenset[int]:
    """The bit rates in the table of this back end; empty when it takes any number, or has no table."""
    if options.interface == "slcan":
        return frozenset(SLCAN_RATES) - {0}
    name, back_end = _TABLES.get(options.interface), options.back_end
    if name is None or back_end is None:
        return frozenset()
    table: Any = getattr(back_end, name, None) or getattr(sys.modules[back_end.__module__], name, ())
    return frozenset(table[0] if options.interface == "ixxat" and table else table)


def check_rate(options: CanOptions, rate: int) -> None:
    """Raise LinkError when the back end does not make this rate (bit/s)."""
    name, interface = options.name, options.interface
    timing = options.settings.get("timing")
    if timing is not None:
        if rate != timing.bitrate:
            raise LinkError(
                f"{name}: the bit timing makes {timing.bitrate} bit/s, not {rate}",
                advice="leave out the bit rate, or the timing",
            )
        if interface == "slcan" and timing.f_clock != LAWICEL_CLOCK:
            raise LinkError(
                f"{name}: an slcan adapter counts in {LAWICEL_CLOCK} Hz, not {timing.f_clock}",
                expected=f"f_clock={LAWICEL_CLOCK}",
            )
        return
    rates = known_rates(options)
    if rates and rate not in rates and "tseg1" not in options.settings:
        raise LinkError(
            f"{name}: {interface} has no bit rate of {rate} bit/s",
            expected=f"one of {', '.join(map(str, sorted(rates)))} bit/s",
            advice=SLCAN_ADVICE if interface == "slcan" else "change the rate of the bus",
        )


def kernel_rate(options: CanOptions, rate: int, listen_only: bool) -> int | None:
    """The bit rate (bit/s) of a SocketCAN interface; 0 for a virtual one, None when `ip` does not tell.

    Raises LinkError when the interface is off, or set to another rate or mode. `rate` is 0 for any.
    """
    channel = str(options.channel)
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
        f"{options.name}: {problem}",
        cause="the system sets up a SocketCAN interface, not the program that uses it",
        advice=f"sudo ip link set {channel} down; "
        f"sudo ip link set {channel} up type can bitrate {rate or actual or 'RATE'} listen-only {mode}",
    )
