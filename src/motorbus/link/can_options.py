"""What a CAN address means, with its options and the configuration of python-can.

The address and options win over environment variables, and those over configuration files, as in python-can. But
python-can passes every option to every back end, and most ignore unknown ones. Here an unknown option of the user is an
error, and an unsuitable setting of a configuration is dropped with a warning.
"""

from __future__ import annotations

import contextlib
import difflib
import inspect
import os
import re
from collections.abc import Collection, Mapping
from typing import Any, Final, NamedTuple

from motorbus.errors import RequestError

SOCKETCAND_PORT: Final = 29536
SHARED: Final = ("virtual", "udp_multicast")
"""Interfaces without bit rate and wire, which any number of programs share."""
SERIAL_PORTS: Final = ("slcan", "serial", "robotell", "seeedstudio")
"""Interfaces whose channel is a serial port."""
TIMING: Final = ("f_clock", "brp", "tseg1", "tseg2", "sjw", "nof_samples")
"""The bit timing of python-can: controller clock (Hz), prescaler, two segments, jump width, samples."""
EXAMPLES: Final = "can://slcan/dev/ttyACM0, can://socketcan/can0, can://socketcand/localhost/can0"
TEXT_OPTIONS: Final = {"slcan": {"tty_baudrate", "timing"}, "socketcand": {"host", "port"}}
"""Options of the interfaces that go over our own links."""
_LINK_OPTIONS: Final = ("bitrate", "config_context", "listen_only")
_RESERVED: Final = {"self", "channel", "args", "kwargs", "timing", "bitrate", "timeout", "listen_only"}
"""Constructor parameters that are no options: the link sets them."""
_WORDS: Final[Mapping[str, object]] = {"yes": True, "no": False, "on": True, "off": False}


class CanOptions(NamedTuple):
    """A CAN channel to open.

    `rate`         bit/s from the user or a configuration; 0 when not given
    `settings`     constructor arguments of the back end besides channel and bit rate
    `sets_rate`    the back end sets the bit rate
    `timing_rate`  bit/s of an explicit bit timing in `settings`; else 0
    `warnings`     settings that were dropped
    """

    name: str
    interface: str
    channel: Any
    rate: int
    listen_only: bool
    settings: dict[str, Any]
    sets_rate: bool
    timing_rate: int = 0
    warnings: tuple[str, ...] = ()

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
            return self.device or str(self.channel)
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
        if not host or not channel or not (number or "0").isdecimal():
            raise RequestError(
                f"{port!r} does not name a channel of a server",
                expected="can://socketcand/HOST:PORT/CHANNEL",
                advice="for example can://socketcand/localhost:29536/can0",
            )
        return interface, {"channel": channel, "host": host, "port": int(number or SOCKETCAND_PORT)}
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
    context = user.pop("config_context", None)
    given = {**user, **address, **({"interface": interface} if interface else {})}
    merged = _load(can, port, given, None if context is None else str(context))
    interface, channel = merged.pop("interface"), merged.pop("channel")
    if interface in SERIAL_PORTS and not channel:
        raise RequestError(
            f"{port}: the serial port of the adapter is missing",
            expected=f"can://{interface}/dev/ttyACM0, or channel in python-can's configuration",
        )
    merged = _with_switches(merged)
    taken = TEXT_OPTIONS.get(interface)
    if taken is None:
        with contextlib.suppress(
            can.CanInterfaceNotImplementedError
        ):  # its driver is missing: opening it says so
            taken = parameters(can.interface._get_class_for_interface(interface))
    names = None if taken is None else taken - _RESERVED
    has_timing = taken is None or "timing" in taken
    if names is not None:
        _check_names(port, interface, user, {*names, *_LINK_OPTIONS, *(TIMING if has_timing else ())})
    bitrate = merged.get("bitrate")
    if bitrate is not None and not (isinstance(bitrate, int) and bitrate > 0):
        raise RequestError(f"python-can's configuration says bitrate={bitrate}", expected="a rate in bit/s")
    listen_only = merged.pop("listen_only", False)
    if listen_only not in (True, False):
        raise RequestError(f"listen_only={listen_only}: neither yes nor no", expected="yes or no")
    found = CanOptions(
        name=port,
        interface=interface,
        channel=channel,
        rate=rate or bitrate or 0,
        listen_only=bool(listen_only),
        settings={name: value for name, value in merged.items() if names is None or name in names},
        sets_rate=taken is None or "bitrate" in taken or interface == "slcan",
        warnings=tuple(
            f"python-can's configuration says {name}={value}, which {interface} does not have: ignored"
            for name, value in merged.items()
            if names is not None and name not in {*names, *given, *TIMING, "timing", "bitrate"}
        ),
    )
    return _with_timing(found, merged, user) if has_timing else found


def _with_timing(options: CanOptions, merged: dict[str, Any], user: Collection[str]) -> CanOptions:
    """Add the bit timing that python-can has made of its six parts. Raises RequestError for an incomplete one."""
    timing = merged.get("timing")
    if timing is not None:
        settings = {**options.settings, "timing": timing}
        return options._replace(settings=settings, timing_rate=int(getattr(timing, "bitrate", 0)))
    unused = [name for name in TIMING if name in merged and name not in options.settings]
    if not unused:
        return options
    parts = ", ".join(f"{name}={merged[name]}" for name in unused)
    if any(name in user for name in unused):
        raise RequestError(
            f"{options.name}: this bit timing is not complete, or impossible",
            sent=parts,
            expected=f"all of {', '.join(TIMING)}",
        )
    warning = f"python-can's configuration says {parts}, which is no whole bit timing: ignored"
    return options._replace(warnings=(*options.warnings, warning))


def _load(can: Any, port: str, given: dict[str, Any], context: str | None) -> dict[str, Any]:
    """The given settings on top of python-can's configuration. Raises RequestError."""
    try:
        return dict(can.util.load_config(config=given, context=context))
    except can.CanInterfaceNotImplementedError:
        interface = str(given.get("interface", ""))
        known = sorted(can.VALID_INTERFACES)
        if interface:
            summary = f"{port!r}: python-can has no interface {interface!r}"
            advice = _nearest(interface, known) or f"for example {EXAMPLES}"
        else:
            summary = f"{port!r} says no interface, and python-can's configuration names none that exists"
            advice = f"write can://INTERFACE/CHANNEL, as {EXAMPLES}, or set CAN_INTERFACE and CAN_CHANNEL"
        raise RequestError(summary, expected=f"one of {', '.join(known)}", advice=advice) from None
    except Exception as error:  # its readers of INI and JSON raise many types
        raise RequestError(
            f"{port}: python-can cannot use this configuration: {error}",
            advice="see CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE, CAN_CONFIG and python-can's configuration files",
        ) from error


def _check_names(port: str, interface: str, options: Collection[str], known: Collection[str]) -> None:
    for name in options:
        if name not in known:
            raise RequestError(
                f"{port}: {interface} has no option {name!r}",
                expected=f"one of {', '.join(sorted(known))}",
                advice=_nearest(name, known),
            )


def _nearest(word: str, known: Collection[str]) -> str:
    close = difflib.get_close_matches(word, known, 1)
    return f"did you mean {close[0]}?" if close else ""


def parameters(back_end: Any) -> set[str]:
    """Parameter names of a back end's constructor; also the documented ones where it takes any keyword."""
    names = set(inspect.signature(back_end.__init__).parameters)
    if "bitrate" not in names and "kwargs" in names:
        text = f"{back_end.__doc__ or ''}\n{back_end.__init__.__doc__ or ''}"
        names |= set(re.findall(r":param(?:\s[^:\n]*?)?\s(\w+)\s*:", text))
    return names


def _with_switches(options: Mapping[str, object]) -> dict[str, Any]:
    """Options with yes, no, on and off as bool; python-can takes any word but false for true."""
    return {name: _WORDS.get(str(value).lower(), value) for name, value in options.items()}
