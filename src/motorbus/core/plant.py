"""Motion of a simulated motor as a function of time, evaluated on demand without a tick.

A movement is a value: a few phases of constant acceleration, computed once per goal. A reading costs a few
multiplications and has no error of a time step, for 253 servos read 1000 times per second or once per hour.

Length has any unit; velocity and acceleration use the same one. Time is in s on the clock of the caller; only
differences matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, inf, sqrt
from typing import NamedTuple


class Phase(NamedTuple):
    """A time of constant acceleration: its duration (s), then position, velocity and acceleration at its start."""

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


class Motion(NamedTuple):
    """A movement from `start` (s) on. After its phases it stays at `goal`, or moves on from there at `cruise`.

    Before `start` the state is that at `start`: a request that a reordering line delivers late gets this state.
    """

    start: float
    phases: tuple[Phase, ...]
    goal: float
    cruise: float = 0.0

    def position(self, at: float) -> float:
        """Position at this moment (s)."""
        return self.state(at)[0]

    def velocity(self, at: float) -> float:
        """Signed velocity at this moment (s)."""
        return self.state(at)[1]

    def state(self, at: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration at this moment (s)."""
        elapsed = max(0.0, at - self.start)
        for phase in self.phases:
            if elapsed < phase.duration:
                return phase.position_after(elapsed), phase.velocity_after(elapsed), phase.acceleration
            elapsed -= phase.duration
        return self.goal + self.cruise * elapsed if self.cruise else self.goal, self.cruise, 0.0

    @property
    def peak(self) -> float:
        """The highest speed at the start of a phase or after the last one."""
        return max([abs(self.cruise), *(abs(phase.velocity) for phase in self.phases)])

    def moving(self, at: float) -> bool:
        """Whether the movement is not yet at its end at this moment (s)."""
        return at < self.done_at

    @property
    def done_at(self) -> float:
        """Moment (s) at which it comes to rest at the goal; inf if it never does."""
        return inf if self.cruise else self.start + sum(phase.duration for phase in self.phases)


def rest(at: float, position: float) -> Motion:
    """No movement: at rest, without torque, or held."""
    return Motion(at, (), position)


def move(
    at: float,
    position: float,
    goal: float,
    *,
    velocity: float = 0.0,
    speed: float,
    acceleration: float = inf,
) -> Motion:
    """Move to `goal` and stop there: a trapezoid of velocity, or a triangle over a short distance.

    With an initial `velocity` too high to stop at the goal it overshoots and returns. An initial velocity away from the
    goal, or above `speed`, is braked first. With infinite `acceleration` the velocity changes at once. `speed` 0 brakes
    to a halt anywhere.
    The caller gives finite values, except for `acceleration`, which is above 0.
    """
    if not speed:
        return run(at, position, 0.0, velocity=velocity, acceleration=acceleration)
    if acceleration == inf:
        distance = goal - position
        full_speed = Phase(abs(distance) / speed, position, copysign(speed, distance), 0.0)
        return Motion(at, (full_speed,) if distance else (), goal)
    halt = position + velocity * abs(velocity) / (2 * acceleration)
    if goal == halt:  # braking at once ends exactly there
        brake = Phase(abs(velocity) / acceleration, position, velocity, -copysign(acceleration, velocity))
        return Motion(at, (brake,) if velocity else (), goal)
    way = copysign(1.0, goal - halt)
    square = 2 * acceleration * way * (goal - position) + velocity**2
    peak = min(speed, sqrt(max(0.0, 0.5 * square)))
    cruises = peak == speed
    peak *= way
    gain = peak - velocity
    ramp, slope = abs(gain) / acceleration, copysign(acceleration, gain)
    reached = position + ramp * (velocity + 0.5 * slope * ramp)
    brakes_at = goal - peak * abs(peak) / (2 * acceleration)
    phases: tuple[Phase, ...] = (Phase(ramp, position, velocity, slope),) if ramp else ()
    # A triangle has no cruise: its difference is a rounding error, which a tiny peak would turn into a long time.
    if cruises and (cruise := (brakes_at - reached) / peak) > 0.0:
        phases += (Phase(cruise, reached, peak, 0.0),)
    if brake_time := abs(peak) / acceleration:
        phases += (Phase(brake_time, brakes_at, peak, -copysign(acceleration, peak)),)
    return Motion(at, phases, goal)


def run(
    at: float, position: float, velocity_goal: float, *, velocity: float = 0.0, acceleration: float = inf
) -> Motion:
    """Accelerate to `velocity_goal` and keep it without end, as a wheel; 0 brakes to a halt."""
    change = velocity_goal - velocity
    if not change or acceleration == inf:
        return Motion(at, (), position, velocity_goal)
    ramp = Phase(abs(change) / acceleration, position, velocity, copysign(acceleration, change))
    return Motion(at, (ramp,), ramp.position_after(ramp.duration), velocity_goal)


@dataclass(frozen=True, slots=True)
class Drive:
    """Electrical model of a motor, for plausible readings.

    `torque` of the methods is the external load as a fraction of the stall torque, signed like velocity.
    """

    top_speed: float  # without load at full duty
    idle_current: float  # A without load
    stall_current: float  # A at full torque

    def duty(self, velocity: float, torque: float = 0.0) -> float:
        """Duty cycle of the motor voltage, -1 to 1; FEETECH calls it load."""
        return max(-1.0, min(1.0, velocity / self.top_speed + torque))

    def current(self, velocity: float, torque: float = 0.0) -> float:
        """Supply current (A), signed like the effort."""
        idle = copysign(self.idle_current, velocity) if velocity else 0.0
        return idle + self.stall_current * torque
