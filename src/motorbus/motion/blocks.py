"""Blocks of a robot for `with` (of an `AsyncRobot` for `async with`): a control loop, and an attended time."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from math import inf
from threading import Event, Thread
from typing import Any, Final, Self

from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import run_on
from motorbus.core.steps import Procedure
from motorbus.errors import RequestError
from motorbus.motion.gate import Lease, lease_lost
from motorbus.motion.loop import ControlLoop, LoopState
from motorbus.motion.moves import StopsIfInterrupted, stop_axes
from motorbus.motion.program import Program, drive, drive_async, raise_first
from motorbus.motion.shutdown import stop_bus
from motorbus.motion.state import OpenMachine

LOG = logging.getLogger("motorbus.motion")
RETRY: Final = 0.5  # s after which the stop is sent again to axes that did not accept it
LOOK: Final = 0.05  # s between two looks at the lease


class _Block:
    def __init__(self, loop: ControlLoop) -> None:
        self._loop = loop
        self.set_target = loop.set_target
        self.statistics = loop.statistics

    async def _finish(self, error: BaseException | None) -> None:
        guard = StopsIfInterrupted(self._loop.members)
        if error is None:
            async with guard:
                await self._loop.leave(None)
        else:
            self._loop.close()
            await guard.leave(error)


class Loop(_Block):
    """A control loop; iterate to run its cycles. It brakes at the end; after an error it stops its axes."""

    def read(self) -> Mapping[str, float]:
        """Read all positions (rad, m) now, by name."""
        return drive(self._loop.read())

    def write(self, targets: Mapping[str, float], elapsed: float) -> Mapping[str, float]:
        """Send targets now, `elapsed` s after the last ones; gives what was sent, by name."""
        return drive(self._loop.write(targets, elapsed))

    def __iter__(self) -> Iterator[LoopState]:
        while True:
            yield drive(self._loop.cycle())

    def __enter__(self) -> Self:
        drive(self._loop.enter())
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        drive(self._finish(error))


class AsyncLoop(_Block):
    """As `Loop`, for `async with` and `async for`."""

    async def read(self) -> Mapping[str, float]:
        """Read all positions (rad, m) now, by name."""
        return await drive_async(self._loop.read())

    async def write(self, targets: Mapping[str, float], elapsed: float) -> Mapping[str, float]:
        """Send targets now, `elapsed` s after the last ones; gives what was sent, by name."""
        return await drive_async(self._loop.write(targets, elapsed))

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> LoopState:
        return await drive_async(self._loop.cycle())

    async def __aenter__(self) -> Self:
        await drive_async(self._loop.enter())
        return self

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        await drive_async(self._finish(error))


Stop = Callable[[BaseBus], Procedure[bool]]
"""Stops what moves on a bus; False where an axis did not accept it."""


class LeaseWatch:
    """Stops what moves on these buses when the lease is lost, again every 0.5 s until each axis has accepted it.

    A thread does that, so a program that hangs is stopped. In virtual time, which passes only while the program waits,
    nothing does: there the gate refuses the next goal, and the movement ends by that.
    """

    def __init__(self, lease: Lease, buses: Iterable[BaseBus], stop: Stop) -> None:
        self._lease = lease
        self._buses = tuple(buses)
        self._stop = stop
        self._ended = Event()

    def start(self) -> None:
        """Begin to watch."""
        if self._lease.seconds < inf and not any(bus.link.virtual for bus in self._buses):
            Thread(target=self._watch, name="motorbus lease", daemon=True).start()

    def end(self) -> None:
        """Stop watching."""
        self._ended.set()

    def _watch(self) -> None:
        going = set(self._buses)
        while not self._ended.wait(LOOK):
            if not self._lease.lost:
                going = set(self._buses)
                continue
            with suppress(Exception):  # a bus that is gone: again after a pause
                accepted = run_on({bus: self._stop(bus) for bus in going})
                going -= {bus for bus, value in accepted.items() if value is True}
            if going:
                LOG.warning("the lease is lost, and not every axis has accepted the stop")
                self._ended.wait(RETRY)


class Attendance:
    """Attends a machine inside a block, see `robot.attended`."""

    def __init__(self, machine: OpenMachine, seconds: float, run: Callable[[Program[Any]], Any]) -> None:
        self._machine = machine
        self._run = run
        self._seconds = seconds

    def __enter__(self) -> Lease:
        machine = self._machine
        if machine.lease is not None and not machine.lease.lost:
            raise RequestError("the machine has a lease already", advice="use one `attended()` at a time")
        self._lease = machine.lease = Lease(machine.now, self._seconds)
        self._watch = LeaseWatch(self._lease, machine.buses.values(), self._stop)
        self._watch.start()
        return self._lease

    def _stop(self, bus: BaseBus) -> Program[bool]:
        return stop_bus([axis for axis in self._machine.axes.values() if axis.bus is bus])

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._run(self._end(error))

    async def __aenter__(self) -> Lease:
        return self.__enter__()

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        await self._run(self._end(error))

    async def _end(self, error: BaseException | None) -> None:
        lost = self._lease.lost
        self._watch.end()
        self._machine.lease = None
        results = await stop_axes([axis for axis in self._machine.axes.values() if axis.status.endless])
        if error is None and lost:
            raise lease_lost("the machine")
        if error is None:
            raise_first(results)
