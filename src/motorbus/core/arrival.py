"""Wait until a device is in position, by its own samples and the clock of the link."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from motorbus.core.family import State
from motorbus.core.steps import Procedure, Runnable, Sleep
from motorbus.errors import MotionError, MotorbusError, Stalled

PERIOD: Final = 0.02  # s between two samples; one axis that is waited for takes a tenth of a bus at most
STALL_TIME: Final = 0.5  # s without progress after which a device counts as stalled
PROGRESS: Final = 0.003  # rad; a smaller change counts as noise


async def wait_in_position(
    sample: Callable[[], Runnable[State]],
    goal: float,
    *,
    node: int,
    tolerance: float,
    timeout: Callable[[float], float],
    stalled: Callable[[State], Procedure[MotorbusError]] | None = None,
) -> None:
    """Return when the device is in position: within `tolerance` rad of `goal` and not moving.

    A device that does not report whether it moves must be within tolerance in two samples in a row. Raises Stalled, or
    the error that `stalled` makes, when its position has not changed by `PROGRESS` rad for `STALL_TIME` s; MotionError
    after the time (s) that `timeout` gives for the distance (rad).
    """
    state = await sample()
    here = mark = _position(state)
    begun = progressed = state.at
    longest = timeout(abs(here - goal))
    looks = 0
    while True:
        near = abs(here - goal) <= tolerance
        looks = looks + 1 if near else 0
        if near and (not state.moving if state.moving is not None else looks >= 2):
            return
        if abs(here - mark) >= PROGRESS:
            mark, progressed = here, state.at
        elif state.at - progressed > STALL_TIME and not looks:
            if stalled is not None:
                raise await stalled(state)
            raise Stalled(
                f"node {node} stands at {here:.4g} rad, not at {goal:.4g} rad",
                cause="its torque is off, or something holds it",
                node=node,
            )
        if state.at - begun > longest:
            raise MotionError(
                f"node {node} is not in position after {longest:.3g} s: it is at {here:.4g} rad on its way to "
                f"{goal:.4g} rad",
                expected=f"within {tolerance:.4g} rad",
                cause="the velocity is low for this distance, or the device oscillates about its goal",
                advice="give a longer timeout; it is still moving: stop() ends that",
                node=node,
            )
        await Sleep(PERIOD)
        state = await sample()
        here = _position(state)


def _position(state: State) -> float:
    assert state.position is not None
    return state.position
