"""What common commands do with several FEETECH servos at once: begin in one instant, ask who is there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorbus.cli.several import carried_out, or_all_stop
from motorbus.core.request import ANY, Priority, Request, Response
from motorbus.core.steps import gather
from motorbus.families.feetech import driver, wire
from motorbus.families.feetech.driver.arrival import arrive
from motorbus.families.feetech.driver.bound import ask_bound
from motorbus.families.feetech.driver.group import sync_writes, written_all
from motorbus.families.feetech.driver.motion import move_block, stops, way

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.dry import DryBus


def move_together(
    bus: Bus | DryBus,
    goals: Mapping[int, float],
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
    wait: bool = True,
) -> None:
    """All goals (rad by id) in one packet, so that all begin in the same instant; errors as `Servo.move` raises.

    Where a goal does not switch torque on by itself the switch travels with it, in a packet of their own for those
    servos: one that starts anew in between never goes for the goal it wakes up with. When a servo does not answer
    meanwhile the others stop.
    """
    servos = [driver.Servo(bus, node) for node in goals]
    carried_out(bus, _move_together(servos, list(goals.values()), velocity, acceleration, wait))


async def _move_together(
    servos: Sequence[driver.Servo],
    goals: Sequence[float],
    velocity: float | None,
    acceleration: float | None,
    wait: bool,
) -> None:
    for error in (await driver.prepare_all(servos)).values():
        raise error
    blocks = []
    for servo, goal in zip(servos, goals, strict=True):
        assert servo.table is not None
        await ask_bound(servo, servo.table)
        block = move_block(servo, servo.table, goal, velocity, acceleration)
        blocks.append(block._replace(under=servo.settings))
    if not wait:
        await written_all(list(sync_writes(servos, blocks)))
        return
    orders = []
    for servo, goal in zip(servos, goals, strict=True):
        assert servo.table is not None
        orders.append(way(servo, servo.table, goal, velocity, acceleration))
    await stops(_gone(servos, blocks, orders), *servos)


async def _gone(servos: Sequence[driver.Servo], blocks: Sequence[Any], orders: Sequence[Any]) -> None:
    await written_all(list(sync_writes(servos, blocks)))
    arrivals = []
    for servo, order in zip(servos, orders, strict=True):
        assert servo.table is not None
        arrivals.append(or_all_stop(arrive(servo, servo.table, order)))
    await gather(*arrivals)


def ping_everyone(bus: Bus) -> list[int]:
    """Who answers one broadcast PING. A hint only: the replies of several servos may collide."""

    request = wire.encode_instruction(wire.BROADCAST, wire.Instruction.PING, broadcast=True)

    def read(answer: Response) -> list[int]:
        return sorted({reply.data[2] for reply in answer.replies})

    return bus.run(Request(request, ANY, read, priority=Priority.POLL))
