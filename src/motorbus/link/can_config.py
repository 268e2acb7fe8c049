"""What is to be opened, from a CAN address, its options and python-can's own configuration.

What the user says wins over the environment, and that over configuration files, as python-can has it. But python-can
hands any option to any back end, most of which ignore in silence what they do not know; here an option that the user
gave must exist, and one that stands in a configuration and does not fit is dropped with a warning.
"""

from __future__ import annotations

import difflib
import inspect
import os
import re
from collections.abc import Collection, Mapping
from typing import Any, Final, NamedTuple

from motorbus.errors import RequestError

SOCKETCAND_PORT: Final = 29536
"""The usual TCP port of socketcand."""
NO_WIRE: Final = ("virtual", "udp_multicast")
"""Interfaces without a bit rate, where any number of programs meet."""
TIMING: Final = ("f_clock", "brp", "tseg1", "tseg2", "sjw", "nof_samples")
"""A bit timing of python-can: clock of the controller (Hz), prescaler, two segments, jump width, samples."""
EXAMPLES: Final = "can://slcan/dev/ttyACM0, can://socketcan/can0, can://socketcand/localhost/can0"
SERIAL_PORTS: Final = ("slcan", "serial", "robotell", "seeedstudio")
"""Interfaces whose channel is a serial port."""
_OURS: Final = ("bitrate", "config_context", "listen_only")
_WORDS: Final[Mapping[str, object]] = {"yes": True, "no": False, "on": True, "off": False}
_ELSEWHERE: Final = {"self", "channel", "args", "kwargs", "timing", "bitrate", "timeout", "listen_only"}
"""Parameters of constructors that are no options: said in another way, or the link's own business."""


class CanConfig(NamedTuple):
    """What to open.

    `rate`         bit/s that the user or a configuration said; 0 when nobody did
    `settings`     arguments of the back end's constructor beside channel and bit rate
    `sets_rate`    the back end takes a bit rate
    `bits`         the bit rate of an explicit timing, which is among the settings then; else 0
    `warnings`     what was dropped, and why
    """

    name: str
    interface: str
    channel: Any
    rate: int
    listen_only: bool
    settings: dict[str, Any]
    sets_rate: bool
    bits: int = 0
    warnings: tuple[str, ...] = ()

    @property
    def no_wire(self) -> bool:
        """Whether it is made of programs alone, so that no device on it can be real; a virtual interface of the Linux
        kernel (modules vcan and vxcan) is known by its name."""
        kernel = self.interface == "socketcan" and str(self.channel).startswith(("vcan", "vxcan"))
        return kernel or self.interface in NO_WIRE


def split_port(port: str) -> tuple[str, dict[str, Any]]:
    """`can://INTERFACE/CHANNEL` -> interface ("" when not said), and what the address says of the rest.

    CHANNEL is everything after the interface. On POSIX a serial port that is neither a URL nor a COM port begins with
    `/`. Raises RequestError.
    """
    interface, _, channel = port.partition("://")[2].partition("/")
    interface = interface.lower()
    if interface == "socketcand" and channel:
        return interface, _server(port, channel)
    if interface in SERIAL_PORTS and channel and os.name != "nt" and not _is_named(channel):
        channel = f"/{channel}"
    if channel and not interface:
        raise RequestError(
            f"{port!r}: the interface is missing", expected=f"can://INTERFACE/CHANNEL, as {EXAMPLES}"
        )
    return interface, {"channel": channel} if channel else {}


def _is_named(channel: str) -> bool:
    return "://" in channel or channel.startswith("/") or re.fullmatch(r"COM\d+(@\d+)?", channel) is not None


def _server(port: str, rest: str) -> dict[str, Any]:
    host, _, channel = rest.partition("/")
    host, _, number = host.partition(":")
    if not host or not channel or not (number or str(SOCKETCAND_PORT)).isdecimal():
        raise RequestError(
            f"{port!r} does not say which channel of which server",
            expected="can://socketcand/HOST:PORT/CHANNEL",
            advice="for example can://socketcand/localhost:29536/can0",
        )
    return {"channel": channel, "host": host, "port": int(number or SOCKETCAND_PORT)}


def configured(can: Any, port: str, rate: int, options: Mapping[str, object]) -> CanConfig:
    """Everything that was said about this port, put together; `can` is python-can. Raises RequestError."""
    interface, said = split_port(port)
    rest = _worded(options)
    context = rest.pop("config_context", None)
    given = {**rest, **said, **({"interface": interface} if interface else {})}
    whole = _load(can, port, given, None if context is None else str(context))
    interface, channel = whole.pop("interface"), whole.pop("channel")
    whole = _worded(whole)
    back_end = _class(can, interface)
    names = parameters(back_end) - _ELSEWHERE if back_end else None
    _check_options(port, interface, set(rest), names, timing=_takes(back_end, "timing"))
    config = CanConfig(
        name=port,
        interface=interface,
        channel=channel,
        rate=rate or _number(whole.get("bitrate")),
        listen_only=_switch("listen_only", whole.pop("listen_only", False)),
        settings={name: value for name, value in whole.items() if names is None or name in names},
        sets_rate=_takes(back_end, "bitrate"),
        warnings=tuple(
            f"python-can's configuration says {name}={value}, which {interface} does not have: ignored"
            for name, value in whole.items()
            if names is not None and name not in {*names, *given, *TIMING, "timing", "bitrate"}
        ),
    )
    return _with_timing(config, whole, set(rest)) if _takes(back_end, "timing") else config


def _with_timing(config: CanConfig, whole: dict[str, Any], said: set[str]) -> CanConfig:
    timing = whole.get("timing")
    if timing is not None:
        settings = {**config.settings, "timing": timing}
        return config._replace(settings=settings, bits=int(getattr(timing, "bitrate", 0)))
    stray = [name for name in TIMING if name in whole and name not in config.settings]
    if not stray:
        return config
    parts = ", ".join(f"{name}={whole[name]}" for name in stray)
    if said & set(stray):
        raise RequestError(
            f"{config.name}: this bit timing is not complete, or impossible",
            sent=parts,
            expected=f"all of {', '.join(TIMING)}",
        )
    warning = f"python-can's configuration says {parts}, which is no whole bit timing: ignored"
    return config._replace(warnings=(*config.warnings, warning))


def _load(can: Any, port: str, given: dict[str, Any], context: str | None) -> dict[str, Any]:
    """python-can's configuration, with what was said on top. Raises RequestError."""
    try:
        return dict(can.util.load_config(config=given, context=context))
    except can.CanInterfaceNotImplementedError:
        raise _no_interface(can, port, str(given.get("interface", ""))) from None
    except Exception as error:  # whatever its readers of INI and JSON raise for nonsense
        raise RequestError(
            f"{port}: python-can cannot use this configuration: {error}",
            advice="see CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE, CAN_CONFIG and python-can's configuration files",
        ) from error


def _no_interface(can: Any, port: str, interface: str) -> RequestError:
    known = sorted(can.VALID_INTERFACES)
    close = difflib.get_close_matches(interface, known, 1)
    if interface:
        what = f"{port!r}: python-can has no interface {interface!r}"
        advice = f"did you mean {close[0]}?" if close else f"for example {EXAMPLES}"
    else:
        what = f"{port!r} says no interface, and python-can's configuration names none that exists"
        advice = f"say can://INTERFACE/CHANNEL, as {EXAMPLES}, or set CAN_INTERFACE and CAN_CHANNEL"
    return RequestError(what, expected=f"one of {', '.join(known)}", advice=advice)


def _class(can: Any, interface: str) -> Any:
    """The class of this back end; None when it cannot be imported, which opening will say with its reason."""
    try:
        return can.interface._get_class_for_interface(interface)
    except can.CanInterfaceNotImplementedError:
        return None


def parameters(back_end: Any) -> set[str]:
    """The names that a back end's constructor takes; of one that declares too few, also those it documents."""
    names = set(inspect.signature(back_end.__init__).parameters)
    if "bitrate" not in names and "kwargs" in names:
        text = f"{back_end.__doc__ or ''}\n{back_end.__init__.__doc__ or ''}"
        names |= set(re.findall(r":param(?:\s[^:\n]*?)?\s(\w+)\s*:", text))
    return names


def _takes(back_end: Any, name: str) -> bool:
    return back_end is None or name in parameters(back_end)


def _check_options(
    port: str, interface: str, options: Collection[str], names: Collection[str] | None, *, timing: bool
) -> None:
    """Every option that the user gave exists, as far as the back end could be looked at."""
    if names is None:
        return
    known = sorted({*names, *_OURS, *(TIMING if timing else ())})
    for name in options:
        if name not in known:
            close = difflib.get_close_matches(name, known, 1)
            raise RequestError(
                f"{port}: {interface} has no option {name!r}",
                expected=f"one of {', '.join(known)}",
                advice=f"did you mean {close[0]}?" if close else "",
            )


def _worded(options: Mapping[str, object]) -> dict[str, Any]:
    """python-can knows true and false, and takes any other word for true."""
    return {name: _WORDS.get(str(value).lower(), value) for name, value in options.items()}


def _switch(name: str, value: object) -> bool:
    if value not in (True, False):  # 1 and 0 are equal to these
        raise RequestError(f"{name}={value}: neither yes nor no", expected="yes or no")
    return bool(value)


def _number(value: object) -> int:
    """A bit rate in python-can's configuration; 0 when there is none."""
    if value is None:
        return 0
    if isinstance(value, int) and value > 0:
        return value
    raise RequestError(f"python-can's configuration says bitrate={value}", expected="a rate in bit/s")
