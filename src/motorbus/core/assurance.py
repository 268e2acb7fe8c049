"""What the devices of a family give to whoever relies on them, and what not: said by the family, in words for people.

Nobody can ask a device what happens when its host dies. It stands here, once for each family, for `motorbus safety` and
for whoever judges a machine. A sentence says what is so, and `Given` how far one may rely on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Final, NamedTuple


class Given(Enum):
    """How far something may be relied on."""

    YES = "yes"
    PARTLY = "in part"
    NO = "no"


class Point(NamedTuple):
    """One thing that somebody might rely on: how far it is given, and what is so."""

    given: Given
    text: str


class Assurance(NamedTuple):
    """What each device of a family gives.

    `measured`  it measures where it is, and tells
    `limits`    it keeps limits of travel by itself
    `stop`      what a stop means that it has accepted
    `estops`    what an emergency stop means, by what it may do to an axis (see `LinkNeeds.stops`); by "" where that
                cannot be chosen
    `alone`     what it does when its host dies, or the cable breaks, while it is led or moves
    `ends`      whether every motion ends by itself
    `torque`    its torque can be switched off by the host
    `restart`   a restart of it is noticed, so that it is not moved by goals from before
    `strain`    it tells what its motor bears, so that the host can end what is too much
    `watchdog`  it stops by itself when its host falls silent
    `led`       it is led by small goals; otherwise it moves by a profile of its own
    """

    measured: Point
    limits: Point
    stop: Point
    estops: Mapping[str, Point]
    alone: Point
    ends: Point
    torque: Point
    restart: Point
    strain: Point
    watchdog: Point
    led: bool = False

    def points(self) -> Iterator[tuple[str, Point]]:
        """Each with what it is about, in the order in which people read it."""
        for name, about in ABOUT.items():
            if name == "estops":
                for policy, point in self.estops.items():
                    yield f"{about}: {policy}" if policy else about, point
            else:
                yield about, getattr(self, name)


ABOUT: Final[Mapping[str, str]] = {
    "measured": "measures its position",
    "limits": "limits of its own",
    "stop": "a stop",
    "estops": "emergency stop",
    "alone": "when the host dies",
    "ends": "every motion ends",
    "torque": "torque switch",
    "restart": "restart is noticed",
    "strain": "load and heat",
    "watchdog": "watchdog in it",
}
"""What each point is about, in the words in which it is shown."""
