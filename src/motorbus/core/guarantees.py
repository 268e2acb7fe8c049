"""What a user can rely on in the devices of a family: texts for people, written once per family.

A device cannot be asked what it does when its host fails, so the family declares it. `motorbus safety` and reviewers of
a machine use it. A text states a fact; `Level` states how far a user can rely on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Final, NamedTuple


class Level(Enum):
    """How far a user can rely on a property."""

    YES = "yes"
    PARTLY = "in part"
    NO = "no"


class Guarantee(NamedTuple):
    """One property: how far a user can rely on it, and the facts."""

    given: Level
    text: str


class Guarantees(NamedTuple):
    """The safety properties of each device of a family.

    `measured`  the device measures and reports its position
    `limits`    the device keeps travel limits by itself
    `stop`      what an acknowledged stop means
    `estops`    what an emergency stop means, by its action on an axis (see `LinkSpec.stops`); key "" where the
                action cannot be chosen
    `alone`     what the device does in a loop or a move when its host fails or the cable breaks
    `ends`      every motion ends by itself
    `torque`    the host can switch torque off
    `restart`   a restart is detected, so earlier goals do not move the device after it
    `strain`    the device reports its load, so the host can end an overload
    `watchdog`  the device stops by itself when its host falls silent
    `led`       the device follows small goals of a loop; otherwise it moves by a profile of its own
    """

    measured: Guarantee
    limits: Guarantee
    stop: Guarantee
    estops: Mapping[str, Guarantee]
    alone: Guarantee
    ends: Guarantee
    torque: Guarantee
    restart: Guarantee
    strain: Guarantee
    watchdog: Guarantee
    led: bool = False

    def points(self) -> Iterator[tuple[str, Guarantee]]:
        """Yield the title and the point of each property, in display order."""
        for name, title in _TITLES.items():
            if name == "estops":
                for policy, point in self.estops.items():
                    yield f"{title}: {policy}" if policy else title, point
            else:
                yield title, getattr(self, name)


_TITLES: Final = {
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
