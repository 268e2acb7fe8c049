"""Looking for servos: PING by unicast, id by id, at one rate or at several.

Silence is an answer here, so nothing waits long for it; but the first packet after power-up may be missed, so the
silent ids are asked once more. A broadcast PING would be quicker and is not used: the replies collide, and the
protocol manual V1.01 forbids it with more than one servo.
"""

from __future__ import annotations

from collections.abc import Sequence

from motorbus.core.family import Found, Identity
from motorbus.core.operation import Alone, Operation, Progress, Report, Tune, afterwards, outcome
from motorbus.errors import NoReply, WireError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.identity import identify, ping_exchange
from motorbus.families.feetech.driver.node import Node, as_nodes


def scan(ids: Sequence[int] = (), rates: Sequence[int] = ()) -> Operation[list[Found]]:
    """Every servo that answers, with what it is; `ids` () means 0 to 253, `rates` () the present rate alone.

    The present rate of the bus is set again at the end, whatever happens. Reports `Found` as soon as one answers
    (its identity is asked afterwards) and `Progress`. Writes nothing to any servo.
    """
    asked = [node.node for node in as_nodes(ids or range(wire.MAX_ID + 1))]
    present = yield from Tune(0)
    if not rates:
        return (yield from _at_one_rate(asked, present, 0, 1))
    return (yield from Alone(afterwards(_at_all_rates(asked, rates), lambda: iter(Tune(present)))))


def _at_all_rates(ids: Sequence[int], rates: Sequence[int]) -> Operation[list[Found]]:
    found: list[Found] = []
    for index, rate in enumerate(rates):
        yield from Tune(rate)
        found += yield from _at_one_rate(ids, rate, index, len(rates))
    return found


def _at_one_rate(ids: Sequence[int], rate: int, index: int, of: int) -> Operation[list[Found]]:
    """Two passes over the ids, the second over the silent ones, then ask those who are there what they are."""
    there: list[int] = []
    for number in range(2):
        begun = (2 * index + number) * len(ids)
        for done, id in enumerate(ids):
            if id not in there and (yield from _answers(id)):
                there.append(id)
                yield from Report(Found(id, rate, None))
            yield from Report(Progress(begun + done + 1, 2 * of * len(ids), f"id {id} at {rate} bit/s"))
    found: list[Found] = []
    for id in sorted(there):
        identity = yield from outcome(identify(Node(id)))
        found.append(Found(id, rate, identity if isinstance(identity, Identity) else None))
    return found


def _answers(id: int) -> Operation[bool]:
    """Is it there? Bytes that are no answer may be noise at a wrong rate, so they do not count."""
    try:
        yield from ping_exchange(Node(id), scanning=True)
    except (NoReply, WireError):
        return False
    return True
