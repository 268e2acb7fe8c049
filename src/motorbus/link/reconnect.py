"""Reopen a port that was lost: an adapter that was unplugged, a server that ended.

A name such as /dev/ttyUSB0 goes to the first adapter that is plugged in. So an adapter is recognised by its serial
number; without one, by vendor, product and USB socket. A pseudo-terminal is recognised by the symbolic link to it, for
its number goes to the next terminal.

No thread waits for the port: each use of the bus tries to reopen it, soon at first and then less often, and fails at
once in between. The lock of the port is kept until another adapter has its name (decision record 0034).
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from threading import Lock
from typing import Any, Final, NamedTuple

from motorbus.core.request import Data
from motorbus.errors import AnotherAdapter, LinkLost, MotorbusError, PortNotFound
from motorbus.link import usb_adapters
from motorbus.link.base import Link
from motorbus.link.errors import lost
from motorbus.link.lock import PortLock, real_name
from motorbus.link.serial import list_ports
from motorbus.link.url import open_link

FIRST_RETRY: Final = 0.05  # s after the first failure; then twice as long each time
LAST_RETRY: Final = 0.5  # s at most
CONNECT_TIME: Final = 0.1  # s for a host of the network: the caller has other work
RETRY_ADVICE: Final = (
    "it is looked for again whenever something is asked for; nothing of before is sent again"
)
_USB_SOCKET: Final = re.compile(r"\d+-\d+(\.\d+)*:\d+\.\d+")
"""Kernel name of the interface of a USB device: bus-port.port:configuration.interface."""

Lister = Callable[[], Iterable[Any]]
"""Lists the serial ports, as `serialx.list_serial_ports` does."""


class Identity(NamedTuple):
    """A serial port. Ports with the same `text` and `interface` are the same, or cannot be distinguished.

    `interface` is its number in an adapter with several ports, `place` the USB socket, "" when unknown; `device` is the
    present name.
    """

    text: str
    interface: tuple[object, ...]
    place: str
    device: str


def identities(lister: Lister, sysfs: Path = Path("/sys")) -> list[Identity]:
    """The identity of every serial port that the system lists."""
    found = []
    for port in lister():
        device = port.resolved_device
        parts = Path(os.path.realpath(sysfs / "class" / "tty" / Path(device).name / "device")).parts
        place = next((part for part in reversed(parts) if _USB_SOCKET.fullmatch(part)), "")
        text = f"the port {device}"
        if port.vid is not None:
            mark = f"at the USB place {place}" if place else f"at {device}"
            if port.serial_number:
                mark = f"with the serial number {port.serial_number}"
            text = f"the adapter {port.vid:04x}:{port.pid or 0:04x} {mark}"
        found.append(Identity(text, (port.interface_num, port.port_number), place, device))
    return found


def identify(device: str, lister: Lister, sysfs: Path = Path("/sys")) -> Identity:
    """The identity of a port that is present; `device` is a path without symbolic links."""
    found = (one for one in identities(lister, sysfs) if real_name(one.device) == real_name(device))
    return next(found, Identity(f"the port {device}", (), "", device))


def find_adapter(name: str, wanted: Identity, lister: Lister, sysfs: Path = Path("/sys")) -> str:
    """The present device of an adapter; `name` is what messages call it.

    Raises PortNotFound while it is absent, AnotherAdapter when its name belongs to another one, LinkLost when several
    could be it.
    """
    present = identities(lister, sysfs)
    same = [one for one in present if one[:2] == wanted[:2]]
    if len(same) > 1:  # some makers give one number to a whole batch
        same = [one for one in same if wanted.place and one.place == wanted.place]
        if len(same) != 1:
            raise LinkLost(
                f"{name} is gone, and several adapters with one serial number could be it",
                expected=wanted.text,
                advice="plug it in where it was, or open the bus again with the right name",
            )
    if same:
        return same[0].device
    for other in present:
        if real_name(other.device) == real_name(wanted.device):
            raise AnotherAdapter(
                f"{name} is gone, and there is another in its place: {other.text}",
                expected=wanted.text,
                cause="another adapter was plugged in and got the name of the lost one",
                advice="plug in the first one, or open the bus again with the right name",
            )
    if not wanted.interface and os.path.exists(wanted.device):  # the system does not list it
        return wanted.device
    raise PortNotFound(f"{name}: {wanted.text} is not there")


def link_times(device: str) -> tuple[int, ...]:
    """When each symbolic link of the chain from `device` to its terminal was made (ns)."""
    times, path = [], device
    while os.path.islink(path):
        times.append(os.lstat(path).st_ctime_ns)
        path = os.path.join(os.path.dirname(path), os.readlink(path))
    return tuple(times)


def find_terminal(name: str, device: str, before: tuple[int, ...]) -> str:
    """The address `name` of a pseudo-terminal to which the symbolic link `device` leads.

    The link must be newer than its terminal, or made again since `before` (see `link_times`): a link that a killed
    simulator left over leads to a terminal of another program. Raises PortNotFound.
    """
    real = os.path.realpath(device)
    if not (os.path.exists(real) and real.startswith(usb_adapters.PSEUDO_TERMINALS)):
        raise PortNotFound(f"{device} leads to no pseudo-terminal")
    times = link_times(device)
    if times == before and max(times, default=0) < os.stat(real).st_ctime_ns:
        raise PortNotFound(f"{device} has not been made again")
    return name


class Reconnecting:
    """A link that is reopened after a loss; see `reconnecting`. It keeps the lock of `link`.

    `find` returns the present address, and raises PortNotFound while the port is absent, LinkLost for another adapter.
    `settings` are for `open_link`. `on_rename` is called with the new name of the lock, and with "" when another
    adapter has the name of the port.
    """

    virtual = False
    simulated = False

    def __init__(self, link: Any, find: Callable[[], str], settings: Mapping[str, Any]) -> None:
        self.name: str = link.name
        self.paced: bool = link.paced
        self.on_rename: Callable[[str], object] = str
        self._find = find
        self._settings = settings
        self._first_rate: int = link.rate
        self._access = Lock()
        self._closed = False
        self._repaired = 0  # losses of the caller that are repaired
        self._pause = 0.0
        self._retry_at = 0.0
        self._error: BaseException | None = None
        self._use(link)

    def _use(self, link: Any) -> None:
        """Use this link from now on; its methods become our attributes, which costs no extra call."""
        if link.lock.held:
            self._lock: PortLock = link.lock
            link.lock = PortLock(link.lock.port)  # closing the link releases nothing
        link.name = self.name
        self._link: Link = link
        self.listen_only = bool(getattr(link, "listen_only", False))
        self.rate: int = link.rate
        self.warnings: tuple[str, ...] = link.warnings
        self.latency: float = link.latency
        self.queue: int = getattr(link, "queue", 0)
        self.now = link.now  # type: ignore[method-assign]
        self.read = link.read  # type: ignore[method-assign]
        self.write = link.write  # type: ignore[method-assign]

    @property
    def lock_name(self) -> str:
        """The name under which the port is locked; "" when it is not."""
        return self._lock.port if self._lock.held else ""

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: Data) -> None:
        raise self._loss()

    def read(self, until: float) -> list[Data]:
        raise self._loss()

    def tune(self, rate: int, listen_only: bool = False) -> None:
        self._link.tune(rate, listen_only)
        self.rate, self.listen_only = self._link.rate, listen_only

    def fileno(self) -> int | None:
        return self._link.fileno()

    def trouble(self) -> str:
        """What the adapter has reported since the last call."""
        report: str = getattr(self._link, "trouble", str)()
        return report

    def close(self) -> None:
        self._closed = True
        with self._access:  # also a port that another thread is opening
            self._link.close()
            self._lock.release()

    def renew(self, losses: int) -> None:
        """See `Renewable.renew`. Waits for another thread that is reopening the port."""
        with self._access:
            if self._closed:
                raise lost(self.name, "it is closed")
            if losses <= self._repaired:
                return
            if time.monotonic() < self._retry_at:
                raise self._loss()
            self._link.close()
            for method in ("read", "write"):  # ours raise the reason
                self.__dict__.pop(method, None)
            before = self._lock
            try:
                self._use(self._reopen())
            except (MotorbusError, OSError) as error:
                self._error = error
                self._pause = min(2 * self._pause or FIRST_RETRY, LAST_RETRY)
                self._retry_at = time.monotonic() + self._pause
                if isinstance(error, AnotherAdapter) and before.held:  # any program may open that one
                    before.release()
                    self.on_rename("")
                raise self._loss() from error
            self._error = None
            self._repaired, self._pause, self._retry_at = losses, 0.0, time.monotonic() + FIRST_RETRY
            if self._lock is not before:
                before.release()
                self.on_rename(self.lock_name)

    def _reopen(self) -> Link:
        """Open the port with its present rate and mode; a rate that was not given is not forced."""
        settings = dict(self._settings)
        if self.rate != self._first_rate:
            settings["rate"] = self.rate
        if settings.get("kind") == "frames":
            settings["options"] = {**(settings.get("options") or {}), "listen_only": self.listen_only}
        lock = self._lock if self._lock.held else None
        address = self._find()
        link = open_link(address, lock=lock, connect_time=CONNECT_TIME, **settings)
        try:
            if self._find() == address:
                return link
            raise PortNotFound(f"{self.name} was exchanged while it was opened")
        except BaseException:
            link.close()
            raise

    def rest(self, until: float) -> None:
        """See `Renewable.rest`."""
        retry = max(self._retry_at, time.monotonic() + FIRST_RETRY / 10)
        time.sleep(max(0.0, min(until, retry) - time.monotonic()))

    def _loss(self) -> LinkLost:
        """The error of the lost port, with the reason why it was not reopened."""
        error = self._error
        found = lost(self.name, getattr(error, "summary", error) or "it went away")
        if isinstance(error, LinkLost):
            found.summary = error.summary
        if isinstance(error, MotorbusError) and not isinstance(error, PortNotFound):
            found.expected, found.cause, found.advice = error.expected, error.cause, error.advice
        found.advice = f"{found.advice or 'check the other end'}; {RETRY_ADVICE}"
        return found


def reconnecting(
    link: Link, *, lister: Lister = list_ports, sysfs: Path = Path("/sys"), **settings: Any
) -> Link:
    """The same link, reopened after a loss; `settings` are those it was opened with, see `open_link`.

    Not for a pseudo-terminal opened by its number, which goes to the next terminal, nor for a port without a lock.
    """
    name = link.name
    lock = getattr(link, "lock", None)
    device: str = getattr(link, "device", "" if "://" in name else name)
    real = os.path.realpath(device)
    is_terminal = real.startswith(usb_adapters.PSEUDO_TERMINALS)
    if lock is None or not lock.held or (is_terminal and os.path.abspath(device) == real):
        return link
    if not device:
        return Reconnecting(link, lambda: name, settings)
    if is_terminal:
        times = link_times(device)
        return Reconnecting(link, lambda: find_terminal(name, device, times), settings)
    known = identify(real, lister, sysfs)
    port_at: Callable[[str], str] = getattr(link, "port_at", str)
    return Reconnecting(link, lambda: port_at(find_adapter(name, known, lister, sysfs)), settings)
