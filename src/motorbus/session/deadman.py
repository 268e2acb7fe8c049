"""Dead-man: a machine is stopped when the program that attends it falls silent.

    with robot.attended():                       # this program attends for the duration of the block
        robot["lift"].home()

    with robot.attended(lasts=0.5) as hand:      # and calls `beat` at least every 0.5 s
        hand.beat()

Endless motion, which only a stop ends, is refused outside such a block and is stopped at its end. When the lease is
lost, a `Watchdog` stops what moves: in threads, also while the program sleeps or its event loop hangs; in virtual
time as a background task of the bus. It needs this process: if the process is killed or frozen, nothing is stopped.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Final, Self

from motorbus.core.steps import Sleep, catch
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.body import Body
from motorbus.motion.leaving import goes_on, stopped_going_on
from motorbus.motion.parallel import Parallel
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.lease import Lease, Standing, check_lasts
from motorbus.motion.several import errors_of, gathered
from motorbus.session.watchdog import Watchdog

WHO: Final = "this program"
POLL_PERIOD: Final = 0.02
"""s between two checks whether the watchdog has stopped everything that moved."""


class Leased(Body):
    """A machine with a lease, or without one; without one the program may move it at any time."""

    _lease: Lease | None = None
    _watchdog: Watchdog | None = None

    @property
    def lease(self) -> Lease | None:
        """The right to move the machine; None: not needed. A program that moves it for another one sets a lease.

        Its time is `now`, the clock of the robot. When it is lost, what moves is stopped, and nothing moves until
        `robot.lease.reset(robot.now)`.
        """
        return self._lease

    @lease.setter
    def lease(self, lease: Lease | None) -> None:
        self._put(lease)
        if lease is None and any(map(goes_on, self.axes.values())):
            lease = Lease(None, needed=False)  # its watchdog stops the endless motion
        if lease is not None and self.buses:
            self._watchdog = Watchdog(self, lease)
            self._watchdog.start()

    def _put(self, lease: Lease | None) -> None:
        if self._watchdog is not None:
            self._watchdog.end()
        self._lease, self._watchdog = lease, None
        for bus in self.buses.values():
            if isinstance(bus.interlock, Gate):
                bus.interlock.lease = lease

    def _lay_down(self) -> None:
        """Remove the lease before the machine is left, unless it is lost: then nothing parks."""
        if self._lease is not None and self._lease.standing(self.now) is not Standing.LOST:
            self._put(None)

    def _retire(self) -> None:
        """End the watchdog before the ports are closed."""
        if self._watchdog is not None:
            self._watchdog.end()


class Attending:
    """The common part of `Attended` and `AsyncAttended`."""

    def __init__(self, robot: Any, lasts: float | None, who: str) -> None:
        check_lasts(lasts)
        self._robot = robot
        self._lasts = lasts
        self._who = self._holder = who
        self._own = False

    def beat(self) -> None:
        """Renew the lease, from any thread. Raises Refused when it is lost. No effect on a lease without time."""
        self._lease.beat(self._holder, self._robot.now)

    @property
    def _lease(self) -> Lease:
        lease: Lease | None = self._robot.lease
        if lease is None:
            raise RequestError("the machine is not attended", expected="inside the `with` of attended()")
        return lease

    def _take(self) -> None:
        robot, lasts = self._robot, self._lasts
        robot._refuse_shut()
        lease = robot.lease
        if lease is None or not (lease.needed or lease.standing(robot.now) is not Standing.FREE):
            lease, self._own = Lease(lasts, needed=False), True
        elif lasts not in (None, lease.lasts):
            raise RequestError(
                f"the lease of this machine lasts {lease.lasts} s",
                expected="attended() without a time of its own",
                advice="nothing was sent",
            )
        self._holder = self._who if lease.holder != self._who else f"{self._who}, once more"
        lease.take(self._holder, robot.now, attended=True)
        if self._own:
            robot.lease = lease

    def _ending(self) -> Parallel[dict[str, MotorbusError]]:
        """Stop endless motion; if the lease is lost, wait until the watchdog has stopped all axes that move."""
        parts = self._robot.by_bus(self._robot.axes)

        async def on(bus: str) -> dict[str, MotorbusError]:
            watchdog = self._robot._watchdog
            while watchdog is not None and watchdog.busy(bus):
                await catch(Sleep(POLL_PERIOD))
            return await stopped_going_on(parts[bus])

        def combine(results: Mapping[str, Any]) -> dict[str, MotorbusError]:
            found = {
                name: one for part in results.values() if isinstance(part, dict) for name, one in part.items()
            }
            return {**errors_of(results), **found}

        return Parallel({bus: on(bus) for bus in parts}, combine)

    def _given_back(self, errors: dict[str, MotorbusError], error: BaseException | None) -> None:
        """Release the lease, if it is not lost. Raise the errors, or add them as notes to `error`."""
        robot, lease = self._robot, self._robot.lease
        wrong: MotorbusError | None = gathered(errors) if errors else None
        if lease is not None and (loss := lease.loss(robot.now)) is not None:
            for name, one in {**errors, **(robot._watchdog.errors if robot._watchdog else {})}.items():
                loss.add_note(f"{name} did not accept the stop: {one.summary}")
            wrong = loss
        elif lease is not None and lease.holder == self._holder:
            lease.release(self._holder, robot.now)
            if self._own:
                robot.lease = None
        if wrong is not None and error is None:
            raise wrong
        if wrong is not None and error is not None:
            for text in (wrong.summary, *getattr(wrong, "__notes__", ())):
                if text not in str(error):
                    error.add_note(text)


class Attended(Attending):
    """The block of `Robot.attended`."""

    def __enter__(self) -> Self:
        self._take()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            errors = self._robot.conductor.run(self._ending())
        except BaseException as interruption:
            self._given_back({}, error or interruption)
            raise
        self._given_back(errors, error)


class AsyncAttended(Attending):
    """The block of `AsyncRobot.attended`."""

    async def __aenter__(self) -> Self:
        self._take()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            errors = await self._robot.conductor.run(self._ending())
        except BaseException as interruption:
            self._given_back({}, error or interruption)
            raise
        self._given_back(errors, error)


def blocking_attended(robot: Any, lasts: float | None = None, *, who: str = WHO) -> Attended:
    """Attend the machine during a `with` block: endless motion is allowed, and is stopped at the end of the block.

    With `lasts` (s) the block must call `beat()` at least so often. Otherwise the lease is lost: what moves is stopped,
    the method that runs, or the end of the block, raises Refused with the reason "lease", and nothing moves until
    `robot.lease.reset(robot.now)`. `who` is named in messages.

    Raises RequestError for an invalid time; on entry Refused when another holder has the lease or it is lost, and
    RequestError for a time other than that of a lease that was set.
    """
    return Attended(robot, lasts, who)


def awaiting_attended(robot: Any, lasts: float | None = None, *, who: str = WHO) -> AsyncAttended:
    """The same for an `async with`; see `blocking_attended`. `beat()` is a plain call here, too."""
    return AsyncAttended(robot, lasts, who)
