"""What to tell when a port cannot be opened, cannot be used, or is gone.

People lose more time here than anywhere else, so each message says what is the case and what to do about it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import NamedTuple

from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound
from motorbus.link.adapters import PortInfo

ADVICE = {
    "ModemManager": "it tries every new adapter for a modem: wait half a minute, or set ID_MM_DEVICE_IGNORE for it",
    "brltty": "it takes CH340 adapters for Braille displays: remove the package brltty",
}


class Owner(NamedTuple):
    """A process that holds a port: its id, its program's name, and the port where it is known."""

    pid: int
    program: str
    port: str = ""


def not_found(port: str, others: Sequence[PortInfo]) -> PortNotFound:
    """There is no such port, but there are these."""
    relative = os.name != "nt" and "://" not in port and not os.path.isabs(port)
    meant = f"/dev/{port}" if relative and port.startswith("tty") and os.path.exists(f"/dev/{port}") else ""
    return PortNotFound(
        f"{port}: there is no such port",
        expected=_one_of(others),
        cause=_why_not(port, relative),
        advice=(f"did you mean {meant}? " if meant else "")
        + "is the adapter plugged in, the simulator running? `motorbus ports` lists what there is",
    )


def no_port(port: str, others: Sequence[PortInfo], device: str = "") -> PortNotFound:
    """There is something of this name, or there is the `device` that it names, but it is no port; these are."""
    return PortNotFound(
        f"{port}{device and f': {device}'} is not a serial port",
        expected=_one_of(others),
        advice="`motorbus ports` lists what there is; nothing was sent",
    )


def _one_of(others: Sequence[PortInfo]) -> str:
    names = [f"{info.device} ({info.guess})" if info.guess else info.device for info in others]
    return f"one of {', '.join(names)}" if names else "a serial port; this machine has none at present"


def _why_not(port: str, relative: bool) -> str:
    if os.path.islink(port):
        return f"it leads to {os.readlink(port)}, which is gone"
    if relative:
        where = os.path.abspath(port)
        return (
            f"it does not begin with /, so it is relative to the folder in which this program runs: {where}"
        )
    return ""


def busy(port: str, owner: Owner | None) -> PortBusy:
    """Somebody else holds the port."""
    if owner is None:
        who = "another program"
    elif owner.pid == os.getpid():
        who = f"this very program (process {owner.pid})"
    else:
        who = f"process {owner.pid} ({owner.program})"
    usual = "close it there: a bus has one owner at a time"
    error = PortBusy(f"{port} is held by {who}", advice=ADVICE.get(owner.program, usual) if owner else usual)
    error.owner = owner.pid if owner else None
    return error


def forbidden(port: str, device: str) -> LinkError:
    """The user may not open the port."""
    group = _group(device)
    return LinkError(
        f"{port}: no permission to open it",
        cause=f"you are not in the group {group}",
        advice=f"sudo usermod -aG {group} $USER and log in again, or a udev rule with"
        ' SUBSYSTEM=="tty", TAG+="uaccess" in /etc/udev/rules.d/70-motorbus.rules',
    )


def _group(device: str) -> str:
    """The group that may open this device; root's own is no advice."""
    try:
        import grp

        name = grp.getgrgid(os.stat(device).st_gid).gr_name
    except (ImportError, KeyError, OSError):
        return "dialout"
    return "dialout" if name in ("root", "tty") else name


def wrong_rate(port: str, rate: int, why: object) -> LinkError:
    """The adapter cannot do this rate."""
    return LinkError(
        f"{port} cannot do {rate} bit/s: {why}", advice="choose another rate, or another adapter for this one"
    )


def lost(port: str, why: object) -> LinkLost:
    """The port was open and is gone."""
    reason = why.strerror if isinstance(why, OSError) and why.strerror else why
    return LinkLost(
        f"{port} is gone: {reason}",
        cause="the adapter was unplugged or lost its power, or whoever served the port ended",
        advice="see to the other end, then open the bus anew",
    )


def full(port: str, written: int, length: int) -> LinkError:
    """The port takes no more bytes."""
    return LinkError(
        f"{port} takes no more bytes: {written} of {length} went out",
        cause="the other end does not read, or bytes are written faster than the rate allows",
    )
