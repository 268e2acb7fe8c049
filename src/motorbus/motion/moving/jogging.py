"""Jogging: an axis moves at a velocity for a time. What is ordered is a way of a known length, so it ends by itself.

Whoever jogs by hand may let the way end where the axis may go no farther, instead of having it refused; it is told.
"""

from __future__ import annotations

from math import copysign, isfinite
from typing import TYPE_CHECKING

from motorbus.core.steps import Emit
from motorbus.errors import RequestError
from motorbus.motion import limits, reckoning
from motorbus.motion.clamping import Clamped, Policy, check_policy, kept
from motorbus.motion.moving.verbs import move_axis, move_by
from motorbus.motion.profile import Limits
from motorbus.motion.profile.shapes import NOTHING

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs


async def jog(axis: AxisVerbs, velocity: float, seconds: float, *, policy: Policy = "reject") -> float:
    """Move at a velocity (rad/s, m/s, with its sign) for so long (s), starting and stopping within it.

    Returns the way that was gone, as `move_by`. Raises LimitExceeded, and nothing is sent, when the way would lead out
    of the limits; else as `move`. With the policy `clamp`, for an axis that can be led, it goes as far as it may
    instead, which is told before it moves (`Clamped`); one that stands there, or beyond, stays and gets no torque.
    """
    check_policy(policy)
    if "stream" not in axis.able:
        _check_led(axis, policy)
        return await reckoning.jog(axis, velocity, seconds)
    way, _ = way_of_jog(axis, velocity, seconds)
    clamped = await _clamped(axis, way) if policy == "clamp" else None
    if clamped is None:
        return await move_by(axis, way, velocity=abs(velocity))
    await Emit(clamped)
    if clamped.given == clamped.asked - way:
        return 0.0
    moved = await move_axis(axis, clamped.given, velocity=abs(velocity))
    arrived = moved.axes[axis.name]
    return arrived.present - arrived.stood


def way_of_jog(axis: AxisVerbs, velocity: float, seconds: float) -> tuple[float, Limits]:
    """How far such a jog leads an axis that can be led (rad, m), and within which limits. Raises as `jog`."""
    limits.check_velocity(axis.name, axis.spec, velocity)
    limits.check_number(f"{axis.name}: its seconds", seconds)
    if not (isfinite(seconds) and seconds > 0) or not velocity:
        raise RequestError(
            f"{axis.name}: {velocity} for {seconds} s is no jog",
            expected="a velocity that is not 0, and a finite time above 0",
            advice=NOTHING,
        )
    own = limits.limits_for(axis.name, axis.spec, velocity=abs(velocity))
    ramp = min(own.velocity / own.acceleration, seconds / 2)
    return copysign(own.acceleration * ramp * (seconds - ramp), velocity), own


async def _clamped(axis: AxisVerbs, way: float) -> Clamped | None:
    """How far a jog may lead it where that is less than the whole way: nowhere, where it stands at the end already."""
    here = axis.spec.from_device(await axis.able.position(axis.device))
    device = await limits.of_device(axis)
    to = here + way
    _, told = kept(axis.name, axis.spec, to, policy="clamp", device=device)
    if told is None:
        return None
    return told if (told.given - here) * way > 0 else told._replace(given=to - way)


def _check_led(axis: AxisVerbs, policy: Policy) -> None:
    """Raise RequestError for a jog that is to be clamped of an axis that nobody can lead."""
    if policy != "reject":
        raise RequestError(
            f"{axis.name}: its jog cannot be clamped",
            expected="an axis that can be led",
            cause=f"{axis.spec.device} moves by a profile of its own",
            advice=f"jog for less time; {NOTHING}",
        )
