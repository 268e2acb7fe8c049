"""Others that a motion keeps time with, made up: how long they need, when they are ready, and where they give up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motorbus.bus.blocking import Bus
from motorbus.core.steps import Progress, Sleep
from motorbus.core.timing import Turned
from motorbus.errors import Interrupted, MotorbusError
from motorbus.families.stepper import Controller, driver
from motorbus.families.stepper.execution import Motion, Phase
from tests.families.stepper.loans import Cut, Line1


class Partner:
    """A `core.timing.Timing` whose others need so long (s), after having made one wait for `thinks` s each time.

    `fails` is where they call off: "agreed" or "start". What was said here is `shortest`, `fit`, `agreed_on`, `lead`
    and `moment` (s); `failures` are the errors that the others were told.
    """

    def __init__(self, needs: float = 0.0, *, thinks: float = 0.2, fails: str = "") -> None:
        self.needs, self.thinks, self._fails = needs, thinks, fails
        self.shortest = self.fit = self.agreed_on = self.lead = self.moment = 0.0
        self.asked: list[str] = []
        self.failures: list[BaseException] = []

    async def agreed(self, shortest: float, fitted: Callable[[float], float]) -> float:
        await self._thought("agreed")
        self.shortest, self.fit = shortest, fitted(max(self.needs, shortest))
        self.agreed_on = max(self.needs, self.fit)
        return self.agreed_on

    async def start(self, lead: float) -> float:
        self.lead = lead
        await self._thought("start")
        self.moment = await Sleep(0.05) + lead
        return self.moment

    def fails(self, error: BaseException) -> None:
        self.failures.append(error)

    async def _thought(self, where: str) -> None:
        self.asked.append(where)
        await Sleep(self.thinks)
        if self._fails == where:
            raise Interrupted("the others do not move", cause="made up")


class Kept:
    """One keep_time on a line, and what the motor really did: `motion`, begun at the moment `since` (s)."""

    def __init__(self, line: Line1, partner: Partner, cut: Cut | None = None, **how: Any) -> None:
        self.line, self.partner = line, partner
        self.motion: Motion | None = None
        self.since = 0.0
        line.react = self._look
        self.told: Turned | MotorbusError = line.run(lambda device: kept(device, partner, **how), cut)

    def _look(self, event: object, bus: Bus) -> None:
        state = self.line.simulated.state
        if isinstance(event, Progress) and event.what.startswith("moving") and state.phase is Phase.ONCE:
            self.motion, self.since = state.motion, state.since

    @property
    def turned(self) -> Turned:
        assert isinstance(self.told, Turned), self.told
        return self.told

    @property
    def first(self) -> float:
        """When its first pulse came (s)."""
        assert self.motion is not None
        return self.since + self.motion.moment(1)

    @property
    def last(self) -> float:
        """When its last pulse came (s)."""
        assert self.motion is not None
        return self.since + self.motion.duration


def kept(
    device: Controller,
    partner: Partner,
    angle: float = 3.0,
    velocity: float = 10.0,
    acceleration: float | None = None,
) -> Turned:
    """Carry it out on the bus of this device."""
    return device.bus.run(
        driver.keep_time(device, angle, partner, velocity=velocity, acceleration=acceleration)
    )
