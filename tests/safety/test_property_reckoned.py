"""Whatever anybody calls on an axis that does not tell where it is: while that is known, it does not leave its limits.

Judged by the motor itself, which the simulated controller turns. The account of the host and the motor must agree as
long as the host says that it knows, whoever moved the motor, and what is allowed does move it.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, nan, tau
from random import Random
from typing import Any

import pytest

from motorbus.errors import MotorbusError
from motorbus.session.robot import Robot
from tests.support.machines import machine

PULSES = 1600
"""Of a turn: 200 full steps in 8 microsteps."""
TRAVEL = 0.005
"""m of a turn."""
LOW, HIGH, STEP = 0.0, 0.2, 0.08
"""m, as the file says."""
PULSE = TRAVEL / PULSES
SURELY = 0.0005
"""m from every bound from which on nobody can be in doubt."""
HUGE = 10**400
ODD = (nan, inf, -inf, 1e308, HUGE, None, True, "0.01", 0.3, -0.3)
CALLS = 100
"""Of one seed; after so many a new machine is opened."""
SLOW = 50
"""A controller takes so much longer for a call than a servo."""


class Caller:
    """Draws calls and judges where the motor stands."""

    def __init__(self, robot: Robot, controller: Any, seed: int) -> None:
        self.lift: Any = robot["lift"]
        self.robot = robot
        self.controller = controller
        self.chance = Random(seed)
        self.zero = 0.0
        self.moved = self.refused = self.lost = 0
        self.seen()

    def place(self) -> float:
        """Where it really is (m)."""
        return int(self.controller.status()["load"]) * PULSE - self.zero

    def seen(self) -> None:
        """A person puts it somewhere, looks, and says where it stands."""
        stands = self.chance.uniform(LOW, HIGH)
        self.zero += self.place() - stands
        self.lift.stop()  # nobody else knows when what was ordered of its device has come to its end
        self.lift.declare(stands)

    def way(self) -> Any:
        """How far: near, to the other end, too far, nowhere."""
        kind = self.chance.randrange(8)
        if kind == 0:
            return self.chance.choice(ODD)
        if kind < 4:
            return self.chance.choice((LOW, HIGH)) - self.place() + self.chance.uniform(-0.01, 0.01)
        return self.chance.uniform(-1.1, 1.1) * STEP

    def call(self) -> None:
        """One call by any spelling, and what must become of it."""
        way, before = self.way(), self.place()
        others = (self.by_robot, self.by_device, self.jog, self.jog_device)  # which reckon with it
        verb = self.chance.choice((self.by_axis, *(others if way != HUGE else ())))
        known = self.lift.estimated is not None
        try:
            verb(way)
            refused = False
        except (MotorbusError, TypeError, ValueError):
            refused = True
        self.judge(verb, way, before, known, refused)

    def judge(
        self, verb: Callable[[Any], object], way: Any, before: float, known: bool, refused: bool
    ) -> None:
        after = self.place()
        if refused:
            assert after == before, (verb, way)
            self.refused += 1
        else:
            assert abs(after - before - way) < 20 * PULSE, (verb, way, after - before)
            self.moved += 1
        if known:
            assert LOW - 20 * PULSE <= after <= HIGH + 20 * PULSE, (verb, way, before)
            assert refused == (not self.allowed(way, before)) or self.in_doubt(way, before), (verb, way)
        if self.lift.estimated is not None:
            assert abs(self.lift.estimated - after) < SURELY
        elif not refused:
            self.lost += 1

    def allowed(self, way: Any, before: float) -> bool:
        number = isinstance(way, int | float) and not isinstance(way, bool) and abs(way) < 1e300
        return number and isfinite(way) and abs(way) <= STEP and LOW <= before + way <= HIGH

    def in_doubt(self, way: Any, before: float) -> bool:
        """So near to a bound that rounding decides, or too small a way for a device to be worth an order."""
        number = isinstance(way, int | float) and isfinite(way)
        bounds = (abs(way) - STEP, before + way - LOW, before + way - HIGH, way) if number else ()
        return any(abs(one) < SURELY for one in bounds)

    # -- spellings -----------------------------------------------------------------------------------------------------

    def by_axis(self, way: Any) -> object:
        return self.lift.move_by(way)

    def by_robot(self, way: Any) -> object:
        return self.robot.move({"lift": way + self.lift.reckoning.known("lift")})

    def by_device(self, way: Any) -> object:
        return self.lift.device.move_by(way / TRAVEL * tau)

    def jog(self, way: Any) -> object:
        return self.lift.jog(0.01 if way > 0 else -0.01, abs(way) / 0.01)

    def jog_device(self, way: Any) -> object:
        velocity = tau * 2
        return self.lift.device.jog(velocity if way > 0 else -velocity, abs(way) / TRAVEL * tau / velocity)


@pytest.mark.timeout(0)
def test_while_it_is_known_where_it_is_it_keeps_within_its_limits(rounds: Callable[[int], int]) -> None:
    calls = rounds(1_000_000) // SLOW
    left, seed, tally = calls, 0, [0, 0, 0]
    while left > 0:
        seed += 1
        axes = {"lift": {"low": f"{LOW} m", "high": f"{HIGH} m", "max_step": f"{STEP} m"}}
        with machine(lift=True, axes=axes) as (made, sims), Robot.of(made) as robot:
            caller = Caller(robot, sims["stage"][1], seed)
            for _ in range(min(left, CALLS)):
                caller.call()
                if robot["lift"].estimated is None or caller.chance.random() < 0.05:
                    caller.seen()
        left -= CALLS
        tally = [
            total + one for total, one in zip(tally, (caller.moved, caller.refused, caller.lost), strict=True)
        ]
    assert min(tally) > calls / 20, tally
    print(f"{tally[0]} moved, {tally[1]} refused, {tally[2]} unknown afterwards")
