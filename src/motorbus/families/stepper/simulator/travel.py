"""Where the load is, which no count knows, and when it meets the home switch.

The controller counts from where it was switched on, and from 0 again when it has homed. The load stays where it is. A
switch that is wired to input 5 is closed at its place and everywhere behind it: homing ends, and a jog away opens it.
"""

from __future__ import annotations

from math import inf

from motorbus.families.stepper.execution import Happening, State
from motorbus.families.stepper.simulator.switches import Switches


class Travel:
    """The load, `offset` pulses from what the controller counts."""

    def __init__(self, switches: Switches) -> None:
        self.offset = 0
        self.change(switches)

    def change(self, switches: Switches) -> None:
        """From now on the switch is where these say."""
        self._wired = switches.home_switch == "wired"
        self._place = switches.home_at
        self._known: tuple[State | None, bool, float] = (None, False, inf)

    def position(self, state: State, at: float) -> int:
        """Where the load is, in pulses from where it was first."""
        return state.position(at) + self.offset

    def closed(self, state: State, at: float) -> bool:
        """Whether the load is on the switch."""
        return self.position(state, at) <= self._place

    def follow(self, before: State, told: tuple[Happening, ...]) -> None:
        """The controller has gone on: where it has begun to count from 0, the load has not moved."""
        for one in told:
            if one.kind == "homed":
                self.offset += before.position(one.at)

    def crossing(self, state: State, closed: bool) -> float:
        """When the switch will be met, or left when it is `closed`, in the motion under way; infinity when not."""
        if not self._wired or state.motion is None:
            return inf
        if self._known[0] is not state or self._known[1] is not closed:
            self._known = (state, closed, self._reckoned(state, closed))
        return self._known[2]

    def _reckoned(self, state: State, closed: bool) -> float:
        motion = state.motion
        if motion is None or (motion.sign > 0) is not closed:
            return inf  # it goes the other way
        start = state.base + self.offset
        away = self._place + 1 - start if closed else start - self._place
        there = motion.moment(away)
        beyond = motion.moment(away + 1)
        if there == inf:
            return inf
        # between two pulses, so that noise of arithmetic does not decide which one was the last
        return state.since + (there + (motion.duration if beyond == inf else beyond)) / 2
