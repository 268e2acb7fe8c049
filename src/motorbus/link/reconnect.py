"""Reopen a port that was lost: an adapter that was unplugged, a server that ended.

A name such as /dev/ttyUSB0 goes to the first adapter that is plugged in. So an adapter is recognised by its serial
number; one without must have the same name, vendor and product.

No thread waits for the port: each use of the bus tries to reopen it, and fails at once until the next try is due. The
lock of the port is kept until another adapter has its name (decision record 0034).
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from threading import Lock
from typing import Any, Final

from motorbus.core.request import Data
from motorbus.errors import AnotherAdapter, LinkLost, MotorbusError, PortNotFound
from motorbus.link import usb_adapters
from motorbus.link.base import Link
from motorbus.link.errors import lost
from motorbus.link.lock import PortLock
from motorbus.link.serial import ports
from motorbus.link.url import open_link
from motorbus.link.usb_adapters import PortInfo

RETRY: Final = 0.1  # s between two tries
CONNECT_TIME: Final = 0.1  # s for a host of the network: the caller has other work
RETRY_ADVICE: Final = (
    "it is looked for again whenever something is asked for; nothing of before is sent again"
)


def find_adapter(name: str, device: str, wanted: PortInfo | None, present: Sequence[PortInfo]) -> str:
    """The present device of an adapter that was `device`; `name` is what messages call it, None: it is not on USB.

    Raises PortNotFound, or AnotherAdapter when another one has taken its place.
    """
    adapters = {os.path.realpath(port.device): port.adapter for port in present if port.adapter}
    there, mine = adapters.get(device, ""), wanted.adapter if wanted else ""
    if there == mine and os.path.exists(device):
        return device
    if wanted is not None and wanted.serial_number:
        for path, adapter in adapters.items():
            if adapter == mine:
                return path
    if there in ("", mine):
        raise PortNotFound(f"{name}: {mine or f'the port {device}'} is not there")
    raise AnotherAdapter(
        f"{name} is gone, and there is another in its place: {there}",
        expected=mine or f"the port {device}",
        cause="another adapter was plugged in and got the name of the lost one",
        advice="plug in the first one, or open the bus again with the right name",
    )


class Reconnecting:
    """A link that is reopened after a loss, at its present rate; see `reconnecting`. It keeps the lock of `link`.

    `find` returns the present address, and raises PortNotFound while the port is absent, LinkLost for another adapter.
    `settings` are for `open_link`. `on_rename` is called with the new name of the lock, and with "" when another
    adapter has the name of the port.
    """

    virtual = False
    simulated = False
    now = staticmethod(time.monotonic)

    def __init__(self, link: Any, find: Callable[[], str], settings: Mapping[str, Any]) -> None:
        self.name: str = link.name
        self.paced: bool = link.paced
        self.on_rename: Callable[[str], object] = str
        self._find = find
        self._settings = settings
        self._access = Lock()
        self._closed = False
        self._repaired = 0  # losses of the caller that are repaired
        self._retry_at = 0.0
        self._error: BaseException | None = None
        self._use(link)

    def _use(self, link: Any) -> None:
        """Use this link from now on; its methods become our attributes, which costs no extra call."""
        if link.lock.held:
            self._lock: PortLock = link.lock
            link.lock = PortLock(link.lock.port)  # closing the link releases nothing
        link.name = self.name
        self._link = link
        self.listen_only: bool = getattr(link, "listen_only", False)
        self.rate: int = link.rate
        self.warnings: tuple[str, ...] = link.warnings
        self.latency: float = link.latency
        self.queue: int = getattr(link, "queue", 0)
        self.read: Callable[[float], list[Data]] = link.read
        self.write: Callable[[Data], None] = link.write
        self.fileno: Callable[[], int | None] = link.fileno
        self.trouble: Callable[[], str] = getattr(link, "trouble", str)

    @property
    def lock_name(self) -> str:
        """The name under which the port is locked; "" when it is not."""
        return self._lock.port if self._lock.held else ""

    def tune(self, rate: int) -> None:
        self._link.tune(rate)
        self.rate = self._link.rate

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
            before = self._lock
            lock = before if before.held else None
            try:
                settings = {**self._settings, "rate": self.rate}
                self._use(open_link(self._find(), lock=lock, connect_time=CONNECT_TIME, **settings))
            except (MotorbusError, OSError) as error:
                self._error = error
                if isinstance(error, AnotherAdapter) and before.held:  # any program may open that one
                    before.release()
                    self.on_rename("")
                raise self._loss() from error
            finally:
                self._retry_at = time.monotonic() + RETRY
            self._error = None
            self._repaired = losses
            if self._lock is not before:
                before.release()
                self.on_rename(self.lock_name)

    def rest(self, until: float) -> None:
        """See `Renewable.rest`."""
        retry = max(self._retry_at, time.monotonic() + RETRY / 20)
        time.sleep(max(0.0, min(until, retry) - time.monotonic()))

    def _loss(self) -> LinkLost:
        """The error of the lost port, with the reason why it was not reopened."""
        error = self._error
        if not isinstance(error, LinkLost):
            error = lost(self.name, getattr(error, "summary", error) or "it went away")
        advice = f"{error.advice}; {RETRY_ADVICE}"
        return LinkLost(error.summary, expected=error.expected, cause=error.cause, advice=advice)


def reconnecting(link: Link, *, lister: Callable[[], Sequence[PortInfo]] = ports, **settings: Any) -> Link:
    """The same link, reopened after a loss; `settings` are those it was opened with, see `open_link`.

    Not for a pseudo-terminal opened by its number, which goes to the next terminal, nor for a port without a lock.
    """
    name = link.name
    lock = getattr(link, "lock", None)
    device: str = getattr(link, "device", "" if "://" in name else name)
    real = os.path.realpath(device)
    is_terminal = real.startswith(usb_adapters.PSEUDO_TERMINALS)
    if lock is None or not lock.held or (is_terminal and not os.path.islink(device)):
        return link
    if not device or is_terminal:
        return Reconnecting(link, lambda: name, settings)
    known = next((port for port in lister() if port.adapter and os.path.realpath(port.device) == real), None)
    port_at: Callable[[str], str] = getattr(link, "port_at", str)
    return Reconnecting(link, lambda: port_at(find_adapter(name, real, known, lister())), settings)
