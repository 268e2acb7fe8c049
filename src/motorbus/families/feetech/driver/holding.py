"""An emergency stop that holds: for axes that would fall, and are safer with their torque than without it.

A servo is held at the place where it is, and nowhere else: one that has left a place would be ordered back to it. So it
is asked in the moment of the stop, in one READ, where it is and all that decides what holds it: register map, mode,
limits, torque switch. Another program may have changed any of that. Who does not answer is asked again, keeps its
torque, and keeps its goal: nothing lets it fall, and whatever it was told before it may still do.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Final

from motorbus.core import units
from motorbus.core.request import Expected, Priority, Request, Response
from motorbus.core.setpoint import Setpoint, Stays
from motorbus.errors import RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import PRESENT, Block
from motorbus.families.feetech.driver.identity import learn
from motorbus.families.feetech.driver.node import IMAGE, Node, checked_id
from motorbus.families.feetech.driver.torque import LIMP, TORQUE_ENABLE
from motorbus.families.feetech.table import Mode

PROMISE: Final = (
    "those that hold: goal := present position, or velocity 0, accepted; standstill was not verified"
)
"""What it promises of these; where nothing but torque off is known to stop a servo, that is what it got."""
COUNT: Final = PRESENT + 2
"""Registers 0 to 57, which say all: 0.7 ms on the wire at 1 Mbaud."""
_PARAMETERS: Final = 5


def held_ids(said: str | Iterable[int]) -> frozenset[int]:
    """`1-3+7`, or ids -> the ids that it names. Raises RequestError for what is none."""
    if not isinstance(said, str):
        return frozenset(checked_id(node) for node in said)
    found: set[int] = set()
    for part in said.split("+") if said else ():
        first, _, last = part.partition("-")
        try:
            ends = checked_id(units.whole(first)), checked_id(units.whole(last or first))
        except ValueError:
            raise RequestError(
                f"estop_hold={said}: {part!r} is not an id",
                expected="ids of servos, as 1+4 or 1-3+7",
                advice="nothing was opened",
            ) from None
        found.update(range(ends[0], ends[1] + 1))
    return frozenset(found)


def holds(nodes: Mapping[int, Response | None], hold: Collection[int]) -> list[Request[Response]]:
    """What holds these: who has just told all that matters is held, each other one is asked for it."""
    found = []
    for number in sorted(hold):
        image = _image(number, nodes.get(number))
        found.append(ask(number) if image is None else _order(number, resting(number, image)))
    return found


def ask(node: int) -> Request[Response]:
    """READ of all that decides what holds this servo."""
    return Request(
        wire.read(node, 0, COUNT),
        (Expected(node, node, wire.OVERHEAD + COUNT),),
        priority=Priority.STOP,
        repeatable=True,
        reports_position=True,
    )


def resting(number: int, image: bytes) -> Block:
    """What a servo with these registers 0 to 57 is told, so that it stays where it is.

    A limp one stays limp. Torque off where no order is known that means "stay": in step, PWM and current mode, in a
    mode or by a map that nobody has described, and on a servo of many turns that tells its position within one.
    """
    node = Node(number)
    learn(node, image[:IMAGE])
    table, settings = node.table, node.settings
    limp = image[TORQUE_ENABLE] == 0
    if limp or not node.writable or table is None or settings is None:
        return LIMP
    if settings.mode is Mode.VELOCITY:
        row = table["goal_velocity"]
        goal = Setpoint(number, "velocity", 0.0, 0.0, 0.0, Stays.STILL)
        return Block(row.address, row.encode(0), row.effect, (goal,))
    if settings.mode is not Mode.POSITION or (settings.many_turns and not settings.accumulates):
        return LIMP
    row = table["goal_position"]
    told = table["present_position"].decode(image[PRESENT:COUNT])
    raw = max(row.low, min(told, row.high))  # beyond what any goal can be it can only come back
    here = float(node.value(row, raw))
    goal = Setpoint(number, "position", here, here, here, Stays.STILL)
    return Block(row.address, row.encode(raw), row.effect, (goal,))


def _image(node: int, answer: Response | None) -> bytes | None:
    """Registers 0 to 57 of this servo, where that is what it answered last."""
    for reply in answer.replies if answer is not None else ():
        if reply.data[2] == node and len(reply.data) == wire.OVERHEAD + COUNT:
            return reply.data[_PARAMETERS : _PARAMETERS + COUNT]
    return None


def _order(node: int, block: Block) -> Request[Response]:
    return Request(
        wire.write(node, block.address, block.data),
        (Expected(node, node, wire.OVERHEAD),),
        priority=Priority.STOP,
        effect=block.effect,
        setpoints=block.goals,
        repeatable=True,
    )
