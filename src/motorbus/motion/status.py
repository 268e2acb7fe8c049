"""What is known of one axis: its position, who may move it, and whether it is at fault."""

from __future__ import annotations

from math import inf
from typing import Final

from motorbus.core.family import State
from motorbus.errors import Refused
from motorbus.motion.machine import AxisConfig

FRESH: Final = 0.5  # s for which a position may be used to judge a goal
FASTEST: Final = 30.0  # rad/s; no motor of these families is faster # assumption
JITTER: Final = 0.01  # rad; readings of a device at rest differ by less


class AxisStatus:
    """Angles in rad of the device, times in s of the link clock.

    `owner` counts the stops, torque-offs and new sources of goals. A source keeps the number that `claim` gave it; its
    goals are refused when the number has changed. `estimate` is the position of an axis whose device reports none,
    None where it is unknown. `engaged`: torque was given from here. `moving`: a goal was sent and no stop since.
    `endless`: its motion has no end of its own. `measured`: its device reports its position; the last reading was
    `seen` at that time, `position` is the last sound one.
    """

    __slots__ = (
        "at", "config", "endless", "engaged", "estimate", "fault", "high", "low", "measured", "moving", "name", "node",
        "owner", "position", "seen", "state", "suspect",
    )  # fmt: skip

    def __init__(self, name: str, config: AxisConfig, *, measured: bool = True) -> None:
        self.name: Final = name
        self.config: Final = config
        self.node: Final = config.node
        self.low, self.high = config.device_limits
        self.position: float | None = None
        self.at = -inf
        self.suspect: float | None = None
        self.estimate: float | None = None
        self.seen = -inf
        self.measured = measured
        self.state: State | None = None  # its last sample, except for the position
        self.fault = ""
        self.owner = 0
        self.engaged = self.moving = self.endless = False

    def claim(self) -> int:
        """Make the caller the only source of goals from now on."""
        self.owner += 1
        return self.owner

    def take(self, angle: float, at: float) -> bool:
        """Take a reading; False while it is suspect.

        An implausible reading is suspect until a second one agrees with it.
        """
        self.seen = at
        before, age = self.position, at - self.at
        if before is None or abs(angle - before) <= JITTER + FASTEST * min(age, FRESH):
            is_sound = True
        else:
            is_sound = self.suspect is not None and abs(angle - self.suspect) <= JITTER + FASTEST * min(
                age, FRESH
            )
        if not is_sound:
            self.suspect = angle
            return False
        self.position, self.at, self.suspect = angle, at, None
        return True

    def forget(self) -> None:
        """The device may be anywhere."""
        self.position = self.suspect = self.estimate = None
        self.at = -inf

    def stopped(self) -> None:
        """A stop or torque-off will be sent: its source of goals loses it."""
        self.owner += 1
        self.moving = self.endless = False

    def set_fault(self, why: str) -> None:
        """It gets no motion and no torque until the fault is cleared."""
        self.fault = why
        self.owner += 1
        self.forget()
        self.engaged = self.moving = self.endless = False

    def check_fault(self) -> None:
        """Raise Refused if it is at fault."""
        if self.fault:
            raise Refused(
                f"{self.name} is at fault: {self.fault}",
                reason="fault",
                advice=f'find the cause, then robot.clear_fault("{self.name}")',
                node=self.node,
            )

    @property
    def known_position(self) -> float | None:
        """The last position of the axis (rad, m), measured or estimated."""
        angle = self.position if self.position is not None else self.estimate
        return None if angle is None else self.config.from_device(angle)
