"""The shaft of one servo and its warmth, as functions of time.

Three ways of counting meet here. The *shaft* is where the output really is, in raw counts, and only motion changes
it. *Zero* is the place of the shaft that reads 0; setting the mid point moves it. The *reading* is what 0x6002
tells: shaft minus zero, with its sign turned in the reversed state.

Speed, acceleration, current and warmth of a real one are told by no source. What is here is an assumption: a
trapezoid; a current that a free motor draws while it turns and that a load adds to; a temperature that rises with
the square of the load and needs a minute for two thirds of the way.
"""

from __future__ import annotations

from math import exp

from motorbus.core.plant import Drive, Motion, move, rest

DRIVE = Drive(top_speed=1.0, idle_current=0.2, stall_current=2.5)
"""Currents in A, an assumption; the speed is `Shaft`'s own affair."""
RISE = 60.0
"""°C above the surroundings that a steady full load ends at, an assumption."""
SLOWNESS = 60.0
"""s for 63 % of that way, an assumption."""


class Shaft:
    """A shaft in raw counts: `speed` in counts/s, `acceleration` in counts/s². `zero` reads 0."""

    def __init__(self, at: float, position: int, *, speed: float, acceleration: float) -> None:
        self.motion: Motion = rest(at, position)
        self.zero = 0
        self.reversed = False
        self._speed = speed
        self._acceleration = acceleration

    def reading(self, at: float) -> int:
        """The present position as the servo tells it: a whole number of counts that fits 16 bits."""
        counts = round(self.motion.position(at)) - self.zero
        return max(-32768, min(32767, -counts if self.reversed else counts))

    def go(self, raw: int, at: float) -> None:
        """To where this is read, from whatever it is doing."""
        self.motion = move(
            at,
            self.motion.position(at),
            self._place(raw),
            velocity=self.motion.velocity(at),
            speed=self._speed,
            acceleration=self._acceleration,
        )

    def halt(self, at: float) -> None:
        """Stand where it is: no supply, and the gear holds."""
        self.motion = rest(at, self.motion.position(at))

    def turn_by_hand(self, raw: int, at: float) -> None:
        """Stand where this is read."""
        self.motion = rest(at, self._place(raw))

    def make_middle(self, at: float) -> None:
        """What it stands at reads 0 from now on, and there it stays."""
        self.zero = round(self.motion.position(at))
        self.turn_by_hand(0, at)

    def _place(self, raw: int) -> int:
        return self.zero + (-raw if self.reversed else raw)


class Warmth:
    """A temperature in °C that follows a load, the share of the full torque; exact at every moment."""

    def __init__(self, surroundings: float) -> None:
        self._surroundings = surroundings
        self._began = 0.0
        self._first = surroundings
        self._load = 0.0

    @property
    def load(self) -> float:
        """The load that it follows just now."""
        return self._load

    def temperature(self, at: float) -> float:
        """How warm it is."""
        end = self._surroundings + RISE * self._load**2
        return end + (self._first - end) * exp(-max(0.0, at - self._began) / SLOWNESS)

    def follow(self, load: float, at: float) -> None:
        """Another load from this moment on."""
        self._first, self._began, self._load = self.temperature(at), at, load

    def become(self, temperature: float, at: float) -> None:
        """It is as warm as this now, and so are its surroundings."""
        self._surroundings = self._first = temperature
        self._began = at
