"""When a motor pushes too hard for too long, or is too hot.

A motor that is blocked draws its greatest current, stands off its goal, and goes on like that until it is hot or its
own protection lets it drop. A moment of high current is nothing: every start has one. So it takes three things at the
same time, current or load, distance from the goal, and *time*. Heat needs no other sign.

The usual figures come from the servos' own protection, and act earlier. An STS3215 is shipped to protect itself above
80 % of its torque after 2 s, above 500 counts of current (3.25 A) after 2 s, and at 70 °C (STS3215 memory table V3.6,
registers 36, 35, 28, 38 and 13); then it lets its load drop to 20 % of its force, and who wants to hold comes too late.
"""

from __future__ import annotations

from enum import Enum
from math import inf
from typing import Final, NamedTuple

from motorbus.core.family import State
from motorbus.errors import RequestError

LOAD: Final = 0.8
"""Of what the motor can do."""
CURRENT: Final = 2.5
"""A; of the supply, as devices tell it."""
OFF: Final = 0.1
"""rad of the device off its goal: twice what a servo stands off its goal under the greatest load it may carry."""
SECONDS: Final = 1.0
"""s for which all of that must last."""
TURNING: Final = 0.5
"""rad/s of the device. What turns faster is not blocked, and is at a high duty for its speed and not for its load."""
HOT: Final = 65.0
"""°C."""
COOL: Final = 60.0
"""°C below which a motor that was too hot is so no more."""


class Bearable(NamedTuple):
    """What a motor may bear: `load` (fraction), `current` (A), `off` its goal (rad of the device), for `seconds` (s),
    and how `hot` (°C) it may be before it is too hot, until it is `cool` again. Infinite: nobody minds."""

    load: float = LOAD
    current: float = CURRENT
    off: float = OFF
    seconds: float = SECONDS
    hot: float = HOT
    cool: float = COOL

    def checked(self) -> Bearable:
        """The same. Raises RequestError where a figure is none, or nothing would ever be too much or all would be."""
        fair = all(value > 0 for value in self) and self.seconds < inf and self.cool <= self.hot
        if not fair:
            raise RequestError(
                f"{self} is nothing that a motor could bear",
                expected="figures above 0, a time that ends, and `cool` not above `hot`",
            )
        return self


USUAL: Final = Bearable()


class Verdict(Enum):
    """How a motor fares."""

    EASY = "nothing strains it"
    STRAINED = "it pushes hard and does not come to its goal"
    OVERLOADED = "it has pushed hard for too long without coming to its goal"
    HOT = "it is too hot"


class Strain:
    """Watches one motor, sample by sample; see `Bearable` for what is too much.

    `sample` is the last one, `since` when (s) the strain began that lasts still. Load is the duty of the motor, which
    is high at a high speed too, so of what turns it does not count; current does.

    OVERLOADED stays until `reset`, HOT until it has cooled down: whoever makes it easy for a moment must not find the
    motor pushing again at once.
    """

    def __init__(self, bearable: Bearable = USUAL) -> None:
        self.bearable: Final = bearable.checked()
        self.since: float | None = None
        self.sample: State | None = None
        self._overloaded = False
        self._hot = False

    def take(self, state: State, goal: float | None) -> Verdict:
        """Judge a sample; `goal` is where it was told to be (rad of the device), None where it was told no place.

        Without a goal, or a position, nobody knows whether it comes to its goal, and the load alone is no strain.
        """
        self.sample = state
        self._take_heat(state.temperature)
        if not self._strains(state, goal):
            self.since = None
        elif self.since is None or state.at < self.since:
            self.since = state.at
        elif state.at - self.since >= self.bearable.seconds:
            self._overloaded = True
        return self.verdict

    @property
    def verdict(self) -> Verdict:
        """How it fares by now; of an overload and heat together, the overload."""
        if self._overloaded:
            return Verdict.OVERLOADED
        if self._hot:
            return Verdict.HOT
        return Verdict.EASY if self.since is None else Verdict.STRAINED

    def reset(self) -> None:
        """Somebody has seen to it: an overload is forgotten. Heat is not, for it is still there."""
        self._overloaded, self.since = False, None

    def _take_heat(self, temperature: float | None) -> None:
        if temperature is None:
            return
        if temperature >= self.bearable.hot:
            self._hot = True
        elif temperature < self.bearable.cool:
            self._hot = False

    def _strains(self, state: State, goal: float | None) -> bool:
        if goal is None or state.position is None or not abs(goal - state.position) > self.bearable.off:
            return False
        turns = state.velocity is not None and abs(state.velocity) > TURNING
        hard = state.load is not None and abs(state.load) >= self.bearable.load and not turns
        return hard or (state.current is not None and abs(state.current) >= self.bearable.current)
