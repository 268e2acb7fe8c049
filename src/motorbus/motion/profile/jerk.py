"""Following a goal with limited jerk. The only file that imports ruckig, and only when a follower is made with a jerk.

ruckig works out the quickest movement from any state of motion in under a microsecond. It is an extra and never needed:
there is no wheel of it for Linux on ARM, as on a Raspberry Pi, and there it would have to be compiled.
"""

from __future__ import annotations

from math import isfinite
from typing import Any, Final

from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.profile.following import check_elapsed
from motorbus.motion.profile.shapes import NOTHING, Limits

INSTALL: Final = "pip install 'motorbus[ruckig]'"
ON_ARM: Final = "on Linux for ARM there is no wheel of it, and the extra leaves it out"


class JerkFollower:
    """Follows with limited velocity, acceleration and jerk; see `Follower`.

    Of acceleration and deceleration the smaller one holds for both. Raises MotorbusError where ruckig is not installed
    and RequestError for figures that are not finite or not above 0.
    """

    def __init__(self, position: float, limits: Limits, jerk: float) -> None:
        self._ruckig = _ruckig()
        self._engine = self._ruckig.Ruckig(1)
        self._given = self._ruckig.InputParameter(1)
        acceleration = min(limits.acceleration, limits.braking)
        for name, figure in (
            ("velocity", limits.velocity),
            ("acceleration", acceleration),
            ("jerk", jerk),
        ):
            if not (isfinite(figure) and figure > 0):
                raise RequestError(f"{name} is {figure}", expected="a finite number above 0", advice=NOTHING)
            setattr(self._given, f"max_{name}", [figure])
        self._way: Any = None
        self._goal, self._since = position, 0.0
        self._state = (position, 0.0, 0.0)
        self.reset(position)

    @property
    def position(self) -> float:
        """Where it is now."""
        return self._state[0]

    @property
    def velocity(self) -> float:
        """How fast it is now, with its sign."""
        return self._state[1]

    @property
    def acceleration(self) -> float:
        """How much faster it gets now, with its sign."""
        return self._state[2]

    @property
    def goal(self) -> float:
        """Where it is going."""
        return self._goal

    @property
    def arrived(self) -> bool:
        """Whether it is at rest at its goal."""
        return self._state == (self._goal, 0.0, 0.0)

    def step(self, elapsed: float, goal: float | None = None) -> float:
        """The position `elapsed` seconds later, on the way to `goal`, or to the one it has; see `Follower`."""
        check_elapsed(elapsed)
        if goal is not None and goal != self._goal:
            self._way, self._since, self._goal = self._towards(goal), 0.0, goal
        self._since += elapsed
        self._state = self._now()
        return self.position

    def halt(self) -> None:
        """Brake from now on, within the jerk too; see `Follower`."""
        self._given.control_interface = self._ruckig.ControlInterface.Velocity
        self._given.target_velocity = [0.0]
        try:
            self._way = self._towards(self._goal)
        finally:
            self._given.control_interface = self._ruckig.ControlInterface.Position
        self._since, self._goal = 0.0, self._way.at_time(self._way.duration)[0][0]

    def reset(self, position: float) -> None:
        """Be at rest at another position."""
        if not isfinite(position):
            raise RequestError(f"position is {position}", expected="a finite number", advice=NOTHING)
        self._state = (position, 0.0, 0.0)
        self._goal, self._since, self._way = position, 0.0, None

    def _towards(self, goal: float) -> Any:
        if not isfinite(goal):
            raise RequestError(f"goal is {goal}", expected="a finite number", advice=NOTHING)
        given = self._given
        given.current_position = [self._state[0]]
        given.current_velocity = [self._state[1]]
        given.current_acceleration = [self._state[2]]
        given.target_position = [goal]
        way = self._ruckig.Trajectory(1)
        result = self._engine.calculate(given, way)
        if result not in (self._ruckig.Result.Working, self._ruckig.Result.Finished):
            raise RequestError(f"ruckig found no way to {goal}: {result}", expected="a goal", advice=NOTHING)
        return way

    def _now(self) -> tuple[float, float, float]:
        if self._way is None or self._since >= self._way.duration:
            return (self._goal, 0.0, 0.0)
        position, velocity, acceleration = self._way.at_time(self._since)
        return position[0], velocity[0], acceleration[0]


def _ruckig() -> Any:
    try:
        import ruckig  # type: ignore[import-not-found]
    except ImportError as missing:
        raise MotorbusError(
            "ruckig is not installed, so jerk cannot be limited",
            cause=ON_ARM,
            advice=f"{INSTALL} (on ARM: pip install ruckig, which needs a C++ compiler), or leave jerk out",
        ) from missing
    return ruckig
