"""A simulated bus on a CAN channel of python-can: `can://virtual/NAME` in this process, `can://socketcan/vcan0` …

So a program that has its own python-can bus, in this process or on this machine, meets simulated devices there
without any port of ours. The devices take part through the same link by which a host would reach real ones.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, LinkLost, RequestError
from motorbus.link.base import Line, Link
from motorbus.simulation.clients import Participant
from motorbus.simulation.faults.struck import on_a_wire
from motorbus.simulation.mount import Mount

if TYPE_CHECKING:
    from motorbus.core.family import Simulator

_CAN: Final = "can://"
_LOOK: Final = 0.1
"""s after which whoever waits for the loop looks whether it still runs."""


class LinkClient(Participant):
    """A whole CAN bus behind a link: everyone there hears the devices, and they hear everyone."""

    shared = True

    def __init__(self, link: Link) -> None:
        self.link = link
        self.real = "" if getattr(link, "no_wire", False) else link.name

    def fileno(self) -> int | None:
        return self.link.fileno()

    def read(self, at: float, patience: float = 0.0) -> list[Data]:
        return self.link.read(self.link.now() + patience)

    def tell(self, data: Data, at: float) -> None:
        if isinstance(data, CanFrame) and data.id & ERROR_FLAG:
            return  # that adapter finds its own errors
        try:
            self.link.write(data)
        except LinkLost:
            raise
        except LinkError:
            self.lost += 1

    def close(self) -> None:
        self.link.close()


def join(port: str, rate: int = 0, default_rate: int = 0, **options: object) -> LinkClient:
    """Take part in a CAN bus as its devices. Raises what opening such a port raises.

    `rate` is in bit/s from the user, 0 when not given, and `default_rate` that of the devices; `options` are for the
    adapter.
    """
    if not port.startswith(_CAN):
        raise RequestError(f"{port!r} is no CAN channel", expected="can://INTERFACE/CHANNEL")
    from motorbus.link.url import open_can

    return LinkClient(open_can(port, rate=rate, default_rate=default_rate, options=options, shared=True))


def check_harmless(port: str) -> None:
    """Raises RequestError for a channel that may have real devices, so that no faults may be there; opens nothing."""
    if port.startswith(_CAN):
        from motorbus.link.can import read_address

        if not read_address(port).no_wire:
            raise on_a_wire(port)


class Served:
    """A simulated bus at work on a CAN channel, by a thread of its own, until `close`; use it in a `with`.

    `pace` bit/s at which frames take their time, None at once; `rate` bit/s of the bus; `start` what the devices'
    clock shows at first (s), None for the machine's own. What goes wrong in the thread is raised when it is left.
    """

    def __init__(
        self,
        simulator: Simulator,
        client: LinkClient,
        *,
        line: Line | None = None,
        pace: int | None = None,
        rate: int | None = None,
        start: float | None = None,
    ) -> None:
        self._offset = 0.0 if start is None else start - time.monotonic()
        self._client = client
        self._orders = _Orders()
        self._mount = Mount(
            simulator, client, line=line, pace=pace, rate=rate, clock=self.now, attendants=(self._orders,)
        )
        self._stop, self._ring = os.pipe()
        self._error: BaseException | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="motorbus-simulation", daemon=True)
        self._thread.start()

    def now(self) -> float:
        """The moment (s) on the devices' clock."""
        return time.monotonic() + self._offset

    @property
    def simulator(self) -> Simulator:
        """The devices; another one may take their place while it is `still`."""
        return self._mount.simulator

    @simulator.setter
    def simulator(self, simulator: Simulator) -> None:
        self._mount.simulator = self._mount.course.simulator = simulator

    @property
    def line(self) -> Line:
        """What lies between hosts and devices; set it to do harm, at any time, where no device can be real."""
        return self._mount.line

    @line.setter
    def line(self, line: Line) -> None:
        self._mount.line = line

    @property
    def real(self) -> str:
        """Its bus when there may be real devices on it, and so no harm may be done; else ""."""
        return self._mount.real

    @contextmanager
    def still(self) -> Iterator[None]:
        """Nothing happens on the bus meanwhile, so that this thread may poke the devices."""
        self._orders.halt(self._thread)
        try:
            yield
        finally:
            self._orders.resume()

    def close(self) -> None:
        """Leave the bus; calling it again does nothing. Raises what has gone wrong in the thread."""
        if self._closed:
            return
        self._closed = True
        os.write(self._ring, b".")
        self._thread.join()
        self._client.close()
        self._orders.close()
        os.close(self._stop)
        os.close(self._ring)
        if self._error is not None:
            raise self._error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _work(self) -> None:
        try:
            self._mount.serve(self._stop)
        except BaseException as error:
            self._error = error


class _Orders:
    """What lets another thread hold up the loop: it says so on a pipe, and the loop waits until it may go on."""

    def __init__(self) -> None:
        self._read, self._write = os.pipe()
        self._halted = threading.Event()
        self._resumed = threading.Event()

    def descriptors(self) -> list[int]:
        return [self._read]

    def stuck(self) -> list[int]:
        return []

    def attend(self, descriptor: int) -> None:
        os.read(self._read, 1)
        self._halted.set()
        self._resumed.wait()

    def halt(self, thread: threading.Thread) -> None:
        """Returns when the loop, which this thread runs, stands still."""
        self._halted.clear()
        self._resumed.clear()
        os.write(self._write, b".")
        while thread.is_alive() and not self._halted.wait(_LOOK):
            pass

    def resume(self) -> None:
        self._resumed.set()

    def close(self) -> None:
        os.close(self._read)
        os.close(self._write)
