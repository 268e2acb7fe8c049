"""What proves that something rests: it was seen at the same place several times, and long enough.

A device that has accepted a stop has heard it, and no more. So whoever says *stopped* has looked: three fresh readings
at least, over a tenth of a second at least, none of them elsewhere. A device that does not tell where it is cannot be
seen to rest, and of it nobody says so.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.core.family import Quality
from motorbus.core.steps import Runnable, Sleep, catch
from motorbus.errors import MotorbusError
from motorbus.motion.capabilities import stop
from motorbus.motion.moving.forgiving import LOST
from motorbus.motion.safety.track import Sample, Track

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

READS: Final = 3
"""Readings in a row that must be at one place."""
SPAN: Final = 0.1
"""s that these must cover; what creeps slower than that is seen as rest is below 0.06 rad/s."""
STILL: Final = 0.006
"""rad of the device within which they must be: a reading at rest may change by a count, and the coarsest has 0.005."""
PAUSE: Final = 0.02
"""s between two looks."""
PATIENCE: Final = 1.0
"""s for which it is looked at, when nobody says how long."""


class Rest(Enum):
    """What is known of whether it moves."""

    STOPPED = "seen at rest: several fresh readings at one place"
    MOVING = "seen elsewhere from one reading to the next, until nobody looked any more"
    UNSEEN = "nobody has seen it rest: it does not tell where it is, or did not answer"


class Stopped(NamedTuple):
    """What a stop came to: what the device promised, what was seen, and where it was last (rad, m; None: not seen)."""

    promise: Enum
    rest: Rest
    position: float | None = None

    def __str__(self) -> str:
        return f"{self.rest.value}; {self.promise.value}"


class Standstill:
    """Judges, reading by reading, whether something rests."""

    def __init__(self, still: float = STILL, span: float = SPAN, reads: int = READS) -> None:
        self._still: Final = still
        self._span: Final = span
        self._reads: Final = reads
        self._seen: list[Sample] = []
        self._moved = False

    def take(self, sample: Sample) -> bool:
        """Take a reading (rad of the device); whether it is proven that it rests.

        One that cannot be believed, or is no new one, proves nothing, and what cannot be believed takes back what was
        seen before it.
        """
        if sample.quality is Quality.SUSPECT:
            self.lost()
        elif sample.quality is not Quality.REPEATED and (not self._seen or sample.at > self._seen[-1].at):
            kept = [one for one in self._seen if abs(one.value - sample.value) <= self._still]
            if len(kept) < len(self._seen):
                self._moved, kept = True, []
            self._seen = [*kept, sample]
        return self.rests

    def lost(self) -> None:
        """A reading was asked for and did not come: what was seen before it may be no longer so."""
        self._seen = []

    @property
    def rests(self) -> bool:
        """Whether it is proven."""
        return len(self._seen) >= self._reads and self._seen[-1].at - self._seen[0].at >= self._span * (
            1 - 1e-9
        )

    @property
    def rest(self) -> Rest:
        """What is known by now."""
        if self.rests:
            return Rest.STOPPED
        return Rest.MOVING if self._moved and self._seen else Rest.UNSEEN


async def stopped(axis: AxisVerbs, *, patience: float = PATIENCE) -> Stopped:
    """Decelerate and stay, then look whether it rests, for at most `patience` s; gives what was promised and seen.

    Raises as `stop` when the device did not accept it; that it was not seen to rest is no error: see `Stopped.rest`.
    """
    promise: Enum = await stop(axis)
    return await seen(axis, promise, patience)


async def seen(axis: AxisVerbs, promise: Enum, patience: float = PATIENCE) -> Stopped:
    """Look at an axis that was stopped, until it is seen to rest or for `patience` s; its silence is no error."""
    if "position" not in axis.able:
        return Stopped(promise, Rest.UNSEEN)
    rest, place = await watched(lambda: axis.able.position(axis.device), patience)
    return Stopped(promise, rest, None if place is None else axis.spec.from_device(place))


async def watched(
    ask: Callable[[], Runnable[float]], patience: float = PATIENCE
) -> tuple[Rest, float | None]:
    """Ask a device where it is (rad) until it is seen to rest, for at most `patience` s; what was seen, and where last.

    It is asked three times at least, whatever the patience. Its silence is no error.
    """
    judge, track = Standstill(), Track()
    begun = await Sleep(0)
    asked = 0
    while True:
        told = await catch(ask())
        now = await Sleep(0)
        asked += 1
        if isinstance(told, LOST):
            judge.lost()
        elif isinstance(told, MotorbusError):
            raise told
        elif judge.take(track.take(told, now)):
            break
        if now - begun >= patience and asked >= READS:
            break
        await Sleep(PAUSE)
    sample = track.sample
    return judge.rest, None if sample is None else sample.value
