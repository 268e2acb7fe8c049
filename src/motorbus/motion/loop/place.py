"""One axis in a loop: where it was last, where it is to go, and the small goal of the next cycle.

A goal is judged when it is new, and before anything of its cycle is sent. As a rule an axis *follows* it within its
velocity and its acceleration, and what is sent is a step on that way. Sent *direct*, a goal goes out as it was given,
and then it may be no farther from the last one than the velocity of the axis allows in that time.

Nobody is ordered anywhere whose position is not known: who was silent for more than two cycles, or whose last reading
cannot be believed, is left out until he is heard again, and goes on from where he is measured to be.
"""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Final

from motorbus.errors import LimitExceeded
from motorbus.motion import limits
from motorbus.motion.clamping import Clamped, Policy, kept
from motorbus.motion.limits import Device, shown_rate
from motorbus.motion.machine.model import ROUNDING, VELOCITY
from motorbus.motion.profile import Follower, Limits
from motorbus.motion.safety.guard import LATE, NEAR
from motorbus.motion.safety.track import FRESH

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs
    from motorbus.motion.command import Command
    from motorbus.motion.loop.readings import Silence

CATCH_UP: Final = 3
"""Periods that a movement may have lost and make good by one longer step. After more the axis stands at its last goal
by then, and begins anew from there."""
STALE: Final = 2
"""Cycles in a row in which an axis may be silent and is ordered all the same, where a cycle is short enough: no order
is given by a position that is older than `safety.track.FRESH`."""


class Place:
    """An axis of a loop. Positions are in rad (m), `node` is the id of its device.

    `position` is where it was heard to be last, `heard` when that was (s of robot time), `silent` how many cycles in a
    row it has not been heard, or not so that it can be believed, `silence` since when. `angle` is what its device told
    last (rad); it is no number where the next reading must be looked at closely, and `doubted` while the last one
    cannot be believed. `asked` is the goal that was set and `sent` the position that was ordered last; None: none.
    `begun` is true once it has got torque here, and until then `claim` is the command over it from when its goal was
    set. `endures` is in how many cycles in a row it may be silent and is ordered all the same, `left` in how many it
    was not ordered. What is brought within its limits is put into `clamps`.
    """

    __slots__ = (
        "_device",
        "_direct",
        "_far",
        "_follower",
        "_high",
        "_lead",
        "_low",
        "_passed",
        "_policy",
        "_way",
        "angle",
        "asked",
        "axis",
        "begun",
        "claim",
        "clamps",
        "doubted",
        "endures",
        "heard",
        "left",
        "name",
        "node",
        "period",
        "position",
        "ratio",
        "sent",
        "silence",
        "silent",
        "zero",
    )

    def __init__(
        self,
        axis: AxisVerbs,
        device: Device,
        period: float,
        direct: bool,
        policy: Policy = "reject",
    ) -> None:
        spec = axis.spec
        found = limits.bounds(spec, device)
        slack = ROUNDING * max((abs(end) for end in found[:2] if isfinite(end)), default=0.0) + ROUNDING
        self.axis: Final = axis
        self.name: Final = axis.name
        self.node: Final = spec.node
        self.zero: Final = spec.zero
        self.ratio: Final = spec.ratio
        self._device: Final = device
        self._low: Final = found.low - slack
        self._high: Final = found.high + slack
        self._lead: Final = spec.max_velocity * LATE + NEAR / abs(spec.ratio)
        self._far: Final = min(inf if spec.max_step is None else spec.max_step, self._lead) * (1 + ROUNDING)
        self.period: Final = period
        self._way: Final = spec.max_velocity * period * (1 + ROUNDING) + ROUNDING
        self._direct: Final = direct
        self._policy: Final = policy
        self.endures: Final = max(0, min(STALE, int(FRESH / period) - 1))
        self._follower: Follower | None = None
        self._passed: float | None = None
        self.position = 0.0
        self.heard = -inf
        self.silent = 0
        self.silence: Silence | None = None
        self.asked: float | None = None
        self.sent: float | None = None
        self.begun = False
        self.claim: Command | None = None
        self.clamps: list[Clamped] = []
        self.angle = nan
        self.doubted = False
        self.left = 0

    def allows(self, goal: float) -> bool:
        """Whether its soft limits and those of its device allow this goal (rad, m)."""
        return self._low <= goal <= self._high

    def begin(self, position: float) -> None:
        """It has got torque, and stands there (rad, m)."""
        self.position = self.sent = position
        self._follower = None if self._direct else Follower(position, Limits.of(self.axis.spec))
        self._known()
        self.begun = True

    def _known(self) -> None:
        """It is known where it is, so it may be ordered."""
        self.silent = self.left = 0
        self.angle, self.doubted = nan, False

    def release(self) -> None:
        """It is led no more: it was stopped, and waits for a new goal, with which it begins anew."""
        self.asked = self.sent = self._passed = self._follower = self.claim = None
        self.begun = False
        self._known()

    # -- whether it may be ordered -------------------------------------------------------------------------------------

    def hear(self, angle: float, at: float) -> None:
        """Its device is at this angle (rad), since this moment of robot time (s), and that can be believed."""
        self.angle = angle
        self.position = (angle - self.zero) / self.ratio
        self.heard = at
        self.silent = 0
        self.doubted = False

    def doubt(self) -> None:
        """It was heard, and cannot be where it says: another reading must say so too."""
        self.angle = nan
        self.silent += 1
        self.doubted = True

    @property
    def unsure(self) -> bool:
        """Nobody knows where it is by now, so nobody may order it anywhere."""
        return self.doubted or self.silent > self.endures

    def resume(self) -> None:
        """It is known again where it is: what it is told from now on begins there."""
        self.sent = self.position
        self._passed = None
        if self._follower is not None:
            self._follower.reset(self.position)

    # -- its goals -----------------------------------------------------------------------------------------------------

    def judge(self, periods: int) -> None:
        """Raise LimitExceeded for a goal that must not be sent, `periods` after the last one, and forget it.

        With the policy `clamp` a goal that goes too far is brought to the nearest that may be sent, as far as there is
        one.
        """
        asked = self.asked
        if asked is None or (asked == self._passed and not self._direct):
            return
        try:
            if not self._low <= asked <= self._high:
                limits.check_goal(self.name, self.axis.spec, asked, device=self._device)
            if self._direct:
                since = self.position if self.sent is None else self.sent
                if abs(asked - since) > self._way or abs(asked - self.position) > self._far:
                    self._judge_way(asked, since, periods)
        except LimitExceeded:
            given = self._clamped(asked, periods)
            if given is None:
                self.asked = self._passed
                raise
            self.asked = asked = given
        self._passed = asked

    def _clamped(self, asked: float, periods: int) -> float | None:
        """The nearest goal that may be sent; None where there is none, or nobody wants it."""
        if self._policy != "clamp" or not isfinite(asked):
            return None
        measured = self.position if self._direct else None
        given, told = kept(
            self.name, self.axis.spec, asked, policy="clamp", measured=measured, device=self._device
        )
        reason = "velocity" if told is None else told.reason
        if self._direct:
            since = self.position if self.sent is None else self.sent
            most = self._way * min(periods + self.left, CATCH_UP)
            near = min(max(given, since - most), since + most)
            if abs(near - self.position) > self._far:
                return None
            given, reason = near, reason if near == given else "velocity"
        self.clamps.append(Clamped(self.name, asked, given, reason))
        return given

    def _judge_way(self, asked: float, since: float, periods: int) -> None:
        if self.unsure:  # it is not sent now, and is judged again before it is
            return
        periods = min(periods + self.left, CATCH_UP)
        way, far = abs(asked - since), abs(asked - self.position)
        if way > self._way * periods:
            raise self._too_fast(asked, since, periods)
        if far > self._far:
            raise self._too_far(asked)

    def step(self, periods: int) -> float:
        """The angle of its device (rad) to be ordered `periods` after the last one.

        Raises LimitExceeded, at rest where it was told to be last, when that is too far from where it is measured to
        be: something holds it back.
        """
        asked, way = self.asked, self._follower
        assert asked is not None
        if way is not None:
            if periods > CATCH_UP:
                assert self.sent is not None
                way.reset(self.sent)
                periods = 1
            asked = way.step(periods * self.period, asked)
            if abs(asked - self.position) > self._far:
                self._held_back(way, asked)
        self.sent = asked
        return self.zero + asked * self.ratio

    def stay(self) -> float:
        """The angle of its device (rad) where it was told to be last."""
        assert self.sent is not None
        return self.zero + self.sent * self.ratio

    def _held_back(self, way: Follower, asked: float) -> None:
        error = self._too_far(asked)
        assert self.sent is not None
        way.reset(self.sent)
        self.asked = self._passed = self.sent
        error.cause = "something holds it back, or nobody has heard for a while where it is"
        error.advice = f"look what that is; it stays at its last goal, {self.axis.spec.show(self.sent)}"
        raise error

    def _too_far(self, asked: float) -> LimitExceeded:
        """The error for a goal that is too far from where it is measured to be, for `max_step` or for its velocity."""
        name, spec = self.name, self.axis.spec
        try:
            limits.check_step(name, spec, asked, self.position)
        except LimitExceeded as error:
            return error
        far, most = spec.show(abs(asked - self.position)), spec.show(self._lead)
        return LimitExceeded(
            f"{name}: the goal {spec.show(asked)} is {far} from {spec.show(self.position)}, where it is, and what is "
            f"led at {shown_rate(spec, VELOCITY, spec.max_velocity)} at most is never ordered farther than {most}",
            reason="velocity",
            expected=f"a goal within {most} of {spec.show(self.position)}",
            cause="something holds it back, or it is slower than max_velocity says",
            advice="look what that is; nothing was sent",
        )

    def rest(self) -> None:
        """It has stood still, or nothing was sent: where it follows, it goes on from where it was told to be last."""
        if self._follower is not None and self.sent is not None:
            self._follower.reset(self.sent)

    def halt(self) -> None:
        """Where it follows: brake from here on, or stay. It is `arrived` when that is done."""
        way = self._follower
        if way is not None:
            way.halt()
            self.asked = self._passed = way.goal

    @property
    def follows(self) -> bool:
        """It is led, and its goals are followed."""
        return self._follower is not None

    @property
    def arrived(self) -> bool:
        """Its small goals have come to its goal, and rest."""
        return self._follower is None or self._follower.arrived

    def _too_fast(self, asked: float, since: float, periods: int) -> LimitExceeded:
        spec = self.axis.spec
        rate = shown_rate(spec, VELOCITY, abs(asked - since) / (periods * self.period))
        limit = shown_rate(spec, VELOCITY, spec.max_velocity)
        return LimitExceeded(
            f"{self.name}: from {spec.show(since)} to {spec.show(asked)} in {periods * self.period * 1e3:.3g} ms is "
            f"{rate}, and its limit is {limit}",
            expected=f"at most {spec.show(self._way * periods)} from the last goal",
            advice="give goals that are closer together, or leave direct out and they are followed; nothing was sent",
        )
