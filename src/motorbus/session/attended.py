"""Who attends a machine, and what becomes of it when he falls silent.

    with robot.attended():                       # as long as the block lasts: this program attends
        robot["lift"].home()

    with robot.attended(lasts=0.5) as hand:      # who attends says so, at least every half a second
        hand.beat()

Endless motion, which only its stop ends, is refused unless somebody attends, and does not outlive that. A lease that is
lost stops what moves, whatever the program does then: a `Sentry` sees to it, in threads of its own while the program
sleeps or its event loop hangs, and where time is virtual along with whoever lets it pass. It needs this process. One
that is killed, or frozen for good, stops nothing, and what turns without an end goes on turning.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Final, Self

from motorbus.core.steps import Sleep, catch
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.abreast import Abreast
from motorbus.motion.body import Body
from motorbus.motion.leaving import goes_on, stopped_going_on
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.lease import Lease, Standing, check_lasts
from motorbus.motion.several import errors_of, gathered
from motorbus.session.sentry import Sentry

WHO: Final = "this program"
LOOK: Final = 0.02
"""s between two looks at whether all that moved has been told to stop."""


class Leased(Body):
    """A machine with a lease, or without one: then the program that has opened it moves it as it likes."""

    _lease: Lease | None = None
    _sentry: Sentry | None = None

    @property
    def lease(self) -> Lease | None:
        """Who may move it, None while there is no such rule. A program that moves it for somebody else sets one.

        Its time is `now`, the clock of the robot. When it is lost, what moves is stopped by itself, and nothing moves
        until `robot.lease.reset(robot.now)`.
        """
        return self._lease

    @lease.setter
    def lease(self, lease: Lease | None) -> None:
        self._put(lease)
        if lease is None and any(map(goes_on, self.axes.values())):
            lease = Lease(None, needed=False)  # it ends, for nobody attends it any more
        if lease is not None and self.buses:
            self._sentry = Sentry(self, lease)
            self._sentry.start()

    def _put(self, lease: Lease | None) -> None:
        if self._sentry is not None:
            self._sentry.end()
        self._lease, self._sentry = lease, None
        for bus in self.buses.values():
            if isinstance(bus.interlock, Gate):
                bus.interlock.lease = lease

    def _lay_down(self) -> None:
        """The machine is left: only a lease that was lost keeps it from parking."""
        if self._lease is not None and self._lease.standing(self.now) is not Standing.LOST:
            self._put(None)

    def _retire(self) -> None:
        """Its ports are about to be closed: nobody watches the lease any more."""
        if self._sentry is not None:
            self._sentry.end()


class Attending:
    """What a blocking and an async block that attends have in common."""

    def __init__(self, robot: Any, lasts: float | None, who: str) -> None:
        check_lasts(lasts)
        self._robot = robot
        self._lasts = lasts
        self._who = self._holder = who
        self._own = False

    def beat(self) -> None:
        """Whoever attends is still there. From any thread. Raises Refused when that comes too late: the lease is lost.

        On a machine whose lease does not run out it changes nothing.
        """
        self._lease.beat(self._holder, self._robot.now)

    @property
    def _lease(self) -> Lease:
        lease: Lease | None = self._robot.lease
        if lease is None:
            raise RequestError("nobody attends", expected="inside the `with` of attended()")
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

    def _ending(self) -> Abreast[dict[str, MotorbusError]]:
        """What goes on without an end is told to stop; where the lease is lost, until all that moves was told so."""
        parts = self._robot.by_bus(self._robot.axes)

        async def on(bus: str) -> dict[str, MotorbusError]:
            sentry = self._robot._sentry
            while sentry is not None and sentry.busy(bus):
                await catch(Sleep(LOOK))
            return await stopped_going_on(parts[bus])

        def combine(results: Mapping[str, Any]) -> dict[str, MotorbusError]:
            found = {
                name: one for told in results.values() if isinstance(told, dict) for name, one in told.items()
            }
            return {**errors_of(results), **found}

        return Abreast({bus: on(bus) for bus in parts}, combine)

    def _given_back(self, errors: dict[str, MotorbusError], error: BaseException | None) -> None:
        """Raise what is wrong, or note it to what is being raised; a lease that was lost stays so until its reset."""
        robot, lease = self._robot, self._robot.lease
        wrong: MotorbusError | None = gathered(errors) if errors else None
        if lease is not None and (loss := lease.loss(robot.now)) is not None:
            for name, one in {**errors, **(robot._sentry.errors if robot._sentry else {})}.items():
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
    """A block that attends, of a `Robot`; made by `Robot.attended`."""

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
    """A block that attends, of an `AsyncRobot`; made by `AsyncRobot.attended`."""

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
    """Attend the machine for as long as a `with` lasts, so that endless motion is allowed; it is stopped at its end.

    With `lasts` (s) only while `beat()` of what this gives comes at least so often. When it does not, the lease is
    lost: what moves is stopped, the verb that is at work raises Refused with the reason "lease", or the end of the
    `with` does, and nothing moves until `robot.lease.reset(robot.now)`. `who` is named in messages.

    Raises RequestError for a time that is none, at once; on entering Refused when somebody else holds the lease or it
    is lost, and RequestError for another time than that of a lease that was set.
    """
    return Attended(robot, lasts, who)


def awaiting_attended(robot: Any, lasts: float | None = None, *, who: str = WHO) -> AsyncAttended:
    """The same for an `async with`; see `blocking_attended`. `beat()` is a plain call here, too."""
    return AsyncAttended(robot, lasts, who)
