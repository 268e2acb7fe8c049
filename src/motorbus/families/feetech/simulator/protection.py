"""What makes a servo report alarms and release its torque: overload, supply, temperature.

Overload: more than register 36 (SCS: 39) for the time of register 35 (SCS: 38), then the torque falls to
register 34 (SCS: 37). HLS servos have no such registers. Over-current is left out. An alarm that the unload
mask (19) does not name changes nothing else. Source: STS3215 memory table V3.6, SCS memory table 1902.
"""

from __future__ import annotations

from math import inf

from motorbus.families.feetech.simulator.memory import Memory
from motorbus.families.feetech.simulator.motor import Course

VOLTAGE, HEAT, OVERLOAD = 0x01, 0x04, 0x20  # alarm bits
LATCHED = OVERLOAD | 0x08  # with over-current: alarms that last when their cause has gone


class Overload:
    """The overload protection of one servo.

    `tripped` lasts until `clear`; `next` is the moment (s) of the next trip, inf without one.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.clear()

    def clear(self) -> None:
        """Start again."""
        self.tripped = False
        self.next = inf
        self._span = inf, inf  # in which the torque is above the limit

    @property
    def torque(self) -> float:
        """Share of the stall torque that it leaves."""
        return self._value("protective_torque") if self.tripped else 1.0

    def watch(self, course: Course, at: float) -> None:
        """Take the course that the motor follows from this moment (s) on."""
        limit, duration = self._value("overload_torque"), self._value("overload_time")
        begin, until = inf, inf
        if limit and duration:  # an overload torque or time of 0 protects from nothing # assumption
            lasts = abs(course.torque(inf)) > limit
            if abs(course.load) > limit:
                begin, until = at, inf if lasts else course.motion.done_at
            elif lasts:
                begin = max(at, course.motion.done_at)
        first, last = self._span
        if begin == at and first <= at <= last:
            begin = first  # above the limit without a break
        self._span = begin, until
        trip = begin + duration
        self.next = max(at, trip) if trip <= until and not self.tripped else inf

    def _value(self, name: str) -> float:
        """The value of a row in its unit; 0 where the map has no such row."""
        table = self._memory.layout.table
        return self._memory[name] * table[name].scale if name in table else 0.0
