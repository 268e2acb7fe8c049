"""What a user can rely on in the devices of a family: texts for people, written once per family.

A device cannot be asked what it does when its host fails, so the family declares it. `motorbus safety` and reviewers of
a machine use it. A text states a fact; `Level` states how far a user can rely on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple


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
    """The safety properties of each device of a family."""

    measured: Guarantee  # the device measures and reports its position
    limits: Guarantee  # the device keeps travel limits by itself
    stop: Guarantee  # what an acknowledged stop means
    estops: Mapping[str, Guarantee]
    """What an emergency stop means, by its action on an axis (see `LinkSpec.stops`); key "" if it has no choice."""
    alone: Guarantee  # what the device does in a loop or a move when its host fails or the cable breaks
    ends: Guarantee  # every motion ends by itself
    torque: Guarantee  # the host can switch torque off
    restart: Guarantee  # a restart is detected, so earlier goals do not move the device after it
    strain: Guarantee  # the device reports its load, so the host can end an overload
    watchdog: Guarantee  # the device stops by itself when its host falls silent
    led: bool = False  # the device follows small goals of a loop; otherwise it moves by a profile of its own

    def points(self) -> dict[str, Guarantee]:
        """The properties by title, in display order."""
        estops = {
            f"emergency stop: {action}".removesuffix(": "): point for action, point in self.estops.items()
        }
        return {
            "measures its position": self.measured,
            "limits of its own": self.limits,
            "a stop": self.stop,
            **estops,
            "when the host dies": self.alone,
            "every motion ends": self.ends,
            "torque switch": self.torque,
            "restart is noticed": self.restart,
            "load and heat": self.strain,
            "watchdog in it": self.watchdog,
        }
