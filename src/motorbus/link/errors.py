"""Errors of ports that cannot be opened, are in use, or are gone; each names its cause and the remedy."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from motorbus.errors import LinkError, LinkFull, LinkLost, PortBusy, PortNotFound
from motorbus.link.usb_adapters import PortInfo

ADVICE = {
    "ModemManager": "it tries every new adapter for a modem: wait half a minute, or set ID_MM_DEVICE_IGNORE for it",
    "brltty": "it takes CH340 adapters for Braille displays: remove the package brltty",
}


class Owner(NamedTuple):
    """A process that holds a port: process id, program name, and the port where it is known."""

    pid: int
    program: str
    port: str = ""


def not_found(port: str, others: Sequence[PortInfo]) -> PortNotFound:
    """There is no such port; `others` are the ports of this machine."""
    advice, cause = "is the adapter plugged in, the simulator running? `motorbus scan` lists the ports", ""
    if os.path.islink(port):
        cause = f"it leads to {os.readlink(port)}, which is gone"
    elif os.path.exists(f"/dev/{port}"):
        advice = f"did you mean /dev/{port}? {advice}"
    return PortNotFound(
        f"{port}: there is no such port", expected=_listed(others), cause=cause, advice=advice
    )


def not_a_port(port: str, others: Sequence[PortInfo]) -> PortNotFound:
    """The port exists but is not a serial port."""
    return PortNotFound(
        f"{port} is not a serial port",
        expected=_listed(others),
        advice="`motorbus scan` lists the ports",
    )


def _listed(others: Sequence[PortInfo]) -> str:
    names = [f"{info.device} ({info.guess})" if info.guess else info.device for info in others]
    return f"one of {', '.join(names)}" if names else "a serial port; this machine has none at present"


def busy(port: str, owner: Owner | None) -> PortBusy:
    """Another program holds the port; None when it is unknown which one."""
    holder, advice = "another program", "close it there: a bus has one owner at a time"
    if owner is not None:
        holder = f"process {owner.pid} ({owner.program})"
        advice = ADVICE.get(owner.program, advice)
        if owner.pid == os.getpid():
            holder = f"this very program (process {owner.pid})"
    error = PortBusy(f"{port} is held by {holder}", advice=advice)
    error.owner = owner.pid if owner else None
    return error


def no_permission(port: str, device: str) -> LinkError:
    """The user has no permission for the port."""
    group = "dialout"
    with contextlib.suppress(KeyError, OSError, NotImplementedError):
        group = Path(device).group()
    if group in ("root", "tty"):  # joining these is bad advice
        group = "dialout"
    return LinkError(
        f"{port}: no permission to open it",
        cause=f"you are not in the group {group}",
        advice=f"sudo usermod -aG {group} $USER and log in again, or a udev rule with"
        ' SUBSYSTEM=="tty", TAG+="uaccess" in /etc/udev/rules.d/70-motorbus.rules',
    )


def unsupported_rate(port: str, rate: int, reason: object) -> LinkError:
    """The adapter does not have this rate (bit/s)."""
    return LinkError(
        f"{port} cannot do {rate} bit/s: {reason}",
        advice="choose another rate, or another adapter for this one",
    )


def lost(port: str, reason: object) -> LinkLost:
    """The port was open and is gone."""
    text = reason.strerror if isinstance(reason, OSError) and reason.strerror else reason
    return LinkLost(
        f"{port} is gone: {text}",
        cause="the adapter was unplugged or lost its power, or the server of the port ended",
        advice="check the other end",
    )


def full(port: str, written: int, length: int) -> LinkError:
    """The port accepted only `written` of `length` bytes. LinkFull if it accepted none."""
    return (LinkError if written else LinkFull)(
        f"{port} takes no more bytes: {written} of {length} went out",
        cause="the other end does not read, or bytes are written faster than the rate allows",
    )
