"""Move several KST servos by one command: each gets its target; if one does not answer, all stop."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from motorbus.cli.several import carried_out, or_all_stop
from motorbus.core.interrupted import Moving, stopped_if_interrupted
from motorbus.core.steps import gather
from motorbus.families.kst import Servo
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.motion import (
    TOLERANCE,
    send_target,
    setpoint,
    stop,
    target,
    wait_arrival,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.dry import DryBus
    from motorbus.core.setpoint import Setpoint


def move_together(bus: Bus | DryBus, goals: Mapping[int, float], *, wait: bool = True) -> None:
    """Send these targets (rad by id) when all are checked; errors as `Servo.move` raises."""
    servos = [Servo(bus, node) for node in goals]
    carried_out(bus, _move_together(servos, list(goals.values()), wait))


async def _move_together(servos: Sequence[Servo], to: Sequence[float], wait: bool) -> None:
    pairs = zip(servos, to, strict=True)
    goals = [await setpoint(servo, target(servo, position)) for servo, position in pairs]
    if not wait:
        await _send_all(servos, goals)
        return
    devices = [Moving(one, partial(stop, one), partial(position, one)) for one in servos]
    await stopped_if_interrupted(_send_and_wait(servos, goals), *devices)


async def _send_and_wait(servos: Sequence[Servo], goals: Sequence[Setpoint]) -> None:
    await send_target(servos[0], goals[0])
    await or_all_stop(_send_all(servos[1:], goals[1:]))
    pairs = zip(servos, goals, strict=True)
    await gather(*[or_all_stop(wait_arrival(servo, goal.value, TOLERANCE, None)) for servo, goal in pairs])


async def _send_all(servos: Sequence[Servo], goals: Sequence[Setpoint]) -> None:
    for servo, goal in zip(servos, goals, strict=True):
        await send_target(servo, goal)
