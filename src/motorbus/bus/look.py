"""What must be asked before an order can be judged, found out while nothing else on the bus goes on.

Whoever judges takes in what the bus has heard when he looks, and when the order is about to leave. Several threads may
look at a time, and another one may just send: all that is done under the lock of the turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorbus.bus.turns import Turns
from motorbus.core.operation import Exchange, Runnable


def questions(turns: Turns, exchange: Exchange[Any]) -> Sequence[Runnable[Any]]:
    """What must be asked before this order can be judged; nothing where nobody looks."""
    if turns.look is None:
        return ()
    with turns.lock:
        return turns.look(exchange)
