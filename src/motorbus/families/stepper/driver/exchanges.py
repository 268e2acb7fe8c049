"""One command as an exchange: checked before it is sent, its reply known to the last byte that can be.

A reply has no checksum. So what is due is worked out beforehand and is the key by which the bus tells replies apart:
one of another command, project, step or port is not this one's, whatever it may be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from motorbus.core.request import Expected, Precondition, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.errors import UnexpectedReply
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.table import ORDERS, check

T = TypeVar("T")


def timed(said: Request[object]) -> Request[float]:
    """The same exchange, which gives the moment of its reply (s), once that is the right one."""

    def at(answer: Response) -> float:
        if said.decode is not None:
            said.decode(answer)
        return answer.at

    return said.with_decoder(at)


def command(
    node: Node,
    name: str,
    read: Callable[[bytes], T],
    *,
    priority: Priority = Priority.POLL,
    timeout: TimeoutClass | None = None,
    goals: tuple[Setpoint, ...] = (),
    refusal: Precondition | None = None,
    expert: bool = False,
    **values: int,
) -> Request[T]:
    """A command by its name and its numbers; `read` makes a value of the whole reply, once that is the right one.

    `goals` is what it orders, for what moves the motor, `refusal` tells why it must not leave after all. `expert` lets
    a step use inputs 3 and 4.

    Raises RequestError, naming the field and its range, for a number that may not be sent. The exchange raises
    UnexpectedReply when the reply differs from what is due.
    """
    check(name, values, expert=expert)
    order = ORDERS[name]
    request = wire.encode(name, motor=node.motor, **values)
    right = wire.replies_due(request)

    def judged(answer: Response) -> T:
        reply = answer.replies[0].data
        if reply[: wire.REPLY_LENGTH] not in right and (different := wire.difference(request, reply)):
            raise UnexpectedReply(
                f"the reply to {name} is not the one that is due: {different}",
                sent=request,
                received=reply,
                cause="a byte was changed on the way, or it answers something else; replies have no checksum",
                advice="say it again",
                node=node.node,
            )
        return read(reply)

    return Request(
        request,
        (Expected(node.node, wire.key_of(next(iter(right))), wire.reply_length(order.command)),),
        judged,
        priority=priority,
        effect=order.effect,
        setpoints=goals,
        reply_within=order.timeout if timeout is None else timeout,
        repeatable=order.repeatable,
        precondition=refusal,
    )
