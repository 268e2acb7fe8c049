"""What is said of an axis that is led and does not do as it was told: does not follow, does not arrive, is silent."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from motorbus.errors import Interrupted, NoReply, Stalled
from motorbus.motion.safety.restarts import PROTECTIVE

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

LAG: Final = 0.3
"""s that an axis may be behind, at the highest speed of its course: slower servos need another max_velocity."""
FAR: Final = 0.1
"""rad of the device that an axis may be off where it should be, whatever its speed."""


def allowed(axis: AxisVerbs, speed: float) -> float:
    """How far an axis may be from where it should be (rad, m); `max_step` bounds that too."""
    most = max(FAR / abs(axis.spec.ratio), LAG * speed)
    return most if axis.spec.max_step is None else min(most, axis.spec.max_step)


def behind(
    axis: AxisVerbs, goal: float, present: float, most: float, alarms: Collection[str] = ()
) -> Stalled:
    """The error for an axis that is more than `most` from where it should be by now (all rad, m).

    `alarms` are those of its device.
    """
    spec = axis.spec
    where = f"it is at {spec.show(present)}, and should be at {spec.show(goal)} by now"
    return Stalled(
        f"{axis.name} does not follow: {where}{_told(alarms)}",
        expected=f"within {spec.show(most)} of where it should be",
        cause=_cause(
            alarms, "something blocks it, the load is too heavy, or it is slower than max_velocity says"
        ),
        advice="clear the way, move slower, or change the limits of the axis; all of the movement were told to stop",
        node=spec.node,
    )


def not_there(
    short: Sequence[AxisVerbs],
    goals: Mapping[str, float],
    presents: Mapping[str, Sequence[float]],
    near: float,
    patience: float,
    alarms: Mapping[str, Collection[str]],
) -> Stalled:
    """The error for axes that are not in position so long (s) after the end; the first must come so `near` (rad, m).

    `alarms` are those of their devices, by name.
    """
    first = short[0]
    return Stalled(
        "; ".join(
            f"{_stands(one, goals[one.name], presents[one.name])}{_told(alarms[one.name])}" for one in short
        ),
        expected=f"within {first.spec.show(near)} of it, {patience:g} s after the end",
        cause=_cause(
            [alarm for one in short for alarm in alarms[one.name]],
            "something blocks it, the load is too heavy, or its torque is bounded",
        ),
        advice="clear the way, allow it more torque, or give a wider tolerance; all of the movement were told to stop",
        node=first.spec.node,
    )


def silent(axis: AxisVerbs, seconds: float) -> NoReply:
    """The error for an axis that has been silent for too long while it was led."""
    return NoReply(
        f"{axis.name} ({axis.spec.device}) has not answered for {seconds:.2f} s while it was led",
        cause="its cable, its supply, or another device in between",
        advice="look at the cable and the supply; all of the movement were told to stop",
        node=axis.spec.node,
    )


def held_up(seconds: float) -> Interrupted:
    """The error for a program that has not said where to go for so long (s)."""
    return Interrupted(
        f"nobody was told where to go for {seconds:.2f} s, so the movement ends where they stopped",
        cause="this program was held up: stopped, swapped out, or on a computer that is far too busy",
        advice="give the order again if it is still wanted; all of the movement were told to stop",
    )


def does_not_begin(axis: AxisVerbs) -> NoReply:
    """The error for an axis that is silent before anything has moved."""
    return NoReply(
        f"{axis.name} ({axis.spec.device}) does not answer, so this movement does not begin",
        cause="its cable, its supply, or another device in between",
        advice="look at the cable and the supply; nothing was sent that moves anything",
        node=axis.spec.node,
    )


def _told(alarms: Collection[str]) -> str:
    return f" (alarms: {', '.join(alarms)})" if alarms else ""


def _cause(alarms: Collection[str], otherwise: str) -> str:
    """Why it does not get there: a device that protects itself pushes with a part of its torque, or not at all."""
    return f"its device protects itself: {', '.join(alarms)}" if PROTECTIVE & set(alarms) else otherwise


def _stands(axis: AxisVerbs, goal: float, presents: Sequence[float]) -> str:
    where = axis.spec.show(presents[-1]) if presents else "a place that is not known"
    return f"{axis.name} is not in position: its goal is {axis.spec.show(goal)}, and it stands at {where}"
