"""Goals that are brought within their limits instead of being refused, for whoever asks for it; and it is told.

A goal that goes too far is refused, as a rule: who made it has made a mistake, and going somewhere else is no answer. A
hand on a joystick makes no mistake by pushing on at the end of the travel. So whoever leads axes by hand may have goals
clamped, and hears of each that was. It must happen here, where a goal is a number: the gate sees bytes, and only
refuses. What is no finite number is never made into one.
"""

from __future__ import annotations

from math import inf
from typing import Final, Literal, NamedTuple, TypeAlias, get_args

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion import limits
from motorbus.motion.machine import AxisSpec

Policy: TypeAlias = Literal["reject", "clamp"]
"""What becomes of a goal that goes too far."""
SPAN: Final = 0.5
"""s between two clamps of one axis that are told."""


class Clamped(NamedTuple):
    """An event: this axis was `asked` for a place (rad, m) that it may not go to, and was `given` another, for that
    `reason`: "limits", "step" where it is too far from where it was measured to be, or "velocity" where it is farther
    from the last goal than the axis may go in that time."""

    axis: str
    asked: float
    given: float
    reason: str


class Tidings:
    """Which of many clamps are told: of each axis the first, and then at most one in `SPAN` s. A loop has hundreds of
    cycles a second, and who holds a joystick against its end has one clamp in each."""

    def __init__(self) -> None:
        self._told: dict[str, float] = {}

    def worth(self, event: Clamped, now: float) -> bool:
        """Whether this one, at this moment (s), is to be told."""
        if now - self._told.get(event.axis, -inf) < SPAN:
            return False
        self._told[event.axis] = now
        return True


def kept(
    name: str,
    spec: AxisSpec,
    goal: float,
    *,
    policy: Policy = "reject",
    measured: float | None = None,
    device: limits.Device = None,
) -> tuple[float, Clamped | None]:
    """The goal that the axis is to be sent (rad, m), and what is to be told of it, None when it is the one asked for.

    Judged is as in `limits.check_goal`. Raises LimitExceeded for what goes too far with the policy `reject`, and for
    what is no finite number with any.
    """
    check_policy(policy)
    if policy == "reject":
        limits.check_goal(name, spec, goal, measured=measured, device=device)
        return goal, None
    limits.check_finite(name, "goal", goal)
    try:
        limits.check_goal(name, spec, goal, measured=measured, device=device)
    except LimitExceeded:
        given, reason = _within(spec, goal, measured, device)
        return given, Clamped(name, goal, given, reason)
    return goal, None


def check_policy(policy: object) -> None:
    """Raise RequestError for what is no `Policy`."""
    if policy not in get_args(Policy):
        raise RequestError(f"{policy!r} is no policy", expected="reject or clamp", advice="nothing was sent")


def _within(spec: AxisSpec, goal: float, measured: float | None, device: limits.Device) -> tuple[float, str]:
    """The nearest place to the goal that is allowed, and what was in the way of the goal itself.

    Who stands outside his limits by more than one step comes back by one step: the nearest way in.
    """
    found = limits.bounds(spec, device)
    inside = min(max(goal, found.low), found.high)
    if measured is None or spec.max_step is None:
        return inside, "limits"
    near = min(max(inside, measured - spec.max_step), measured + spec.max_step)
    return near, "limits" if near == inside != goal else "step"
