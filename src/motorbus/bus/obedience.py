"""Who has obeyed a stop, as far as what came back tells: read from the flights of one round."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from motorbus.bus.ticket import Flight
from motorbus.bus.turns import GATED
from motorbus.core.operation import ANY, Answer, Due, Exchange
from motorbus.errors import DeviceError


def nodes(exchange: Exchange[Answer]) -> list[int]:
    """Who acknowledges this."""
    return [] if exchange.replies is ANY else [due.node for due in exchange.replies]


def obeyed(flights: Iterable[Flight], missing: Sequence[Flight], before: Sequence[int]) -> list[int]:
    """Who has given every kind of reply that stopping it calls for; several frames may call for one and the same.

    A frame that only asks stops nobody.
    """
    wanted: dict[int, set[Due]] = {}
    given: set[Due] = set()
    for flight in flights:
        dues = flight.exchange.replies
        if flight.exchange.effect in GATED and dues is not ANY:
            given |= set(dues) if flight not in missing else set()
            for due in dues:
                wanted.setdefault(due.node, set()).add(due)
    return [node for node, dues in wanted.items() if dues <= given and node not in before]


def refused(flight: Flight) -> bool:
    """Did the device answer, and say no?"""
    try:
        if flight.exchange.read is not None:
            flight.exchange.read(flight.value)
    except DeviceError:
        return True
    return False


def answered(exchanges: Iterable[Exchange[Answer]]) -> bool:
    """Is one of them acknowledged by somebody?"""
    return any(exchange.replies for exchange in exchanges)
