"""From the port in a bus address to an open link."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motorbus.errors import RequestError
from motorbus.link.base import Link
from motorbus.link.lock import PortLock

SCHEMES = ("socket://HOST:PORT", "rfc2217://HOST:PORT")


def open_link(
    port: str,
    *,
    rate: int = 0,
    usual: int = 0,
    kind: str = "bytes",
    options: Mapping[str, object] | None = None,
    kept: PortLock | None = None,
    patience: float | None = None,
) -> Link:
    """Open a device (`/dev/ttyACM0`, `COM7`), `socket://host:port`, `rfc2217://…` or `can://INTERFACE/CHANNEL`.

    `rate` in bit/s is what the user said, 0 when nothing, and `usual` what the family expects then; `kind` what it
    wants: bytes or frames; `options` are for the CAN adapter, or say the `latency` (s) of a serial port. `kept` is a
    lock that we have already, maybe of this port; `patience` how long (s) a host of the network is waited for.
    Raises RequestError for what is no port, PortNotFound, PortBusy (naming its owner) or LinkError.
    """
    scheme = port.partition("://")[0].lower() if "://" in port else None
    if scheme == "can" and kind == "frames" and "\0" not in port:
        from motorbus.link.can import CanLink

        return CanLink(port, rate=rate, usual=usual, options=options or {}, kept=kept)
    rate = rate or usual
    _check(port, scheme, rate, kind)
    link = _serial(port, scheme, rate, kept, patience)
    said: Mapping[str, Any] = options or {}
    link.latency = said.get("latency", link.latency)
    return link


def _serial(port: str, scheme: str | None, rate: int, kept: PortLock | None, patience: float | None) -> Link:
    if scheme == "socket":
        from motorbus.link.tcp import TcpLink

        more = {} if patience is None else {"patience": patience}
        return TcpLink(port, rate=rate, kept=kept, **more)
    from motorbus.link.serial import open_serial

    return open_serial(port, rate=rate, kept=kept, patience=patience)


def _check(port: str, scheme: str | None, rate: int, kind: str) -> None:
    if (kind == "frames") != (scheme == "can"):
        raise RequestError(
            f"{port!r}: these devices speak {'CAN' if kind == 'frames' else 'on a serial line'}",
            expected="can://INTERFACE/CHANNEL, as can://slcan/dev/ttyACM0 or can://socketcan/can0"
            if kind == "frames"
            else f"a device such as /dev/ttyACM0 or COM7, {' or '.join(SCHEMES)}",
            advice="a simulated bus needs no port: write sim in its place",
        )
    if scheme not in (None, "socket", "rfc2217", "can"):
        raise RequestError(
            f"{port!r}: unknown scheme {scheme!r}",
            expected=f"a device such as /dev/ttyACM0 or COM7, {' or '.join(SCHEMES)}",
        )
    if not port.strip() or "\0" in port:
        raise RequestError(
            f"{port!r} is not a port", expected=f"a device such as /dev/ttyACM0, {' or '.join(SCHEMES)}"
        )
    if rate <= 0:
        raise RequestError(f"{rate} is not a rate in bit/s", expected="a positive whole number")
