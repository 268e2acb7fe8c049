"""What a bus asks before it sends a motion request."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any, Final, Protocol

from motorbus.core.request import Effect, Priority, Request
from motorbus.core.setpoint import Setpoint
from motorbus.errors import LimitExceeded

ROUNDING: Final = 1e-9
"""Relative slack of a limit, which conversion to another unit and back may change."""
UNITS: Final = {"position": "rad", "relative": "rad", "velocity": "rad/s", "current": "A"}


class Interlock(Protocol):
    """Judges requests that move a motor or switch its torque before they are sent, as `DeviceLimits` does."""

    def check(self, request: Request[Any], now: float, /) -> None:
        """Raise MotorbusError if this request must not leave at `now` (s).

        Called at every attempt, never for a stop.
        """

    def stopped(self, nodes: Sequence[int], /) -> None:
        """A stop for these nodes (empty: all) was requested and will be sent. May be called from any thread."""


class DeviceLimits:
    """The interlock of a bus without a robot: setpoints are finite and inside the limits that they carry."""

    def check(self, request: Request[Any], now: float, /) -> None:
        """Raise LimitExceeded for a setpoint outside its limits or without limits. A stop always passes."""
        if request.priority is Priority.STOP:
            return
        if request.effect is Effect.MOTION and request.deferred is None and not request.setpoints:
            raise LimitExceeded(
                "this write moves a motor and has no setpoint",
                sent=request.wire,
                cause="the driver made a request with effect motion and without setpoints",
                advice="use a move, or a write by register name; nothing was sent",
            )
        for setpoint in request.setpoints:
            check_limits(setpoint)

    def stopped(self, nodes: Sequence[int], /) -> None:
        return


def check_limits(setpoint: Setpoint) -> None:
    """Raise LimitExceeded for a setpoint outside the limits that it carries, or without limits."""
    value, low, high = setpoint.value, setpoint.low, setpoint.high
    if not isfinite(value):
        raise _refused(setpoint, f"{value} is not a finite number", "", "give a number")
    if low is None or high is None:
        advice = "read the limits of the device first, for example by identify()"
        raise _refused(setpoint, "its limits are not known", "", advice)
    slack = ROUNDING * max(abs(low), abs(high), 1.0)
    if not low - slack <= value <= high + slack:
        limits = f"{low:.6g} to {high:.6g} {UNITS.get(setpoint.quantity, '')}".rstrip()
        advice = "stay inside the limits, or change the limit registers of the device"
        raise _refused(setpoint, f"{value:.6g} is outside {limits}", limits, advice)


def _refused(setpoint: Setpoint, reason: str, expected: str, advice: str) -> LimitExceeded:
    return LimitExceeded(
        f"node {setpoint.node}: goal {setpoint.quantity} refused: {reason}",
        expected=expected,
        advice=f"{advice}; nothing was sent",
        node=setpoint.node,
    )
