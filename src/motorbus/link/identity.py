"""Which adapter a port belongs to, so that it is found again under another name, and no other one is taken for it.

A name such as /dev/ttyUSB0 goes to whoever is plugged in first. What stays is the serial number of the adapter; where
it has none, its vendor and product, and the place on the USB where it is plugged in. Two ports in one adapter differ by
their interface. A pseudo-terminal is known by the link that leads to it, for its own number goes to the next terminal.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from motorbus.errors import AnotherAdapter, LinkLost, PortNotFound

PSEUDO_TERMINALS = ("/dev/pts/", "/dev/ttys")
_PLACE = re.compile(r"\d+-\d+(\.\d+)*:\d+\.\d+")
"""An interface of a USB device as the kernel calls it: bus-port.port:configuration.interface."""

Lister = Callable[[], Iterable[Any]]
"""What tells of the serial ports there are, as `serialx.list_serial_ports` does."""


class Identity(NamedTuple):
    """What makes an adapter this one and no other; `vid` is None for what is on no USB.

    `interface` and `number` tell apart the ports of one adapter; `place` is where on the USB it is plugged in, "" where
    the system does not say; `device` is the name that it had.
    """

    device: str
    vid: int | None = None
    pid: int | None = None
    serial_number: str = ""
    interface: int | None = None
    number: int | None = None
    place: str = ""

    def __str__(self) -> str:
        if self.vid is None:
            return f"the port {self.device}"
        what = f"the adapter {self.vid:04x}:{self.pid or 0:04x}"
        if self.serial_number:
            return f"{what} with the serial number {self.serial_number}"
        return f"{what} at the USB place {self.place}" if self.place else f"{what} at {self.device}"

    def is_same(self, other: Identity) -> bool:
        """Whether that is the same port of the same adapter."""
        if self._kind() != other._kind():
            return False
        if self.vid is not None and self.serial_number:
            return True
        if self.vid is not None and self.place:
            return self.place == other.place
        return self.device == other.device

    def _kind(self) -> tuple[object, ...]:
        return (self.vid, self.pid, self.serial_number, self.interface, self.number)


def identities(lister: Lister, sysfs: Path = Path("/sys")) -> list[Identity]:
    """The serial ports there are, as far as the system tells of them."""
    return [
        Identity(
            device=port.resolved_device,
            vid=port.vid,
            pid=port.pid,
            serial_number=port.serial_number or "",
            interface=port.interface_num,
            number=port.port_number,
            place=place(port.resolved_device, sysfs) if port.vid is not None else "",
        )
        for port in lister()
    ]


def place(device: str, sysfs: Path = Path("/sys")) -> str:
    """Where on the USB the adapter of this device is plugged in; "" where the system does not say."""
    parts = Path(os.path.realpath(sysfs / "class" / "tty" / Path(device).name / "device")).parts
    return next((part for part in reversed(parts) if _PLACE.fullmatch(part)), "")


def identity_of(device: str, lister: Lister, sysfs: Path = Path("/sys")) -> Identity:
    """The identity of a device that is there; `device` has no symbolic links."""
    found = (one for one in identities(lister, sysfs) if _same_name(one.device, device))
    return next(found, Identity(device))


def found_again(name: str, wanted: Identity, lister: Lister, sysfs: Path = Path("/sys")) -> str:
    """The device under which an adapter is there now, that people call `name`.

    Raises PortNotFound while it is not there, LinkLost when it is not certain which one it is, or another one is where
    it was.
    """
    there = identities(lister, sysfs)
    same = [one for one in there if wanted.is_same(one)]
    if len(same) > 1:  # makers give one number to all of a batch
        same = [one for one in same if wanted.place and one.place == wanted.place]
        if len(same) != 1:
            raise LinkLost(
                f"{name} is gone, and several adapters could be it",
                expected=str(wanted),
                cause="their maker has given all of them one serial number",
                advice="plug it in where it was, or open the bus anew by the name that is right",
            )
    if same:
        return same[0].device
    other = next((one for one in there if _same_name(one.device, wanted.device)), None)
    if other is None and wanted.vid is None and os.path.exists(wanted.device):
        return wanted.device  # a port of which the system does not tell
    if other is not None:
        raise another(name, wanted, str(other))
    raise PortNotFound(f"{name}: {wanted} is not there")


def another(name: str, wanted: Identity | str, there: str) -> AnotherAdapter:
    """The error for another adapter that is where the lost one was."""
    return AnotherAdapter(
        f"{name} is gone, and there is another in its place: {there}",
        expected=str(wanted),
        cause="another adapter was plugged in, and it got the name of the one that is gone",
        advice="plug in the one that was there, or open the bus anew by the name that is right",
    )


def _same_name(one: str, other: str) -> bool:
    return one.upper() == other.upper() if os.name == "nt" else one == other
