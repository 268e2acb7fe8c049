"""What a CAN address means, with its options and the configuration of python-can, and whether the adapter can do it.

The address and options win over environment variables, and those over configuration files, as in python-can. But
python-can passes every option to every back end, and most ignore unknown ones; here such an option of the user is an
error. A setting of a configuration that the back end does not have is ignored.

Some back ends take another bit rate silently for one that they do not have. A wrong rate disturbs the whole bus, so it
is an error here.
"""

from __future__ import annotations

import contextlib
import difflib
import inspect
import json
import os
import re
import subprocess
import sys
from collections.abc import Collection, Mapping
from typing import Any, Final, NamedTuple

from motorbus.errors import LinkError, RequestError

SOCKETCAND_PORT: Final = 29536
SHARED: Final = ("virtual", "udp_multicast")
"""Interfaces without bit rate and wire, which any number of programs share."""
SERIAL_PORTS: Final = ("slcan", "serial", "robotell", "seeedstudio")
"""Interfaces whose channel is a serial port."""
EXAMPLES: Final = "can://slcan/dev/ttyACM0, can://socketcan/can0, can://socketcand/localhost/can0"
SLCAN_OPTIONS: Final = {"tty_baudrate", "timing"}
_TIMING: Final = ("f_clock", "brp", "tseg1", "tseg2", "sjw", "nof_samples")
"""The bit timing of python-can: controller clock (Hz), prescaler, two segments, jump width, samples."""
_LINK_OPTIONS: Final = {"bitrate", "config_context", "listen_only"}
_SET_HERE: Final = _LINK_OPTIONS | {"self", "channel", "args", "kwargs", "timeout"}
"""Constructor parameters that are no options."""
_WORDS: Final[Mapping[str, object]] = {"yes": True, "no": False, "on": True, "off": False}

IP_TIME: Final = 2.0  # s; time-out for the program `ip`
SLCAN_RATES: Final = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 0, 1_000_000)
"""bit/s of the commands S0 to S8. S7 is not used: 800 kbit/s in the LAWICEL manual, 750 kbit/s in python-can."""
LAWICEL_CLOCK: Final = 8_000_000  # Hz of BTR0 and BTR1 of an slcan adapter (SJA1000 at 16 MHz)
SLCAN_ADVICE: Final = (
    "S7 is 800 kbit/s in the LAWICEL manual and 750 kbit/s in python-can, so neither is used; "
    "f_clock=8000000,brp=1,tseg1=7,tseg2=2,sjw=1,nof_samples=1 is 800 kbit/s"
)
_TABLES: Final = {"pcan": "PCAN_BITRATES", "kvaser": "BITRATE_OBJS"}
"""The tables in python-can's modules whose back ends take another rate silently for one that they do not have."""


class CanOptions(NamedTuple):
    """A CAN channel to open.

    `rate`      bit/s from the user, a configuration or a bit timing; 0 when not given
    `settings`  constructor arguments of the back end besides channel and bit rate
    `back_end`  the class of python-can; None for slcan, or when its driver is missing
    """

    name: str
    interface: str
    channel: Any
    rate: int
    listen_only: bool
    settings: dict[str, Any]
    back_end: Any

    @property
    def sets_rate(self) -> bool:
        """Whether the program that opens the channel sets its bit rate."""
        return self.interface not in (*SHARED, "socketcan", "socketcand", "serial")

    @property
    def no_wire(self) -> bool:
        """Whether only programs are on this channel, so that no device can be real."""
        virtual = self.interface == "socketcan" and str(self.channel).startswith(("vcan", "vxcan"))
        return virtual or self.interface in SHARED

    @property
    def device(self) -> str:
        """The serial port of this machine, for interfaces that use one; else ""."""
        channel = str(self.channel or "")
        return channel.partition("@")[0] if self.interface in SERIAL_PORTS and "://" not in channel else ""

    @property
    def lock_name(self) -> str:
        """The one name under which the adapter is locked; "" for a shared channel."""
        if self.interface in SHARED:
            return ""
        if self.interface in SERIAL_PORTS:
            return self.device or str(self.channel).partition("@")[0]
        if self.interface == "socketcand":
            server = f"{self.settings.get('host')}:{self.settings.get('port')}"
            return f"can://socketcand/{server}/{self.channel}"
        return f"can://{self.interface}/{self.channel}"


def parse_port(port: str) -> tuple[str, dict[str, Any]]:
    """Interface ("" when not given) and arguments of `can://INTERFACE/CHANNEL`. Raises RequestError.

    A serial port that is neither a URL nor a COM port begins with `/`.
    """
    interface, _, channel = port.partition("://")[2].partition("/")
    interface = interface.lower()
    if interface == "socketcand" and channel:
        host, _, channel = channel.partition("/")
        host, _, number = host.partition(":")
        if not channel:
            raise RequestError(
                f"{port!r} does not name a channel of a server",
                expected="can://socketcand/HOST:PORT/CHANNEL, as can://socketcand/localhost:29536/can0",
            )
        return interface, {"channel": channel, "host": host, "port": number or SOCKETCAND_PORT}
    has_name = channel.startswith("/") or "://" in channel or re.fullmatch(r"COM\d+(@\d+)?", channel)
    if interface in SERIAL_PORTS and channel and not has_name and os.name != "nt":
        channel = f"/{channel}"
    if channel and not interface:
        raise RequestError(
            f"{port!r}: the interface is missing", expected=f"can://INTERFACE/CHANNEL, as {EXAMPLES}"
        )
    return interface, {"channel": channel} if channel else {}


def read_options(can: Any, port: str, rate: int, options: Mapping[str, object]) -> CanOptions:
    """All settings of this port; `can` is python-can. Raises RequestError."""
    interface, address = parse_port(port)
    user = _with_switches(options)
    given = {**user, **address, **({"interface": interface} if interface else {})}
    merged = _with_switches(_load(can, port, given, user.get("config_context")))
    interface, channel = merged.pop("interface"), merged.pop("channel")
    if interface in SERIAL_PORTS and not channel:
        raise RequestError(
            f"{port}: the serial port of the adapter is missing",
            expected=f"can://{interface}/dev/ttyACM0, or channel in python-can's configuration",
        )
    bitrate = merged.get("bitrate", 0)
    listen_only = merged.get("listen_only", False)
    if not isinstance(bitrate, int) or bitrate < 0:
        raise RequestError(f"python-can's configuration says bitrate={bitrate}", expected="a rate in bit/s")
    if listen_only not in (True, False):
        raise RequestError(f"listen_only={listen_only}: neither yes nor no", expected="yes or no")
    back_end, names = None, SLCAN_OPTIONS
    if interface != "slcan":
        names = {*merged}
        with contextlib.suppress(can.CanInterfaceNotImplementedError):  # opening says what is missing
            back_end = can.interface._get_class_for_interface(interface)
            known = {*inspect.signature(back_end.__init__).parameters}
            if "bitrate" in known or interface in (*SHARED, "socketcan"):  # others take any keyword
                names = known
    names = names - _SET_HERE
    settings = {name: value for name, value in merged.items() if name in names}
    _check_options(port, interface, user, settings, names)
    timing_rate = getattr(settings.get("timing"), "bitrate", 0)
    rate = rate or bitrate or timing_rate
    return CanOptions(port, interface, channel, rate, bool(listen_only), settings, back_end)


def _load(can: Any, port: str, given: dict[str, Any], context: object) -> dict[str, Any]:
    """The given settings on top of python-can's configuration. Raises RequestError."""
    try:
        return dict(can.util.load_config(config=given, context=None if context is None else str(context)))
    except can.CanInterfaceNotImplementedError:
        interface = str(given.get("interface", ""))
        known = sorted(can.VALID_INTERFACES)
        summary = f"{port!r}: python-can has no interface {interface!r}"
        if not interface:
            summary = f"{port!r} names no interface, nor does python-can's configuration"
        advice = _nearest(interface, known) or f"for example {EXAMPLES}"
        raise RequestError(summary, expected=f"one of {', '.join(known)}", advice=advice) from None
    except Exception as error:  # its readers of INI and JSON raise many types
        raise RequestError(
            f"{port}: python-can cannot use this configuration: {error}",
            advice="see CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE, CAN_CONFIG and python-can's configuration files",
        ) from error


def _check_options(
    port: str, interface: str, user: Collection[str], settings: Collection[str], names: Collection[str]
) -> None:
    """Raise RequestError for an option that the interface does not have, or part of a bit timing."""
    known = {*names, *_LINK_OPTIONS, *(_TIMING if "timing" in names else ())} - {"timing"}
    for name in user:
        if name not in known:
            raise RequestError(
                f"{port}: {interface} has no option {name!r}",
                expected=f"one of {', '.join(sorted(known))}",
                advice=_nearest(name, known),
            )
        if name in _TIMING and name not in names and "timing" not in settings:
            raise RequestError(
                f"{port}: this bit timing is not complete, or impossible",
                expected=f"all of {', '.join(_TIMING)}",
            )


def _nearest(word: str, known: Collection[str]) -> str:
    close = difflib.get_close_matches(word, known, 1)
    return f"did you mean {close[0]}?" if close else ""


def _with_switches(options: Mapping[str, object]) -> dict[str, Any]:
    """Options with yes, no, on and off as bool; python-can takes any word but false for true."""
    return {name: _WORDS.get(str(value).lower(), value) for name, value in options.items()}


def known_rates(options: CanOptions) -> set[int]:
    """The bit rates that this back end has; empty when it takes any number, or refuses a wrong one itself."""
    if options.interface == "slcan":
        return {*SLCAN_RATES} - {0}
    if options.interface not in _TABLES or options.back_end is None:
        return set()
    return {*getattr(sys.modules[options.back_end.__module__], _TABLES[options.interface])}


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
    if interface == "usb2can" and (rate % 1000 or rate > 1_000_000):  # python-can rounds it without a word
        raise LinkError(
            f"{name}: usb2can has no bit rate of {rate} bit/s", expected="kbit/s up to 1000000 bit/s"
        )
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
