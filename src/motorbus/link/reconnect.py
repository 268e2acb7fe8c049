"""A port that was lost is opened anew when it is there again: an adapter that was pulled, a server that ended.

It is known by what does not change (`identity`), so it is found under another name, and no other adapter is taken for
it. Nothing waits for it and no thread looks: whoever uses the bus has it looked for, at first soon and then more
seldom, and is told at once that it is gone. Nothing is kept of what was to be sent. The lock of the port is kept, so
nobody else gets in between, until something else has its name; then that belongs to whoever opens it (decision record
0034).
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import Any, Final, Protocol

from motorbus.core.operation import Data
from motorbus.errors import AnotherAdapter, LinkLost, MotorbusError, PortNotFound
from motorbus.link.base import Link
from motorbus.link.can_config import SOCKETCAND_PORT
from motorbus.link.identity import PSEUDO_TERMINALS, Lister, another, found_again, identity_of
from motorbus.link.lock import PortLock
from motorbus.link.refusal import lost
from motorbus.link.tcp import split_address
from motorbus.link.url import open_link

FIRST: Final = 0.05
"""s after the first look that failed, until the next one; then twice as long each time."""
LONGEST: Final = 0.5
"""s between two looks at most: with the time that opening takes it is there within 2 s of its return."""
PATIENCE: Final = 0.1
"""s for a host of the network to answer at all, when it is looked for: whoever waits has other things to do."""
MOST_LINKS: Final = 16
"""Symbolic links behind one another that are looked at."""
AGAIN: Final = "it is looked for again whenever something is asked for; nothing of before is sent again"


class Again(Protocol):
    """Opens a port anew, at a rate (bit/s), only listening or not, with the lock that is kept for it."""

    def __call__(self, rate: int, listen_only: bool, kept: PortLock) -> Link:
        """Raises PortNotFound while it is not there, LinkLost where another one is, or what opening a port raises."""


class Reconnecting:
    """An open link, and how it is opened `again`. `link` is there and has a lock; see `reconnecting`.

    `moved` is called with the name by which the port is locked when that has changed, and with "" when something else
    has that name.
    """

    virtual = False
    simulated = False

    def __init__(self, link: Any, again: Again) -> None:
        self.name: str = link.name
        self.paced: bool = link.paced
        self.moved: Callable[[str], None] = _nobody
        self._again = again
        self._turn = Lock()
        self._closed = False
        self._mended = 0  # this loss, and all before, are over
        self._wait = 0.0
        self._next = 0.0
        self._error: BaseException | None = None
        self._lock: PortLock = link.lock
        link.lock = self._lock.lent()
        self._take(link)

    def _take(self, link: Any) -> None:
        """Use this one from now on: its methods are ours, so that nothing comes in between."""
        self._link = link
        self.rate: int = link.rate
        self.warnings: tuple[str, ...] = link.warnings
        self.latency: float = link.latency
        self.now = link.now  # type: ignore[method-assign]
        self.read = link.read  # type: ignore[method-assign]
        self.write = link.write  # type: ignore[method-assign]

    # -- what every link offers ----------------------------------------------------------------------------------------

    @property
    def listen_only(self) -> bool:
        """Nothing is sent."""
        return bool(getattr(self._link, "listen_only", False))

    @property
    def lock_name(self) -> str:
        """The name by which the port is locked, and listens for an emergency stop; "" where it is not."""
        return self._lock.port if self._lock.held else ""

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: Data) -> None:
        raise self._gone()

    def read(self, until: float) -> list[Data]:
        raise self._gone()

    def tune(self, rate: int, listen_only: bool = False) -> None:
        self._link.tune(rate, listen_only)
        self.rate = self._link.rate

    def fileno(self) -> int | None:
        descriptor: int | None = self._link.fileno()
        return descriptor

    def trouble(self) -> str:
        """What the adapter has to say of failures since it was last asked."""
        told: str = getattr(self._link, "trouble", str)()
        return told

    def close(self) -> None:
        self._closed = True
        with self._turn:  # a port that is just being opened is closed as well
            self._link.close()
            self._lock.release()

    def __getattr__(self, name: str) -> Any:
        if name == "_link":  # before there is one
            raise AttributeError(name)
        return getattr(self._link, name)

    # -- lost, and found again -----------------------------------------------------------------------------------------

    def renew(self, losses: int) -> None:
        """See `Renewable.renew`. Another thread that is at it is waited for: it may find it."""
        with self._turn:
            if self._closed:
                raise lost(self.name, "it is closed")
            if losses <= self._mended:
                return
            if time.monotonic() < self._next:
                raise self._gone()
            self._link.close()
            self._forget()
            try:
                self._put(self._again(self.rate, self.listen_only, self._lock))
            except (MotorbusError, OSError) as error:
                self._look_later(error)
                raise self._gone() from error
            self._mended, self._wait, self._next = losses, 0.0, time.monotonic() + FIRST

    def rest(self, until: float) -> None:
        """See `Renewable.rest`."""
        pause = min(until, max(self._next, time.monotonic() + FIRST / 10)) - time.monotonic()
        if pause > 0:
            time.sleep(pause)

    def _forget(self) -> None:
        """From now on it is gone: what is written or read says why."""
        for name in ("read", "write"):
            self.__dict__.pop(name, None)

    def _put(self, link: Any) -> None:
        """It is there. Its lock is kept from now on; the one of the name before is given back."""
        link.name = self.name
        before, own, self._error = self._lock, link.lock, None
        if own.held:
            self._lock, link.lock = own, own.lent()
            before.release()
        self._take(link)
        if own.held:
            self.moved(self.lock_name)

    def _look_later(self, error: BaseException) -> None:
        self._wait = min(2 * self._wait or FIRST, LONGEST)
        self._next = time.monotonic() + self._wait
        self._error = error
        if isinstance(error, AnotherAdapter) and self._lock.held:  # which may be opened by anybody
            self._lock.release()
            self.moved("")

    def _gone(self) -> LinkLost:
        error = self._error
        if isinstance(error, MotorbusError) and not isinstance(error, PortNotFound):
            summary = (
                error.summary if isinstance(error, LinkLost) else f"{self.name} is gone: {error.summary}"
            )
            advice = f"{error.advice or 'see to that'}; {AGAIN}"
            return LinkLost(summary, expected=error.expected, cause=error.cause, advice=advice)
        found = lost(self.name, error.summary if isinstance(error, PortNotFound) else error or "it went away")
        found.advice = f"see to the other end; {AGAIN}"
        return found


def _nobody(_: str) -> None:
    """Nobody needs to know by which name the port is locked."""


# -- how each kind of port is found again ------------------------------------------------------------------------------


def reconnecting(
    link: Link,
    *,
    rate: int = 0,
    usual: int = 0,
    kind: str = "bytes",
    options: Mapping[str, object] | None = None,
    lister: Lister | None = None,
    sysfs: Path = Path("/sys"),
) -> Link:
    """The same link, which is opened anew when it is lost; the other arguments are those it was opened with.

    A pseudo-terminal that was called by its own number is not: the next terminal gets that. Nor is what nobody owns.
    """
    lock: PortLock | None = getattr(link, "lock", None)
    if lock is None or not lock.held:
        return link
    ways = _Ways(link, rate, usual, kind, dict(options or {}))
    if not ways.device:
        return Reconnecting(link, ways.anywhere)
    real = os.path.realpath(ways.device)
    if real.startswith(PSEUDO_TERMINALS):
        linked = os.path.abspath(ways.device) != real
        return Reconnecting(link, ways.linked) if linked else link
    look = lister or _listed
    known = identity_of(real, look, sysfs)

    def adapter(rate: int, listen_only: bool, kept: PortLock) -> Link:
        there = found_again(link.name, known, look, sysfs)
        found = ways.open(ways.at(there), rate, listen_only, kept)
        if not known.is_same(now := identity_of(there, look, sysfs)):  # they changed places meanwhile
            found.close()
            raise another(link.name, known, str(now))
        return found

    return Reconnecting(link, adapter)


def _listed() -> list[Any]:
    """What the system tells; the library that asks it is imported when a port is opened."""
    from motorbus.link.serial import listed

    return list(listed())


class _Ways:
    """How a port was opened, and is again; `device` is the serial port of this machine, "" for any other."""

    def __init__(self, link: Any, rate: int, usual: int, kind: str, options: dict[str, object]) -> None:
        self.port: str = link.name
        self.device: str = link.device if kind == "frames" else "" if "://" in self.port else self.port
        self._at: Callable[[str], str] = link.port_at if kind == "frames" else str
        self._said, self._had = rate, link.rate
        self._usual, self._kind, self._options = usual, kind, options
        self._links = _links(self.device)

    def at(self, device: str) -> str:
        """The port, as an address says it, where its serial port has this name."""
        return self._at(device)

    def open(self, port: str, rate: int, listen_only: bool, kept: PortLock) -> Link:
        """Open it at this rate; a rate that nobody has said is left to whoever sets it."""
        options = self._options
        if self._kind == "frames":
            options = {**options, "listen_only": listen_only}
        return open_link(
            port,
            rate=self._said if rate == self._had else rate,
            usual=self._usual,
            kind=self._kind,
            options=options,
            kept=kept,
            patience=PATIENCE,
        )

    def anywhere(self, rate: int, listen_only: bool, kept: PortLock) -> Link:
        """A server, or a channel by its name."""
        knock(self.port)
        return self.open(self.port, rate, listen_only, kept)

    def linked(self, rate: int, listen_only: bool, kept: PortLock) -> Link:
        """A pseudo-terminal, wherever the link leads by now."""
        real = os.path.realpath(self.device)
        if not os.path.exists(real):
            raise PortNotFound(f"{self.device} leads nowhere")
        if not real.startswith(PSEUDO_TERMINALS):
            raise another(self.port, f"a pseudo-terminal, behind {self.device}", real)
        links = _links(self.device)
        if links == self._links:  # who was killed has left it behind, and its number is the next terminal's
            raise PortNotFound(f"{self.device} has not been made anew")
        found = self.open(self.port, rate, listen_only, kept)
        self._links = links
        return found


def _links(path: str) -> list[tuple[int, int]]:
    """The symbolic links that lead from there to a device, each by what changes when it is made anew."""
    found: list[tuple[int, int]] = []
    while path and os.path.islink(path) and len(found) < MOST_LINKS:
        about = os.lstat(path)
        found.append((about.st_ino, about.st_ctime_ns))
        path = os.path.join(os.path.dirname(path), os.readlink(path))
    return found


def knock(port: str) -> None:
    """Raise PortNotFound soon where a server does not answer: what opens its port would wait for long.

    A raw socket is not asked beforehand: it is opened as quickly.
    """
    where = port.removeprefix("can://slcan/")
    if port.startswith("can://socketcand/"):
        host, colon, number = port.removeprefix("can://socketcand/").partition("/")[0].partition(":")
        where = f"socket://{host}:{number if colon else SOCKETCAND_PORT}"
    elif where == port and not port.startswith("rfc2217://"):
        return
    try:
        socket.create_connection(split_address(where), timeout=PATIENCE).close()
    except OSError as error:
        raise PortNotFound(f"{port} cannot be reached: {error}") from error
