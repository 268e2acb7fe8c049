"""The one gate that every motion command passes, whatever face or spelling it comes from.

The bus asks it before anything leaves whose row says that writing it moves a motor or switches its torque
(decision record 0014). What it cannot judge it refuses: a goal that is not finite, lies outside the limits the
device itself declares, or comes without limits.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import Any

from motorbus.core.operation import Effect, Exchange, Goal, Rank
from motorbus.errors import LimitExceeded

ROUNDING = 1e-9  # relative; a limit converted to its unit and back still admits itself


class Gate:
    """Called with an exchange before it is sent; raises LimitExceeded to refuse it, else does nothing."""

    def __call__(self, exchange: Exchange[Any]) -> None:
        if exchange.rank is Rank.STOP or exchange.effect is not Effect.MOTION:
            return
        if not exchange.goals:
            raise LimitExceeded(
                "this write moves a motor and does not say where to",
                sent=exchange.request,
                cause="the driver made an exchange with effect motion and without goals",
                advice="use a move, or a write by register name; nothing was sent",
            )
        for goal in exchange.goals:
            _, _, value, low, high = goal
            if low is None or high is None or not -inf < low <= value <= high < inf:
                _check(goal)


def _check(goal: Goal) -> None:
    if not isfinite(goal.value):
        raise _refusal(goal, f"{goal.value} is not a finite number", "give a number")
    if goal.low is None or goal.high is None:
        raise _refusal(
            goal, "its limits are not known", "read the device's limits first, for example by identify()"
        )
    slack = ROUNDING * max(abs(goal.low), abs(goal.high), 1.0)
    if not goal.low - slack <= goal.value <= goal.high + slack:
        raise _refusal(
            goal,
            f"{goal.value:.6g} lies outside {goal.low:.6g} to {goal.high:.6g}",
            "stay inside the limits, or change the limit registers of the device",
        )


def _refusal(goal: Goal, why: str, advice: str) -> LimitExceeded:
    return LimitExceeded(
        f"node {goal.node}: goal {goal.quantity} refused: {why}",
        expected="" if goal.low is None or goal.high is None else f"{goal.low:.6g} to {goal.high:.6g}",
        advice=f"{advice}; nothing was sent",
        node=goal.node,
    )
