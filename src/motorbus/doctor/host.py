"""The host: whether the port is there, free, and open to this user."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from motorbus import session
from motorbus.bus.blocking import Bus
from motorbus.core.findings import Finding
from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound

CH340: Final = ("1a86", "7523")  # the adapter that brltty takes for a Braille display


def open_port(address: str, where: str) -> Bus | Finding:
    """The open read-only bus of this address, or what prevents it. Raises RequestError for a bad address."""
    try:
        bus = session.open(address)
    except LinkError as error:
        return explain(error, where)
    bus.read_only = True
    return bus


def explain(error: LinkError, where: str) -> Finding:
    """The finding of an error of a port."""
    code, text = "port-refused", error.summary
    if "brltty" in text or (isinstance(error, PortNotFound) and has_brltty()):
        return Finding("brltty", where, text)
    if isinstance(error, PortNotFound):
        code = "port-missing"
    elif isinstance(error, PortBusy):
        code = "port-busy"
    elif isinstance(error, LinkLost):
        code = "port-lost"
    elif "no permission" in text:
        code = "port-permission"
    elif "bit/s" in text:
        code = "rate-refused"
    return Finding(code, where, text, error.cause, error.advice)


def has_brltty(sysfs: Path = Path("/sys"), proc: Path = Path("/proc")) -> bool:
    """A CH340 is plugged in, and brltty runs: it took the port when the adapter was plugged in."""
    devices = list((sysfs / "bus/usb/devices").glob("*"))
    adapters = [(_text(one / "idVendor"), _text(one / "idProduct")) for one in devices]
    return CH340 in adapters and any(_text(one) == "brltty" for one in proc.glob("[1-9]*/comm"))


def _text(path: Path) -> str:
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
