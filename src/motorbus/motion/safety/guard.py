"""What bounds one device beyond its own limits: how far, how quickly, and in what steps from where it is.

A guard knows angles of the device and nothing of axes. Whoever sets it has made it of something that people wrote down.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, Final, NamedTuple

from motorbus.core.request import Response
from motorbus.core.setpoint import Setpoint, Stays
from motorbus.core.steps import Runnable
from motorbus.errors import LimitExceeded, Refused
from motorbus.motion.safety.track import FRESH, Track

ROUNDED: Final = 0.003
"""rad by which a goal may be beyond: it was rounded to a count, and half of the coarsest one is 0.0026."""
NOISE: Final = 1e-9
"""rad that are noise of binary arithmetic."""
UNIT: Final = 0.08
"""rad/s by which a speed may be beyond: it was rounded up to the next unit, 0.732 RPM at the coarsest."""
LATE: Final = 0.8
"""s of its greatest speed that an order without a speed may lead from where a device is measured to be.

So far goals are ahead where a device is led. It may be behind by 0.3 s (`moving.lagging.LAG`), its last reading was
taken one period ago, and the goal is for one period from now: 0.25 s each where goals are slowest
(`motion.limits.SLOWEST`).
"""
NEAR: Final = 0.1
"""rad that it may lead besides, whatever its speed: how far one that is led may be off (`moving.lagging.FAR`)."""

PLACES: Final = ("position", "relative")
"""Quantities that lead to a place."""
ENDLESS: Final = ("velocity", "load", "current")
"""Quantities that go on being obeyed until something else is ordered."""


def _unknown() -> float | None:
    """Where a device is of which nobody keeps account."""
    return None


def _nobody() -> None:
    """What it means for an account that nobody keeps."""


def untold(_: bool) -> None:
    """Nobody wants to know what it was ordered."""


class Bounds(NamedTuple):
    """`low` and `high` position (rad of the device), the farthest `step` from where it is measured to be (rad) and the
    greatest `speed` (rad/s); infinite where nobody bounds it.

    What brings no speed is obeyed as fast as the device can. So it leads no farther than `lead` (rad) from where it is
    measured to be: that is where goals are for one that is led at its greatest speed.
    """

    low: float = -inf
    high: float = inf
    step: float = inf
    speed: float = inf

    @property
    def lead(self) -> float:
        """How far (rad) an order may lead that brings no speed."""
        return self.speed * LATE + NEAR


class Guard:
    """The bounds of one device that people call `name`, and where it was seen.

    `ask` reads its position, so that a bus can look before it gives an order; `show` words an angle of the device;
    `answer` is the last one of the bus that was taken in here.
    `track` is None where the device does not tell where it is. Then `reckons` gives where it is by dead reckoning (rad
    of the device; None: nobody knows), and `leaves` is called when it was ordered to move, whoever did that. `ordered`
    is called of each device when it was ordered to move (true) or only given torque, whoever did that.
    """

    def __init__(
        self,
        name: str,
        bounds: Bounds,
        *,
        measures: bool = True,
        ask: Callable[[], Runnable[Any]] | None = None,
        reckons: Callable[[], float | None] = _unknown,
        leaves: Callable[[], None] = _nobody,
        ordered: Callable[[bool], None] = untold,
        show: Callable[[float], str] = "{:.4g} rad".format,
    ) -> None:
        self.name: Final = name
        self.bounds: Final = bounds
        self.ask: Final = ask
        self.leaves: Final = leaves
        self.ordered: Final = ordered
        self.show: Final = show
        self._reckons: Final = reckons
        self.track: Final = Track() if measures else None
        self.answer: Response | None = None
        self._due: float | None = None  # where the ways that it was told lead, while no stop has ended them
        self._low: Final = bounds.low - ROUNDED
        self._high: Final = bounds.high + ROUNDED
        self._step: Final = bounds.step + ROUNDED
        self._lead: Final = bounds.lead + ROUNDED
        self._near: Final = min(self._step, self._lead)

    def is_fine(self, to: float, now: float) -> bool:
        """Whether this place is surely allowed: the quick way of most goals; what is not is looked at more closely."""
        track = self.track
        if track is None or track.suspect is not None:
            return False
        sample = track.sample
        return (
            sample is not None
            and now - sample.at <= FRESH
            and self._low <= to <= self._high
            and abs(to - sample.value) <= self._near
        )

    @property
    def reach(self) -> tuple[float, float, float]:
        """By what `is_fine` goes: the least and the greatest place (rad), and how far that may be from where it is."""
        return self._low, self._high, self._near

    def check_known(self, node: int, now: float) -> None:
        """Raise Refused unless it is known where the device is, by a reading that is fresh and can be believed."""
        if self.track is None or not (why := self.track.why_not(now)):
            return
        raise Refused(
            f"{self.name}: {self._told(why, now)}, so it must not be moved", node=node, **_EXPECTED[why]
        )

    def check_goal(self, goal: Setpoint, *, paced: bool = False) -> None:
        """Raise LimitExceeded for a position, or a way, that leads out of the bounds or is too far for one step.

        Where nothing that comes with it bounds its speed it is not `paced`, and leads no farther than `Bounds.lead`.
        """
        low, high, step, _ = self.bounds
        here = self._here()
        relative = goal.quantity == "relative"
        to = goal.value if not relative else None if here is None else here + goal.value
        for place in (to, self._from(here) + goal.value if relative and here is not None else None):
            if place is not None and not self._allows(place, here):
                raise self._refused(
                    goal, f"{self.show(place)} is outside {self._range()}", f"stay inside {self._range()}"
                )
        if to is None and abs(goal.value) > high - low + ROUNDED:
            raise self._refused(goal, "this way is more than all of its way", "go less far")
        way = abs(goal.value) if relative else 0.0 if here is None else abs(goal.value - here)
        if way > self._step:
            raise self._refused(
                goal,
                f"this is {way:.4g} rad of its device from where it is, and one command may be {step:.4g} rad",
                "go there in smaller steps, or by a move of the axis",
                "step",
            )
        if way > self._lead and not paced:
            raise self._unpaced(goal, way)

    def told(self, goal: Setpoint) -> None:
        """It was ordered this: whoever has set the guard is to know. What only bounds a movement moves nothing."""
        stays = goal.stays is not None
        if goal.quantity == "relative" or stays:
            self.adds(goal.value, ends=stays)
        if goal.stays is Stays.ON:
            self.ordered(False)
        elif not stays and (goal.quantity in PLACES or (goal.quantity in ENDLESS and goal.value)):
            self.ordered(True)

    def adds(self, way: float, *, ends: bool = False) -> None:
        """It was told to go so much farther (rad), perhaps while an earlier way was not at its end; or that is over."""
        here = None if self.track is None else self._here()
        self._due = None if ends or here is None else self._from(here) + way

    def forget(self) -> None:
        """It may be anywhere, and nobody knows what it is about to do."""
        self._due = None
        if self.track is not None:
            self.track.forget()

    def _from(self, here: float) -> float:
        """Where a way begins that it is told now, while it is here: at the end of the last one until it is there."""
        return here if self._due is None or abs(self._due - here) < NEAR else self._due

    def _here(self) -> float | None:
        """Where it is, as far as that is known (rad of the device)."""
        if self.track is None:
            return self._reckons()
        sample = self.track.sample
        return None if sample is None else sample.value

    def _allows(self, to: float, here: float | None) -> bool:
        """Whether this place is within the bounds, or no farther out than it stands: it may always come back.

        Where it stands gets no allowance for rounding, or it could be led out bit by bit.
        """
        low, high = self._low, self._high
        if here is not None:
            low, high = min(low, here - NOISE), max(high, here + NOISE)
        return low <= to <= high

    def check_speed(self, goal: Setpoint) -> None:
        """Raise LimitExceeded for a velocity, or a bound of it, that is above the bound."""
        if abs(goal.value) > self.bounds.speed + UNIT:
            raise self._refused(
                goal,
                f"{abs(goal.value):.4g} rad/s of its device is above {self.bounds.speed:.4g} rad/s",
                "be slower; where none was said, say a velocity",
            )

    def _unpaced(self, goal: Setpoint, way: float) -> LimitExceeded:
        lead, speed = self.bounds.lead, self.bounds.speed
        return self._refused(
            goal,
            f"this is {way:.4g} rad of its device from where it is, and comes without a velocity, so its device would "
            f"go there as fast as it can; so ordered it may go {lead:.4g} rad, for it may do {speed:.4g} rad/s",
            "say a velocity with it, where its device takes one, or move the axis: it is led there",
            "velocity",
        )

    def _told(self, why: str, now: float) -> str:
        if why == "unseen":
            return "nobody has read where it is"
        assert self.track is not None
        if why == "suspect":
            assert self.track.suspect is not None
            return f"it was read at {self.show(self.track.suspect.value)}, where no motor can have come so quickly"
        assert self.track.sample is not None
        return f"where it is was read {self.track.sample.age(now):.3g} s ago"

    def _range(self) -> str:
        return f"{self.show(self.bounds.low)} to {self.show(self.bounds.high)}"

    def _refused(self, goal: Setpoint, why: str, advice: str, reason: str = "limits") -> LimitExceeded:
        return LimitExceeded(
            f"{self.name}: {why}", reason=reason, advice=f"{advice}; nothing was sent", node=goal.node
        )


_READ: Final = "read its position, then order it again; nothing was sent"
_EXPECTED: Final[dict[str, dict[str, str]]] = {
    "unseen": {"reason": "stale", "advice": _READ},
    "stale": {"reason": "stale", "expected": "a reading that is fresh", "advice": _READ},
    "suspect": {
        "reason": "suspect",
        "expected": "a second reading that agrees",
        "cause": "a fault on the line, a servo that lost its supply and counts anew, or a gear that slipped",
        "advice": _READ,
    },
}
"""By what is wrong with what is known of its position, the parts of the refusal."""
