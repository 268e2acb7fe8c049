"""One supply for all servos: it sags with their current, and where it sags too low a servo starts anew.

Each servo has its own threshold, so a sag that is deep enough for some is not for others (orcahand/orca_core#89: random
ones vanish). Those with the highest fall first, and as they fall limp they draw no current any more, which may save
the others. Currents change only where a movement changes its direction or ends, so the moment of a fall is found
without a tick.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from random import Random

from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.simulator.switches import Switches


class Supply:
    """What the servos of one bus share: supply and cables of `resistance` ohm. It gives each servo its `threshold`."""

    def __init__(self, servos: Sequence[Servo], switches: Switches) -> None:
        random = Random(switches.seed)
        self.resistance = switches.supply_resistance
        self._servos = servos
        self._falls = switches.brown_out > 0
        self._fallen: set[Servo] = set()
        if self._falls:
            for servo in servos:
                servo.threshold = switches.brown_out + switches.brown_out_spread * (2 * random.random() - 1)

    def sag(self, at: float) -> float:
        """By how many V it is lower at this moment than without current."""
        if not self.resistance:
            return 0.0
        return self.resistance * sum(abs(servo.current(at)) for servo in self._servos if servo.plugged)

    def next(self, since: float) -> float:
        """When the next servo falls, if nothing else happens; infinity when none does."""
        if not self._falls:
            return inf
        sag = self.sag(since)
        self._fallen = {servo for servo in self._fallen if servo.open_voltage - sag < servo.threshold}
        moments = {moment for servo in self._servos for moment in servo.turning_points(since)}
        return next((at for at in sorted({since, *moments}) if self._weak(at)), inf)

    def live(self, at: float) -> None:
        """Whoever falls at this moment falls, the one with the highest threshold first."""
        while weak := self._weak(at):
            servo = max(weak, key=lambda one: one.threshold)
            self._fallen.add(servo)
            servo.brown_out(at)

    def _weak(self, at: float) -> list[Servo]:
        sag = self.sag(at)
        return [
            servo
            for servo in self._servos
            if servo.plugged and servo.open_voltage - sag < servo.threshold and servo not in self._fallen
        ]
