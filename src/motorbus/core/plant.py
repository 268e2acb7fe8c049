"""How a motor moves, as functions of time that are worked out when somebody asks and never ticked.

A simulated bus may hold 253 servos and be read a thousand times a second or once an hour; with a tick it would
cost the same in both cases and be wrong by the width of the tick in either. So a movement is a value: a few
phases of constant acceleration, made once when a goal is given. Asking where the motor is costs a few
multiplications, and the same question always has the same answer.

Any unit of length does, as long as velocity and acceleration are in it too. Time is in seconds on whatever
clock the caller uses; only differences count.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import copysign, inf, isfinite, sqrt
from typing import Final, NamedTuple

_made: Final = tuple.__new__
"""Makes a named tuple in half the time of its own call: a fleet makes four for every goal of every axis."""


class Phase(NamedTuple):
    """A stretch of constant acceleration: where and how fast it begins, how long it lasts (s)."""

    duration: float
    position: float
    velocity: float
    acceleration: float

    def position_after(self, elapsed: float) -> float:
        """Position `elapsed` seconds into this phase."""
        return self.position + elapsed * (self.velocity + 0.5 * self.acceleration * elapsed)

    def velocity_after(self, elapsed: float) -> float:
        """Velocity `elapsed` seconds into this phase."""
        return self.velocity + self.acceleration * elapsed


class Stretch(NamedTuple):
    """A part of a movement in one direction: from when to when, how fast at its beginning, and how that changes."""

    begin: float
    end: float
    position: float
    velocity: float
    acceleration: float

    @property
    def way(self) -> float:
        """1.0 or -1.0 where it goes, 0.0 where it stands."""
        direction = self.velocity or self.acceleration
        return copysign(1.0, direction) if direction else 0.0


class Motion(NamedTuple):
    """A movement that began at `start` (s) and afterwards is at `goal`, or goes on at `cruise` for ever.

    Before `start` it answers as at `start`, so a question that comes late on a reordered wire is harmless.
    """

    start: float
    phases: tuple[Phase, ...]
    goal: float
    cruise: float = 0.0

    def position(self, at: float) -> float:
        """Where it is at this moment: what most packets ask of every servo."""
        elapsed = at - self.start
        if elapsed < 0.0:
            elapsed = 0.0
        for duration, position, velocity, acceleration in self.phases:
            if elapsed < duration:
                return position + elapsed * (velocity + 0.5 * acceleration * elapsed)
            elapsed -= duration
        return self.goal + self.cruise * elapsed if self.cruise else self.goal

    def velocity(self, at: float) -> float:
        """How fast it is at this moment, with its sign."""
        return self.state(at)[1]

    def acceleration(self, at: float) -> float:
        """How much faster it gets at this moment, with its sign."""
        return self.state(at)[2]

    def state(self, at: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration at this moment."""
        elapsed = at - self.start
        if elapsed < 0.0:
            elapsed = 0.0
        for duration, position, velocity, acceleration in self.phases:
            if elapsed < duration:
                place = position + elapsed * (velocity + 0.5 * acceleration * elapsed)
                return place, velocity + acceleration * elapsed, acceleration
            elapsed -= duration
        return self.goal + self.cruise * elapsed if self.cruise else self.goal, self.cruise, 0.0

    @property
    def peak(self) -> float:
        """The greatest speed with which a phase begins, or that it keeps in the end."""
        greatest = abs(self.cruise)
        for _, _, velocity, _ in self.phases:
            if abs(velocity) > greatest:
                greatest = abs(velocity)
        return greatest

    def moving(self, at: float) -> bool:
        """Whether it has not come to its end yet."""
        return at < self.done_at

    @property
    def done_at(self) -> float:
        """When it comes to rest at its goal; infinity when it never does."""
        return inf if self.cruise else self.start + sum(phase.duration for phase in self.phases)

    def stretches(self, since: float = -inf) -> Iterator[Stretch]:
        """Every part that ends after `since`, in order; the last one, at rest or cruising, ends at infinity."""
        begin = self.start
        for phase in self.phases:
            for stretch in _one_way(begin, phase):
                if stretch.end > since:
                    yield stretch
            begin += phase.duration
        yield Stretch(begin, inf, self.goal, self.cruise, 0.0)


def rest(at: float, position: float) -> Motion:
    """Stand still here: at rest, limp, or held."""
    return Motion(at, (), position)


def move(
    at: float,
    position: float,
    goal: float,
    *,
    velocity: float = 0.0,
    speed: float,
    acceleration: float = inf,
    deceleration: float | None = None,
) -> Motion:
    """Go to `goal` and stop there: a trapezoid, or a triangle where the way is short.

    It may begin with a `velocity`. When that is too high to stop in time it overshoots and comes back; when it
    points away from the goal it brakes first; when it exceeds `speed` it brakes down to it. It brakes with
    `deceleration`, or with `acceleration` where none is given. `acceleration` may be infinite: then velocity changes
    in no time. `speed` 0 brakes to a halt wherever that is. Raises ValueError for a negative or missing figure, for
    an infinite speed with an infinite acceleration, and where only one of the accelerations is infinite.
    """
    _check(speed, acceleration, position, goal, velocity)
    braking = acceleration
    if deceleration is not None:
        _check(speed, deceleration)
        if (deceleration == inf) != (acceleration == inf):
            raise ValueError("acceleration and deceleration are both infinite, or none is")
        braking = deceleration
    if not speed:
        return run(at, position, 0.0, velocity=velocity, acceleration=braking)
    if acceleration == inf:
        return _dash(at, position, goal, speed)
    halt = position + velocity * abs(velocity) / (2 * braking)
    if goal == halt:
        return _braked(at, position, velocity, goal, braking)
    way = copysign(1.0, goal - halt)
    if way * velocity < 0 and braking != acceleration:  # the ramp has a corner where the direction turns
        first = _braked(at, position, velocity, halt, braking)
        back = move(at, halt, goal, speed=speed, acceleration=acceleration, deceleration=braking)
        return Motion(at, first.phases + back.phases, goal)
    square = 2 * acceleration * way * (goal - position) + velocity**2
    share = braking / (acceleration + braking) * square
    peak = sqrt(share) if share > 0.0 else 0.0
    if speed < peak:
        peak = speed
    gaining = acceleration if peak > way * velocity else braking
    return _trapezoid(at, position, velocity, goal, way * peak, gaining, braking, cruises=peak == speed)


def run(
    at: float, position: float, velocity_goal: float, *, velocity: float = 0.0, acceleration: float = inf
) -> Motion:
    """Reach `velocity_goal` and keep it for ever, as a wheel does; 0 brakes to a halt."""
    _check(abs(velocity_goal), acceleration, position, velocity_goal, velocity)
    change = velocity_goal - velocity
    if not change or acceleration == inf:
        return Motion(at, (), position, velocity_goal)
    ramp = Phase(abs(change) / acceleration, position, velocity, copysign(acceleration, change))
    return Motion(at, (ramp,), ramp.position_after(ramp.duration), velocity_goal)


def obstructed(motion: Motion, low: float, high: float) -> Motion:
    """The same movement with obstacles at `low` and `high`: it ends at the one it runs into, at once and at rest.

    Beyond an obstacle only the way back is free. A movement that meets none is given back as it is.
    """
    phases: list[Phase] = []
    for stretch in motion.stretches():
        bound = high if stretch.way > 0 else low
        ahead = (bound - stretch.position) * stretch.way if stretch.way else inf
        time = _time_over(max(0.0, ahead), stretch)
        if time is not None and stretch.begin + time < stretch.end:
            if time:
                phases.append(Phase(time, stretch.position, stretch.velocity, stretch.acceleration))
            return Motion(motion.start, tuple(phases), bound if ahead > 0 else stretch.position)
        if stretch.end < inf:
            phases.append(Phase(stretch.end - stretch.begin, *stretch[2:]))
    return motion


def _one_way(begin: float, phase: Phase) -> Iterator[Stretch]:
    """A phase, cut in two where the direction changes."""
    end = begin + phase.duration
    turn = -phase.velocity / phase.acceleration if phase.acceleration else inf
    if not 0 < turn < phase.duration:
        yield Stretch(begin, end, *phase[1:])
        return
    yield Stretch(begin, begin + turn, *phase[1:])
    yield Stretch(begin + turn, end, phase.position_after(turn), 0.0, phase.acceleration)


def _time_over(distance: float, stretch: Stretch) -> float | None:
    """Seconds until a stretch has covered this distance; None if it never does, whenever it ends."""
    if distance == inf:
        return None
    speed, gain = abs(stretch.velocity), stretch.acceleration * stretch.way
    square = speed**2 + 2 * gain * distance
    if square < 0 or not (speed or gain):
        return None
    return 2 * distance / (speed + sqrt(square)) if distance else 0.0


def _check(speed: float, acceleration: float, *finite: float) -> None:
    if not all(map(isfinite, finite)):
        raise ValueError("position, goal and velocity must be finite")
    if not speed >= 0 or not acceleration > 0:
        raise ValueError("speed must be 0 or more, acceleration more than 0")
    if speed == acceleration == inf:
        raise ValueError("speed and acceleration cannot both be infinite")


def _dash(at: float, position: float, goal: float, speed: float) -> Motion:
    """Without inertia: full speed from the first moment to the last."""
    way = goal - position
    return Motion(at, (Phase(abs(way) / speed, position, copysign(speed, way), 0.0),) if way else (), goal)


def _braked(at: float, position: float, velocity: float, goal: float, acceleration: float) -> Motion:
    """Braking at once ends exactly at the goal."""
    if not velocity:
        return rest(at, goal)
    return Motion(
        at,
        (Phase(abs(velocity) / acceleration, position, velocity, -copysign(acceleration, velocity)),),
        goal,
    )


def _trapezoid(
    at: float,
    position: float,
    velocity: float,
    goal: float,
    peak: float,
    acceleration: float,
    deceleration: float,
    *,
    cruises: bool,
) -> Motion:
    """To the velocity `peak`, along at it if it is the highest allowed, and down to nothing at the goal."""
    gain = peak - velocity
    ramp, slope = abs(gain) / acceleration, copysign(acceleration, gain)
    reached = position + ramp * (velocity + 0.5 * slope * ramp)
    braking = goal - peak * abs(peak) / (2 * deceleration)
    phases: tuple[Phase, ...] = (_made(Phase, (ramp, position, velocity, slope)),) if ramp else ()
    # A triangle has no cruise: there the difference is rounding, and divided by a tiny peak it would be ages.
    if cruises and (cruise := (braking - reached) / peak) > 0.0:
        phases += (_made(Phase, (cruise, reached, peak, 0.0)),)
    if brake := abs(peak) / deceleration:
        phases += (_made(Phase, (brake, braking, peak, -copysign(deceleration, peak))),)
    return _made(Motion, (at, phases, goal, 0.0))


@dataclass(frozen=True, slots=True)
class Drive:
    """The electrical side of a motor, as far as a plausible reading needs it.

    `top_speed` is what it reaches without load at full duty; `idle_current` (A) flows while it turns without
    load and `stall_current` (A) at full torque. `torque` below is the share of the stall torque that the
    outside takes, signed like velocity.
    """

    top_speed: float
    idle_current: float
    stall_current: float

    def duty(self, velocity: float, torque: float = 0.0) -> float:
        """Share of the supply the driver must switch through, -1 to 1: what FEETECH calls load."""
        return max(-1.0, min(1.0, velocity / self.top_speed + torque))

    def current(self, velocity: float, torque: float = 0.0) -> float:
        """Supply current in A, signed like the effort."""
        idle = copysign(self.idle_current, velocity) if velocity else 0.0
        return idle + self.stall_current * torque
