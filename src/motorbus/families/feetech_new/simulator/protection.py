"""What makes a servo report alarms and let go: overload, supply, temperature.

Overload: more than register 36 (SCS: 39) for the time of register 35 (SCS: 38), then the torque falls to register 34
(SCS: 37). HLS servos have no such registers and let go at more than the protection current; on other maps that is left
out. An alarm that the unload mask (19) does not name changes nothing else. Source: STS3215 memory table V3.6, SCS and
HLS memory tables.
"""

from __future__ import annotations

from math import inf

from motorbus.core.plant import Drive
from motorbus.families.feetech_new.simulator.memory import Memory
from motorbus.families.feetech_new.simulator.motor import Course

VOLTAGE, HEAT, CURRENT, OVERLOAD = 0x01, 0x04, 0x08, 0x20  # alarm bits


class Overload:
    """The overload protection of one servo; shares are of the stall torque.

    `bit` is its alarm; `tripped` lasts until `clear`; `next` is the moment (s) of the next trip, inf without one.
    """

    def __init__(self, memory: Memory, drive: Drive) -> None:
        self._memory = memory
        self._table = memory.layout.table
        self._by_torque = "overload_torque" in self._table
        self._stall_current = drive.stall_current
        self.bit = OVERLOAD if self._by_torque else CURRENT
        self.clear()

    def clear(self) -> None:
        """Start again."""
        self.tripped = False
        self.next = inf
        self._span = inf, inf  # in which the torque is above the limit

    @property
    def torque(self) -> float:
        """The share that it leaves."""
        if not self.tripped:
            return 1.0
        return self._value("protective_torque") if self._by_torque else 0.0

    def watch(self, course: Course, at: float) -> None:
        """Take the course that the motor follows from this moment (s) on."""
        if self._by_torque:
            limit, patience = self._value("overload_torque"), self._value("overload_time")
        else:
            limit = self._value("protection_current") / self._stall_current
            patience = self._value("overcurrent_time")
        begin, until = inf, inf
        if limit and patience:  # 0 protects from nothing # assumption
            lasts = abs(course.torque(inf)) > limit
            if abs(course.load) > limit:
                begin, until = at, inf if lasts else course.motion.done_at
            elif lasts:
                begin = max(at, course.motion.done_at)
        first, last = self._span
        if begin == at and first <= at <= last:
            begin = first  # above the limit without a break
        self._span = begin, until
        trip = begin + patience
        self.next = max(at, trip) if trip <= until and not self.tripped else inf

    def _value(self, name: str) -> float:
        return self._memory[name] * self._table[name].scale
