"""What every motion of an axis is judged by before anything is sent: one place, whoever moves it, and in one wording.

An axis has soft limits in the machine file, its device has limits of its own, and one command may be no farther from
the measured position than `max_step`. Nothing here clips: a goal that goes too far is refused, with the limits in the
unit in which people see the axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from motorbus.core import units
from motorbus.core.register import shown
from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.machine import AxisSpec
from motorbus.motion.machine.model import ACCELERATION, ROUNDING, VELOCITY, Measure
from motorbus.motion.profile.shapes import NOTHING, Limits
from motorbus.motion.trajectory import Trajectory
from motorbus.motion.trajectory import check as check_samples

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

Device: TypeAlias = "tuple[float, float] | None"
"""The device's own lowest and highest position (rad of the device), None where it has or tells none."""

SLOWEST: Final = 4.0
"""Hz: a small goal is one period ahead, and a host that dies must not leave more than 0.25 s of travel."""


class Bounds(NamedTuple):
    """Between which positions (rad, m) an axis may be, and whose limits these are."""

    low: float
    high: float
    whose: str


async def of_device(axis: AxisVerbs) -> Device:
    """The device's own limits (rad of the device), asked of it; None where it has none."""
    if "limits" not in axis.able:
        return None
    found: Device = await axis.able.limits(axis.device)
    return found


def bounds(spec: AxisSpec, device: Device = None) -> Bounds:
    """What is left when the soft limits and those of the device both hold; infinite where nobody limits it."""
    low = -inf if spec.low is None else spec.low
    high = inf if spec.high is None else spec.high
    if device is None:
        return Bounds(low, high, "the soft limits")
    ends = sorted(spec.from_device(end) for end in device)
    if low >= ends[0] and high <= ends[1]:
        return Bounds(low, high, "the soft limits")
    soft = spec.low is None and spec.high is None
    return Bounds(max(low, ends[0]), min(high, ends[1]), "the device" if soft else "the axis and its device")


def check_number(what: str, value: object) -> None:
    """Raise RequestError for what is no number at all: text, None, True. One of another library is a number."""
    try:
        if not isinstance(value, bool | str | bytes):
            float(value)  # type: ignore[arg-type]
            return
    except (TypeError, ValueError, OverflowError):
        pass
    raise RequestError(f"{what} is {shown(value)}", expected="a number", advice=NOTHING)


def check_finite(name: str, what: str, value: float) -> None:
    """Raise RequestError for what is no number, LimitExceeded for one that is not finite."""
    check_number(f"{name}: its {what}", value)
    if not isfinite(value):
        raise LimitExceeded(
            f"{name}: its {what} is {value}", expected="a finite number", advice=f"give a number; {NOTHING}"
        )


def check_goal(
    name: str, spec: AxisSpec, goal: float, *, measured: float | None = None, device: Device = None
) -> None:
    """Raise LimitExceeded for a goal (rad, m) that the axis must not be sent.

    Judged are whether it is a finite number, the soft limits, those of the `device` (rad of the device), and, where it
    is known where the axis is `measured` to be (rad, m), `max_step`.
    """
    check_finite(name, "goal", goal)
    found = bounds(spec, device)
    slack = ROUNDING * max((abs(end) for end in found[:2] if isfinite(end)), default=0.0) + ROUNDING
    inside = found.low - slack <= goal <= found.high + slack
    if not (spec.allows(goal) and inside):
        raise LimitExceeded(
            f"{name}: the goal {spec.show(goal)} is outside {_shown(spec, found)}, the limits of {_owner(found)}",
            expected=_shown(spec, found),
            advice=f"stay inside, or change {_key(found)}; {NOTHING}",
        )
    if measured is not None:
        check_step(name, spec, goal, measured)


def check_step(name: str, spec: AxisSpec, goal: float, measured: float) -> None:
    """Raise LimitExceeded for a goal farther from where the axis is `measured` to be than `max_step` (all rad, m)."""
    most = spec.max_step
    if most is None or abs(goal - measured) <= most * (1 + ROUNDING):
        return
    raise LimitExceeded(
        f"{name}: the goal {spec.show(goal)} is {spec.show(abs(goal - measured))} from {spec.show(measured)}, "
        f"where it is, and one command may be {spec.show(most)} from there",
        expected=f"a goal within {spec.show(most)} of {spec.show(measured)}",
        advice=f"go there in smaller steps, or change max_step of the axis; {NOTHING}",
    )


def check_velocity(name: str, spec: AxisSpec, velocity: float) -> None:
    """Raise LimitExceeded for a velocity (rad/s, m/s; its sign does not count) above that of the axis."""
    _check_rate(name, spec, "velocity", velocity, spec.max_velocity)


def check_acceleration(name: str, spec: AxisSpec, acceleration: float) -> None:
    """Raise LimitExceeded for an acceleration (rad/s², m/s²; its sign does not count) above that of the axis."""
    _check_rate(name, spec, "acceleration", acceleration, spec.max_acceleration)


def limits_for(
    name: str,
    spec: AxisSpec,
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    speed: float = 1.0,
) -> Limits:
    """What a profile of the axis keeps within: what was asked for, else the axis' own limits times `speed`.

    With half the speed it takes twice the time, so acceleration goes with the square. Raises LimitExceeded for more
    than the axis may, RequestError for what is not above 0.
    """
    check_speed(speed)
    own = Limits.of(spec)
    for what, figure in (("velocity", velocity), ("acceleration", acceleration)):
        if figure is None:
            continue
        check_number(f"{name}: {what}", figure)
        if not figure > 0:
            raise RequestError(f"{name}: {what} is {figure}", expected="a number above 0", advice=NOTHING)
    if velocity is not None:
        check_velocity(name, spec, velocity)
    if acceleration is not None:
        check_acceleration(name, spec, acceleration)
    return Limits(
        own.velocity * speed if velocity is None else velocity,
        own.acceleration * speed * speed if acceleration is None else acceleration,
    )


def check_speed(speed: float) -> None:
    """Raise RequestError unless it is a share of what is allowed: above 0, at most 1."""
    check_number("speed", speed)
    if not 0 < speed <= 1:
        raise RequestError(f"speed is {speed}", expected="above 0, at most 1", advice=NOTHING)


def check_course(
    trajectory: Trajectory, axes: Mapping[str, AxisSpec], devices: Mapping[str, Device] | None = None
) -> None:
    """Raise LimitExceeded for the first sample beyond a limit of its axis, or of its device (rad of the device).

    Judged are positions, velocities and accelerations; see `trajectory.check`.
    """
    check_samples(trajectory, axes)
    check_reach(trajectory, axes, devices or {})


def check_reach(trajectory: Trajectory, axes: Mapping[str, AxisSpec], devices: Mapping[str, Device]) -> None:
    """Raise LimitExceeded where a trajectory leads farther than an axis or its device goes."""
    for name, places in trajectory.axes.items():
        device = devices.get(name)
        for place in (min(places), max(places)):
            check_goal(name, axes[name], place, device=device)


def shown_rate(spec: AxisSpec, measure: Measure, rate: float) -> str:
    """A velocity or an acceleration in the unit in which people see the axis: `90 deg/s`."""
    unit = f"{spec.unit}/s" + ("²" if measure is ACCELERATION else "")
    return f"{rate / units.SCALES[measure.of(spec.linear)][unit]:.6g} {unit}"


def _check_rate(name: str, spec: AxisSpec, what: str, value: float, most: float) -> None:
    check_finite(name, what, value)
    if abs(value) <= most * (1 + ROUNDING):
        return
    measure = VELOCITY if what == "velocity" else ACCELERATION
    limit = shown_rate(spec, measure, most)
    raise LimitExceeded(
        f"{name}: the {what} {shown_rate(spec, measure, abs(value))} is above {limit}, its limit",
        expected=f"at most {limit}",
        advice=f"be slower, or change max_{what} of the axis; {NOTHING}",
    )


def _shown(spec: AxisSpec, found: Bounds) -> str:
    low = "anywhere" if found.low == -inf else spec.show(found.low)
    high = "anywhere" if found.high == inf else spec.show(found.high)
    return f"{low} to {high}"


def _owner(found: Bounds) -> str:
    return "the machine file" if found.whose == "the soft limits" else found.whose


def _key(found: Bounds) -> str:
    return {
        "the soft limits": "low and high of the axis",
        "the device": "the limit registers of the device",
    }.get(found.whose, "low and high of the axis, or the limit registers of the device")


def refuse_slow(rate: float) -> None:
    """Raise RequestError for a rate (Hz) at which the small goals of a loop would be too far ahead."""
    if rate < SLOWEST:
        raise RequestError(
            f"a loop at {rate:.6g} Hz only looks: its goals would be {1 / rate:.3g} s ahead",
            expected=f"{SLOWEST:g} Hz or more, for so far a motor may go whose host has died",
            advice="take a higher rate to lead axes, or move() for a way of its own; nothing was sent",
        )
