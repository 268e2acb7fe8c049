"""Open the port of a bus address."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motorbus.errors import RequestError
from motorbus.link.base import Link
from motorbus.link.lock import PortLock

if TYPE_CHECKING:
    from motorbus.link.can import PythonCanLink
    from motorbus.link.slcan import SlcanLink

SERIAL_PORTS = "a device such as /dev/ttyACM0 or COM7, socket://HOST:PORT or rfc2217://HOST:PORT"
CAN_CHANNELS = "can://INTERFACE/CHANNEL, as can://slcan/dev/ttyACM0 or can://socketcan/can0"


def open_link(
    port: str,
    *,
    rate: int = 0,
    default_rate: int = 0,
    kind: str = "bytes",
    options: Mapping[str, object] | None = None,
    lock: PortLock | None = None,
    connect_time: float | None = None,
) -> Link:
    """Open a device (`/dev/ttyACM0`, `COM7`), `socket://host:port`, `rfc2217://host:port` or `can://INTERFACE/CHANNEL`.

    `rate`          bit/s from the user; 0 when not given
    `default_rate`  bit/s of the family
    `kind`          what the family needs, "bytes" or "frames"
    `options`       of the CAN adapter, or the `latency` (s) of a serial port
    `lock`          a lock that the caller already holds, possibly of this port
    `connect_time`  time-out in s for a host of the network

    Raises RequestError for what is not a port, PortNotFound, PortBusy (with the owner) or LinkError.
    """
    scheme = port.partition("://")[0].lower() if "://" in port else ""
    expected = CAN_CHANNELS if kind == "frames" else SERIAL_PORTS
    if (kind == "frames") != (scheme == "can"):
        raise RequestError(
            f"{port!r}: these devices speak {'CAN' if kind == 'frames' else 'on a serial line'}",
            expected=expected,
            advice="a simulated bus needs no port: write sim in its place",
        )
    if scheme not in ("", "socket", "rfc2217", "can") or port.startswith("://"):
        raise RequestError(f"{port!r}: unknown scheme {scheme!r}", expected=expected)
    if not port.strip() or "\0" in port:
        raise RequestError(f"{port!r} is not a port", expected=expected)
    if scheme == "can":
        return open_can(
            port, rate=rate, default_rate=default_rate, options=options, lock=lock, connect_time=connect_time
        )
    rate = rate or default_rate
    if rate <= 0:
        raise RequestError(f"{rate} is not a rate in bit/s", expected="a positive whole number")
    from motorbus.link.serial import open_stream

    link = open_stream(port, rate=rate, lock=lock, connect_time=connect_time)
    given: Mapping[str, Any] = options or {}
    link.latency = given.get("latency", link.latency)
    return link


def open_can(port: str, **settings: Any) -> PythonCanLink | SlcanLink:
    """Open a CAN channel; `settings` and errors are those of `CanLink`."""
    from motorbus.link.can import PythonCanLink, read_address
    from motorbus.link.slcan import SlcanLink

    address = read_address(port)
    return (SlcanLink if address.interface == "slcan" else PythonCanLink)(address, **settings)
