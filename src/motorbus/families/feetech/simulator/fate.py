"""What happens to the servos of a bus by themselves, in order of time: trips, cooling, brown-outs, cut supplies.

Everything that happens so is known in advance, because movements are functions of time. So nothing is done until the
bus is told a later moment than the next of these; then each happens at its own, and the clock of the bus shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.simulator.supply import Supply
from motorbus.families.feetech.simulator.switches import Switches


class Fate:
    """The next moments of some servos. `soon` is no later than the first of them."""

    def __init__(self, servos: Sequence[Servo], switches: Switches) -> None:
        self.soon = inf
        self.supply = Supply(servos, switches) if switches.supply_resistance or switches.brown_out else None
        self._servos = servos
        for servo in servos:
            servo.join(self.expect, self.supply.sag if self.supply else None)

    def expect(self, moment: float) -> None:
        """Something of a servo has changed, and by itself it will do something at this moment."""
        if self.supply:
            self.soon = -inf
        elif moment < self.soon:
            self.soon = moment

    def live(self, to: float, now: float, tell: Callable[[float], None]) -> None:
        """Let everything happen up to this moment; `tell` is given each moment before."""
        while self.soon <= to:
            moment, who = self._first(now)
            if moment > to:
                self.soon = moment
                return
            now = max(now, moment)
            tell(now)
            who.live(now)

    def _first(self, now: float) -> tuple[float, Servo | Supply]:
        servo = min(self._servos, key=lambda one: one.next)
        moment = self.supply.next(now) if self.supply else inf
        return (moment, self.supply) if self.supply and moment < servo.next else (servo.next, servo)
