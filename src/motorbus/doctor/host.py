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
    """The open bus of this address, or the finding that prevents it. Raises RequestError for a bad address."""
    try:
        bus = session.open(address)
    except LinkError as error:
        return explain(error, where)
    bus.read_only = True
    return bus


def explain(error: LinkError, where: str) -> Finding:
    """The finding of an error of a port."""
    code, cause = "port-refused", error.cause or "the system refuses the port"
    if isinstance(error, PortNotFound):
        code, cause = "port-missing", error.cause or "the adapter is not plugged in, or has another name now"
        if brltty_took_it():
            code, cause = "brltty", "brltty takes CH340 adapters for Braille displays"
            return Finding(
                code, "error", where, error.summary, cause, "`sudo apt remove brltty`, plug it in again"
            )
    elif isinstance(error, PortBusy):
        code, cause = "port-busy", "a bus has one owner at a time"
        if "brltty" in error.summary:
            code, cause = "brltty", "brltty takes CH340 adapters for Braille displays"
    elif isinstance(error, LinkLost):
        code, cause = "port-lost", "a loose plug, a hub without supply, or a supply that dips"
    elif "no permission" in error.summary:
        code = "port-permission"
    elif "bit/s" in error.summary:
        code, cause = "rate-refused", "the adapter or its driver does not have this rate"
    return Finding(code, "error", where, error.summary, cause, error.advice or "plug the adapter in again")


def brltty_took_it(sysfs: Path = Path("/sys"), proc: Path = Path("/proc")) -> bool:
    """A CH340 is plugged in, and brltty runs: the port vanished when it was plugged in."""
    adapters = [
        (_text(device / "idVendor"), _text(device / "idProduct"))
        for device in (sysfs / "bus/usb/devices").glob("*")
    ]
    return CH340 in adapters and any(_text(one) == "brltty" for one in proc.glob("[1-9]*/comm"))


def _text(path: Path) -> str:
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""
