"""Which readings of a position can be believed, and for how long.

A reading with a good checksum can be wrong all the same: an additive sum of eight bits lets some faults through, a
servo that lost its supply counts its turns anew, a gear slips. What no motor can have done in that time is *suspect*,
and another reading must agree with it before it counts. A position grows old, too: who has asked a while ago knows no
longer where the device is, and asks again before he moves it.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Final, NamedTuple

from motorbus.core.family import Quality
from motorbus.core.steps import Runnable, Sleep
from motorbus.errors import WireError

FASTEST: Final = 20.0
"""rad/s, when nobody says how fast a device can be: 60 degrees in 0.05 s, and no maker of these servos claims that."""
MARGIN: Final = 1.5
"""How much farther than at its greatest speed a device may have come before that is called impossible."""
TREMBLING: Final = 0.01
"""rad by which readings of a device at rest may differ: nearly two counts of the coarsest servo there is (0.0102)."""
REACH: Final = 0.06
"""s for which the speed counts: after a longer time a motor can be anywhere, and one faulty reading must not say so."""
STAYED: Final = 0.1
"""rad within which a device is believed at once to be when nobody has looked for long."""
FRESH: Final = 0.5
"""s for which a reading counts as fresh, whoever took it: as long as a lease, and longer than whoever leads axes waits
for one that is silent (0.3 s), so that he says who is."""
READINGS: Final = 3
"""How often a position is read that cannot be believed, before its reader gives up."""


class Sample(NamedTuple):
    """A position (rad), when it arrived (s on the link's clock), and how far it can be trusted."""

    value: float
    at: float
    quality: Quality = Quality.FRESH

    def age(self, now: float) -> float:
        """s since it arrived."""
        return max(0.0, now - self.at)


class Track:
    """What one device has told of its position, judged reading by reading. `speed` (rad/s) is the most it can do.

    `sample` is the last reading that can be believed, None when there is none; `suspect` the last reading, when it is
    one that cannot be believed yet.
    """

    __slots__ = ("sample", "speed", "suspect")

    def __init__(self, speed: float = FASTEST) -> None:
        self.speed: Final = speed
        self.sample: Sample | None = None
        self.suspect: Sample | None = None

    def take(self, value: float, at: float) -> Sample:
        """Judge a reading (rad, s); each reading once.

        It is FRESH where it can have come from the last one; SUSPECT where it cannot, or is no finite number; CONFIRMED
        where it cannot and agrees with a suspect one before it. One that is older than the last is REPEATED, and
        changes nothing.
        """
        before = self.sample
        if before is not None and at >= before.at and abs(value - before.value) <= TREMBLING:
            self.suspect = None
            self.sample = sample = Sample(value, at)  # the usual case: possible whatever its age
            return sample
        if not isfinite(value):
            return self._doubted(value, at)
        if before is None:
            return self._believed(value, at, Quality.FRESH)
        if at < before.at:
            return before._replace(quality=Quality.REPEATED)
        if self._possible(before, value, at):
            return self._believed(value, at, Quality.FRESH)
        doubt = self.suspect
        if doubt is not None and at >= doubt.at and self._possible(doubt, value, at):
            return self._believed(value, at, Quality.CONFIRMED)
        return self._doubted(value, at)

    def latest(self, now: float) -> Sample | None:
        """What is known of it at this moment: the last reading that can be believed, REPEATED once it is older."""
        sample = self.sample
        return sample if sample is None or now <= sample.at else sample._replace(quality=Quality.REPEATED)

    def why_not(self, now: float) -> str:
        """ "" when the position is fresh and can be believed, else the reason: `unseen`, `suspect` or `stale`."""
        if self.suspect is not None:
            return "suspect"
        if self.sample is None:
            return "unseen"
        return "" if now - self.sample.at <= FRESH else "stale"

    def forget(self) -> None:
        """It may be anywhere: it lost its supply, or was given another zero."""
        self.sample = self.suspect = None

    def _possible(self, since: Sample, value: float, at: float) -> bool:
        way, age = abs(value - since.value), at - since.at
        if age > FRESH:  # nobody has looked for long: that it has left its place needs a second look
            return way <= STAYED
        return way <= self.speed * min(age, REACH) * MARGIN + TREMBLING

    def _believed(self, value: float, at: float, quality: Quality) -> Sample:
        self.suspect = None
        self.sample = Sample(value, at, quality)
        return self.sample

    def _doubted(self, value: float, at: float) -> Sample:
        sample = Sample(value, at, Quality.SUSPECT)
        if isfinite(value) or self.suspect is None:
            self.suspect = sample
        return sample


async def believed(track: Track, ask: Callable[[], Runnable[float]]) -> float:
    """Ask a device where it is (rad), and again where that cannot be, until two readings agree.

    Raises WireError when three readings cannot be believed.
    """
    found: list[float] = []
    while len(found) < READINGS:
        found.append(await ask())
        if track.take(found[-1], await Sleep(0)).quality is not Quality.SUSPECT:
            return found[-1]
    raise WireError(
        f"its readings do not agree: {', '.join(f'{one:.4g}' for one in found)} rad of its device",
        expected="a place to which a motor can have come since the reading before",
        cause="a fault on the line, a servo that lost its supply and counts anew, or a sensor that fails",
        advice="see to that before it is moved",
    )
