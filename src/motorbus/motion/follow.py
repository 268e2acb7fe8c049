"""One arm leads, another follows: each follower goes where its leader is, as fast as its own limits let it.

Leaders are let go, so that a hand can guide them. A follower starts where it stands and comes after its leader within
its own velocity and acceleration, so nothing jumps, however far apart the two are at the beginning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from motorbus.core.family import Quality
from motorbus.errors import RequestError
from motorbus.motion import group
from motorbus.motion.body import Body
from motorbus.motion.clamping import Policy, check_policy
from motorbus.motion.loop.faces import Errand, LoopFace
from motorbus.motion.loop.grid import ROUNDING, Statistics
from motorbus.motion.loop.readings import LoopState
from motorbus.motion.profile.shapes import NOTHING


@dataclass(frozen=True, slots=True)
class Followed:
    """What became of a following.

    `pairs`       who followed whom: follower by leader
    `seconds`     that it lasted
    `apart`       how far (rad, m) each follower was from its leader in the end, by the name of the follower
    `held`        cycles in which a follower got no new goal, because its leader was not heard, could not be believed
                  or stood where the follower may not go, by its name
    `statistics`  of the loop; with the policy `clamp` it has how often a leader stood where its follower may not go
    """

    pairs: Mapping[str, str]
    seconds: float
    apart: Mapping[str, float]
    held: Mapping[str, int]
    statistics: Statistics

    def __str__(self) -> str:
        pairs = ", ".join(f"{follower} after {leader}" for leader, follower in self.pairs.items())
        held = ", ".join(f"{name} {count}" for name, count in self.held.items() if count)
        return f"{pairs}: {self.seconds:.1f} s; cycles held: {held or 'none'}; {self.statistics}"


def follow(
    body: Body,
    pairs: Mapping[str, str],
    *,
    seconds: float | None = None,
    rate: float = 100.0,
    until: Callable[[], bool] | None = None,
    policy: Policy = "reject",
) -> Errand[Followed]:
    """Have axes follow others: `{leader: follower}`, on whatever buses, in a loop of `rate` (Hz).

    Leaders that have a switch for their torque are let go first. A follower goes to the position of its leader, rad for
    rad or m for m, within its own limits. While its leader is not heard,
    or stands where the follower may not go, it gets no new goal and stays at the last one. With the policy `clamp` it
    goes as far as it may then, and that is told (`Clamped`).

    It ends after `seconds`, or when `until`, which is asked in each cycle, gives True; followers that are on their way
    brake then. Without either, Ctrl-C ends it and what became of it is given. Raises RequestError for pairs that cannot
    be, and what a `Loop` raises.
    """
    wanted = dict(pairs)
    check_policy(policy)
    check_pairs(body, wanted)
    check_seconds(seconds)
    limp = [name for name in wanted if "disable_torque" in body.axes[name].able]
    return Errand(
        _Following(wanted, Ending(rate, seconds, until), policy == "clamp"),
        rate,
        (*wanted, *wanted.values()),
        before=(lambda: group.disable_torque(body, limp)) if limp else None,
        endless=seconds is None and until is None,
        policy=policy,
    )


class _Following:
    def __init__(self, pairs: Mapping[str, str], over: Ending, clamps: bool) -> None:
        self._pairs = pairs
        self._over = over
        self._clamps = clamps
        self._apart = dict.fromkeys(pairs.values(), 0.0)
        self._held = dict.fromkeys(pairs.values(), 0)

    def step(self, loop: LoopFace, state: LoopState) -> bool:
        """See `loop.Course`."""
        position, missing, doubts = state.position, state.missing, state.doubts
        for leader, follower in self._pairs.items():
            here = position[leader]
            self._apart[follower] = position[follower] - here
            unheard = leader in missing or doubts.get(leader) is Quality.SUSPECT
            if unheard or not (self._clamps or loop.allows(follower, here)):
                self._held[follower] += 1
            else:
                loop.goal[follower] = here
        return not self._over(state.number)

    def result(self, loop: LoopFace) -> Followed:
        """See `loop.Course`."""
        return Followed(self._pairs, self._over.seconds, self._apart, self._held, loop.statistics)


class Ending:
    """When something that goes on in a loop of `rate` (Hz) is over: after so many seconds, or when somebody says so."""

    def __init__(self, rate: float, seconds: float | None, until: Callable[[], bool] | None) -> None:
        self._rate = rate
        self._seconds = seconds
        self._until = until
        self._first: int | None = None
        self.seconds = 0.0

    def __call__(self, number: int) -> bool:
        """Is it over with the cycle in this slot? The first one asked about is at 0 s."""
        if self._first is None:
            self._first = number
        self.seconds = (number - self._first) / self._rate
        if self._until is not None and self._until():
            return True
        return self._seconds is not None and self.seconds >= self._seconds - ROUNDING


def check_seconds(seconds: float | None) -> None:
    """Raise RequestError for a time that cannot be."""
    if seconds is not None and not (isfinite(seconds) and seconds > 0):
        raise RequestError(f"seconds is {seconds}", expected="a finite number above 0", advice=NOTHING)


def check_able(body: Body, names: Iterable[str], needs: str, what: str) -> None:
    """Raise RequestError for an axis that is not open, or whose device lacks what is needed to be `what`."""
    for name in names:
        if name not in body.axes:
            raise RequestError(
                f"there is no open axis {name!r}", expected=f"one of {', '.join(body.axes)}", advice=NOTHING
            )
        if needs not in body.axes[name].able:
            raise RequestError(
                f"{name} cannot be {what}",
                expected=f"an axis whose device has {needs.replace('_', ' ')}",
                cause=f"{body.axes[name].spec.device} does not have it",
                advice=NOTHING,
            )


def check_pairs(body: Body, pairs: Mapping[str, str]) -> None:
    """Raise RequestError for pairs, leader by follower, of which one cannot follow the other. Nothing is sent."""
    if not pairs:
        raise RequestError("nobody follows anybody", expected="leader and follower, by name", advice=NOTHING)
    check_able(body, pairs, "stream", "followed in a loop")
    check_able(body, pairs.values(), "stream", "led in a loop")
    followers: dict[str, Any] = {}
    for leader, follower in pairs.items():
        if follower in pairs or follower in followers:
            raise RequestError(
                f"{follower} cannot follow {leader}: it leads or follows already",
                expected="axes that are in one pair each",
                advice=NOTHING,
            )
        followers[follower] = leader
        if body.axes[leader].spec.linear != body.axes[follower].spec.linear:
            raise RequestError(
                f"{follower} cannot follow {leader}: one of them turns and the other is linear",
                expected="two axes in rad, or two in m",
                advice=NOTHING,
            )
