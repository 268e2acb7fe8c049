"""What the bus must know of this line: how long things take. Figures of the wire are exact, those of the device are not
known; they come from `table` and are assumptions.
"""

from __future__ import annotations

from typing import Any, Final

from motorbus.core.request import ANY, Request, TimeoutClass
from motorbus.families.stepper import wire
from motorbus.families.stepper.table import DUMP_ENDS, RATE, REPLY, STORE

BITS: Final = 10
"""For one byte: a start bit, eight of data, a stop bit."""


def air_time(request: Request[Any], rate: int) -> float:
    """s on the wire for the request and the replies due: 17.7 ms for a command, 246.9 ms for a dump at 9600 baud."""
    due = (wire.DUMP_LENGTH,) if request.expected is ANY else [one.length for one in request.expected]
    return (len(request.wire) + sum(due)) * BITS / rate


def turnaround(request: Request[Any]) -> float:
    """s that the controller may think."""
    if request.reply_within is TimeoutClass.STORE:
        return STORE
    due = () if request.expected is ANY else request.expected
    if any(one.length == wire.DUMP_LENGTH for one in due):
        return DUMP_ENDS - wire.DUMP_LENGTH * BITS / RATE
    return REPLY


def quiet_time(rate: int) -> float:
    """s after which nothing of an old exchange can still be under way: a whole dump, and the pause that ends it."""
    return wire.DUMP_LENGTH * BITS / rate + wire.GAP
