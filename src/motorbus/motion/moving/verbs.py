"""Moving axes to where they shall be: several as one movement, a pose, a trajectory, or a single one.

What a movement shall be is said here, and what refuses it; how it is carried out is said in `journey`. All of these
raise what is wrong with them before anything is sent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import copysign, isfinite
from typing import TYPE_CHECKING, NamedTuple

from motorbus.core.register import shown
from motorbus.core.steps import catch
from motorbus.errors import RequestError
from motorbus.motion import limits, reckoning
from motorbus.motion.moving.along import Along, Approach, Paced
from motorbus.motion.moving.journey import Journey
from motorbus.motion.moving.moved import Arrived, Moved
from motorbus.motion.moving.plan import Fact, Planned
from motorbus.motion.moving.stream import USUAL
from motorbus.motion.parallel import Parallel
from motorbus.motion.profile import Kind, Limits, Move, Profile, Synchronised, synchronised
from motorbus.motion.profile.shapes import NOTHING
from motorbus.motion.profile.together import KINDS
from motorbus.motion.trajectory import Course, Interpolation, Trajectory
from motorbus.motion.trajectory.samples import check_kind

if TYPE_CHECKING:
    from motorbus.motion.body import Body
    from motorbus.motion.capabilities import AxisVerbs


# -- what a movement shall be ------------------------------------------------------------------------------------------


class Crisp(NamedTuple):
    """A synchronised movement whose ends can be seen: what an axis is told at first and at last is more than nothing.

    A gentle profile begins with less than the device can be told, so for a while nothing would move, in an axis with a
    short way the longer. So from the first order on an axis is at least one `grain` (rad, m) on its way, and it goes
    the last one when all the others end too.
    """

    whole: Synchronised
    grains: Mapping[str, float]

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        return self.whole.duration

    def positions(self, at: float) -> dict[str, float]:
        """Where each axis shall be `at` seconds after the beginning (rad, m)."""
        if not 0 < at < self.whole.duration:
            return self.whole.positions(at)
        return {
            name: _within(profile, profile.position(at), self.grains[name])
            for name, profile in self.whole.profiles.items()
        }


def _within(profile: Profile, place: float, grain: float) -> float:
    """A place on the way that is a grain from its beginning, and from its end unless it is so short."""
    way = profile.goal - profile.start
    if abs(way) <= grain:
        return profile.goal
    done = (place - profile.start) * copysign(1.0, way)
    done = max(grain, min(done, abs(way) - grain))
    return profile.start + copysign(done, way)


class PointToPoint(NamedTuple):
    """From where the axes stand to these goals: places, or ways from there; (rad, m). See `journey.Plan`."""

    axes: Mapping[str, AxisVerbs]
    goals: Mapping[str, Callable[[float], float]]
    limits: Mapping[str, Limits]
    kind: Kind = "trapezoid"
    asked: float | None = None

    def planned(self, facts: Mapping[str, Fact], duration: float | None = None) -> Planned:
        """The movement; raises LimitExceeded for a goal that an axis or its device does not allow."""
        goals = {name: goal(facts[name].position) for name, goal in self.goals.items()}
        for name, goal in goals.items():
            axis, fact = self.axes[name], facts[name]
            at_once = None if "stream" in axis.able else fact.position
            limits.check_goal(name, axis.spec, goal, measured=at_once, device=fact.device)
        moves = {name: Move(facts[name].position, goal, self.limits[name]) for name, goal in goals.items()}
        whole = synchronised(moves, kind=self.kind, duration=duration)
        grains = {name: facts[name].grain / abs(axis.spec.ratio) for name, axis in self.axes.items()}
        speeds = {name: profile.peak for name, profile in whole.profiles.items()}
        ways = {name: abs(move.goal - move.start) for name, move in moves.items()}
        return Planned(Crisp(whole, grains), goals, ways, speeds, self.limits, whole.limited_by)


# -- several axes ------------------------------------------------------------------------------------------------------


def move(
    body: Body,
    goals: Mapping[str, float],
    *,
    duration: float | None = None,
    kind: Kind = "trapezoid",
    speed: float = 1.0,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Parallel[Moved]:
    """Move axes to these goals (rad, m, by their names): all begin together and all end together.

    It is as quick as the slowest axis can, or takes `duration` (s). `speed` (above 0, at most 1) makes all of it so
    much slower: with 0.5 it takes twice the time. `kind` is `trapezoid`, or `minimum_jerk`, which is gentler; an axis
    whose device has a profile of its own moves by that. Each that measures where it is must be within `tolerance` (rad,
    m) of its goal `timeout` s after the end; without these 0.02 rad of its device, or less on a tiny way, and 1 s.

    Raises before anything moves: RequestError for a name that is no axis and for a duration that is too short,
    LimitExceeded for a goal, NotHomed for an axis of which nobody knows where it is, NoReply. When anything goes wrong
    on the way, all axes are stopped and that is raised: Stalled, NoReply, Interrupted by a stop or another order,
    Faulted for a device that has restarted or let go, Overloaded for one that pushes too hard for too long or is hot.
    """
    _check_end(tolerance, timeout)
    made = _moving(body, goals, duration, kind, speed)
    return Journey(*made, tolerance=tolerance, timeout=timeout).work()


def pose(
    body: Body,
    name: str,
    *,
    duration: float | None = None,
    kind: Kind = "trapezoid",
    speed: float = 1.0,
) -> Parallel[Moved]:
    """Move to a pose of the machine file; see `move`. Raises RequestError when there is none of this name."""
    return move(body, body.machine.pose(name), duration=duration, kind=kind, speed=speed)


def park(
    body: Body,
    names: str | Iterable[str] | None = None,
    *,
    duration: float | None = None,
    kind: Kind = "trapezoid",
    speed: float = 1.0,
) -> Parallel[Moved]:
    """Move axes to where the machine file says that they park; see `move`. Without names, all that have such a place.

    Raises RequestError for an axis that has none, and when none has one.
    """
    axes = body.chosen(names)
    places = {name: axis.spec.park for name, axis in axes.items()}
    goals = {name: place for name, place in places.items() if place is not None}
    missing = [name for name in places if name not in goals]
    if missing and (names is not None or not goals):
        raise RequestError(
            f"{', '.join(missing)} has no place to park",
            expected="axes with `park` in the machine file",
            advice=f'add one, as park = "0 {axes[missing[0]].spec.unit}"; {NOTHING}',
        )
    return move(body, goals, duration=duration, kind=kind, speed=speed)


def replay(
    body: Body,
    trajectory: Course,
    *,
    speed: float = 1.0,
    rate: float | None = None,
    interpolation: Interpolation = "spline",
) -> Parallel[Moved]:
    """Go along a trajectory: first to its beginning in one movement, then as it says. Its goals leave at `rate` (Hz).

    `speed` (above 0) is how much faster it goes: 0.5 takes twice the time. Samples of a `Trajectory` are joined by
    `interpolation`, see `Trajectory.joined`. What comes back is of the trajectory, without the way to its beginning.

    Raises RequestError for an axis that cannot be led: a device that moves by a profile of its own goes from point to
    point only. Raises LimitExceeded for the first goal that would go beyond a limit; else as `move`.
    """
    plan, first = _replayed(body, trajectory, speed, rate, interpolation)
    axes, way, origins = _moving(body, first, None, "trapezoid", min(speed, 1.0))
    approach = Journey(axes, Approach(way, plan), origins, rate)
    journey = Journey(plan.axes, plan, body.origins, rate)
    buses = dict.fromkeys(axis.spec.bus for axis in plan.axes.values())

    async def on(bus: str) -> list[object]:
        try:
            await approach.on(bus)
        except BaseException as error:
            journey.fail(approach.fate.failure or error)
            journey.unstopped.update(approach.unstopped)
            raise
        return list(await journey.on(bus))

    return Parallel({bus: on(bus) for bus in buses}, journey.combine)


def _moving(
    body: Body, goals: Mapping[str, float], duration: float | None, kind: Kind, speed: float
) -> tuple[Mapping[str, AxisVerbs], PointToPoint, Mapping[str, float]]:
    """What a journey to these goals is made of, as far as it can be judged without asking anybody."""
    if not isinstance(goals, Mapping):
        raise RequestError(
            f"{shown(goals)} is not a mapping of goals", expected='as {"shoulder": 0.5}', advice=NOTHING
        )
    if not goals:
        raise RequestError("no axis is named", expected="a goal for one or more", advice=NOTHING)
    axes = {name: body.axis(name) for name in goals}
    own = {name: limits.limits_for(name, axis.spec, speed=speed) for name, axis in axes.items()}
    _check(kind, duration)
    for name, goal in goals.items():
        limits.check_goal(name, axes[name].spec, goal)
    return (
        axes,
        PointToPoint(axes, {name: _to(goal) for name, goal in goals.items()}, own, kind, duration),
        body.origins,
    )


def _replayed(
    body: Body, course: Course, speed: float, rate: float | None, kind: Interpolation
) -> tuple[Along, Mapping[str, float]]:
    """What a replay is made of, and where it begins."""
    limits.check_number("speed", speed)
    if not (isfinite(speed) and speed > 0):
        raise RequestError(f"speed is {speed}", expected="a finite number above 0", advice=NOTHING)
    if rate is not None:
        limits.check_number("rate", rate)
    check_kind(kind)
    way = course.joined(kind) if isinstance(course, Trajectory) else course
    first = way.positions(0.0)
    axes = {name: body.axis(name) for name in first}
    for name, axis in axes.items():
        if "stream" not in axis.able:
            raise RequestError(
                f"{name} cannot go along a trajectory: {axis.spec.device} moves by a profile of its own",
                expected="axes that can be led",
                advice=f"leave it out, and move it from point to point; {NOTHING}",
            )
    plan = Along(axes, Paced(way, speed))
    plan.led(USUAL if rate is None else rate, axes)  # what is wrong for sure is told without asking anybody
    return plan, first


# -- one axis ----------------------------------------------------------------------------------------------------------


async def move_axis(
    axis: AxisVerbs,
    to: float,
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    duration: float | None = None,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Moved:
    """Move to a position (rad, m) within a velocity and an acceleration (rad/s, m/s and per s²), and those of the axis.

    As quick as these allow, or in `duration` (s). Returns when it is there; `tolerance` and `timeout` as in
    `Robot.move`. Raises as `Robot.move`, and LimitExceeded
    for a velocity or an acceleration above that of the axis.
    """
    limits.check_goal(axis.name, axis.spec, to)
    own = limits.limits_for(axis.name, axis.spec, velocity=velocity, acceleration=acceleration)
    _check_end(tolerance, timeout)
    return await _alone(axis, _to(to), own, duration, tolerance=tolerance, timeout=timeout)


async def move_by(axis: AxisVerbs, way: float, *, velocity: float | None = None) -> float:
    """Move by so far (rad, m) from where it is, at so much (rad/s, m/s; None: the fastest that the axis may).

    Returns the way that was gone: measured, or *estimated* where the device does not tell where it is. Such an axis may
    be moved by a way also while nobody knows where it is. Raises as `move`.
    """
    if "stream" not in axis.able:
        return await reckoning.move_by(axis, way, velocity=velocity)
    limits.check_finite(axis.name, "way", way)
    own = limits.limits_for(axis.name, axis.spec, velocity=velocity)
    return _gone((await _alone(axis, _by(way), own)).axes[axis.name])


async def _alone(
    axis: AxisVerbs,
    goal: Callable[[float], float],
    own: Limits,
    duration: float | None = None,
    **end: float | None,
) -> Moved:
    _check("trapezoid", duration)
    axes = {axis.name: axis}
    plan = PointToPoint(axes, {axis.name: goal}, {axis.name: own}, "trapezoid", duration)
    journey = Journey(axes, plan, {axis.spec.bus: 0.0}, **end)
    told = await catch(journey.on(axis.spec.bus))
    return journey.combine({axis.spec.bus: told})


def _gone(arrived: Arrived) -> float:
    """How far it has gone (rad, m)."""
    return arrived.present - arrived.stood


def _to(goal: float) -> Callable[[float], float]:
    return lambda _: goal


def _by(way: float) -> Callable[[float], float]:
    return lambda start: start + way


def _check_end(tolerance: float | None, timeout: float | None) -> None:
    for name, value in (("tolerance", tolerance), ("timeout", timeout)):
        if value is None:
            continue
        limits.check_number(name, value)
        if not (isfinite(value) and value > 0):
            raise RequestError(f"{name} is {value}", expected="a finite number above 0", advice=NOTHING)


def _check(kind: Kind, duration: float | None) -> None:
    if kind not in KINDS:
        raise RequestError(f"{kind!r} is no kind of profile", expected=" or ".join(KINDS), advice=NOTHING)
    if duration is None:
        return
    limits.check_number("duration", duration)
    if not (isfinite(duration) and duration > 0):
        raise RequestError(f"duration is {duration}", expected="a finite number of s above 0", advice=NOTHING)
