"""Several KST servos moved by one command: each gets its target, and one that is lost ends the move of all."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from motorbus.cli.several import carried_out, or_all_stop
from motorbus.core.interrupted import Moving, stopped_if_interrupted
from motorbus.core.steps import gather
from motorbus.families.kst import driver
from motorbus.families.kst.driver.arrival import Move, arrive
from motorbus.families.kst.driver.motion import TOLERANCE, counts, goal_of, send_goal

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.dry import DryBus
    from motorbus.core.setpoint import Setpoint


def move_together(bus: Bus | DryBus, goals: Mapping[int, float], *, wait: bool = True) -> None:
    """Send these targets (rad by id) one after the other, once all of them are judged; errors as `Servo.move` raises.

    When a servo does not answer meanwhile the others stop.
    """
    servos = [driver.Servo(bus, node) for node in goals]
    carried_out(bus, _move_together(servos, list(goals.values()), wait))


async def _move_together(servos: Sequence[driver.Servo], to: Sequence[float], wait: bool) -> None:
    goals = []
    for servo, position in zip(servos, to, strict=True):
        goals.append(await goal_of(servo, counts(servo, position)))
    if not wait:
        await _sent(servos, goals)
        return
    devices = [Moving(one, partial(driver.stop, one), partial(driver.position, one)) for one in servos]
    await stopped_if_interrupted(_gone(servos, goals), *devices)


async def _gone(servos: Sequence[driver.Servo], goals: Sequence[Setpoint]) -> None:
    await send_goal(servos[0], goals[0])
    await or_all_stop(_sent(servos[1:], goals[1:]))
    moves = [Move(goal.value, TOLERANCE, None) for goal in goals]
    pairs = zip(servos, moves, strict=True)
    await gather(*[or_all_stop(arrive(servo, move)) for servo, move in pairs])


async def _sent(servos: Sequence[driver.Servo], goals: Sequence[Setpoint]) -> None:
    for servo, goal in zip(servos, goals, strict=True):
        await send_goal(servo, goal)
