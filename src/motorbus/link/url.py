"""From the port in a bus address to an open link."""

from __future__ import annotations

from motorbus.errors import RequestError
from motorbus.link.base import Link

SCHEMES = ("socket://HOST:PORT", "rfc2217://HOST:PORT")


def open_link(port: str, *, rate: int, kind: str = "bytes") -> Link:
    """Open a device (`/dev/ttyACM0`, `COM7`), `socket://host:port` or `rfc2217://host:port`.

    `rate` in bit/s, `kind` what the family wants: bytes or frames. Raises RequestError for what is no port,
    PortNotFound, PortBusy (naming its owner) or LinkError.
    """
    scheme = port.partition("://")[0].lower() if "://" in port else None
    _check(port, scheme, rate, kind)
    if scheme == "socket":
        from motorbus.link.tcp import TcpLink

        return TcpLink(port, rate=rate)
    from motorbus.link.serial import open_serial

    return open_serial(port, rate=rate)


def _check(port: str, scheme: str | None, rate: int, kind: str) -> None:
    if kind == "frames" or scheme == "can":
        raise RequestError(
            f"{port!r}: this version has no CAN adapters",
            cause="they come together with the first CAN family, KST",
            advice="a simulated bus needs none: write sim in place of the port",
        )
    if scheme not in (None, "socket", "rfc2217"):
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
