"""Several exchanges one after the other, as a control loop has them in every cycle: goals out, positions in.

What nobody answers leaves together with what follows it, where the bus is idle: so a cycle takes one look at the line,
one write and one answer. Where that cannot be, because somebody else is on the bus, a node must be probed, the line
takes its time, or something must be asked before an order can be judged, each exchange goes its own way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from motorbus.bus.look import questions
from motorbus.bus.run import taken
from motorbus.bus.straight import fly, given_up
from motorbus.bus.ticket import Flight
from motorbus.core.entry import shown
from motorbus.core.operation import UNLIKE, Exchange
from motorbus.errors import LinkError, RequestError

if TYPE_CHECKING:
    from motorbus.bus.pump import Bus

Exchanges = Sequence[Exchange[Any]]


def volley(
    bus: Bus, exchanges: Exchanges, forgiven: tuple[type[Exception], ...] = (), *, together: bool = True
) -> list[Any]:
    """Carry these out in their order; the value of each, or the error, where that is one of those `forgiven`.

    Without `together` each leaves in a write of its own. Raises the first other error, as `Bus.run` does; what comes
    behind has not been sent then. Raises RequestError, with nothing sent, when one is no exchange.
    """
    try:
        if together and len(exchanges) == 2:
            value = _flown(bus, exchanges[0], exchanges[1], forgiven)
            if value is not UNLIKE:
                return [None, value]  # nothing comes of an order that is sure, but that it has left
    except AttributeError:
        _check(
            exchanges
        )  # only what is an exchange has what was asked of it, and it is asked before one leaves
        raise
    _check(exchanges)
    told: list[Any] = []
    begin = 0
    for end, exchange in enumerate(exchanges, 1):
        if exchange.replies == () and end < len(exchanges) and isinstance(exchange.request, bytes):
            continue  # nobody answers it, so it goes with the next
        burst, begin = exchanges[begin:end], end
        sent = _sent(bus, burst) if together and len(burst) > 1 else []
        for number, one in enumerate(burst):
            try:
                if number < len(sent):
                    told.append(taken(bus.turns, one, sent[number].result()))
                else:
                    told.append(bus.run(one))
            except forgiven as error:
                told.append(error)
    return told


def _check(exchanges: Exchanges) -> None:
    for one in exchanges:
        if not isinstance(one, Exchange):
            raise RequestError(
                f"{shown(one)} is no exchange",
                expected="as bus.volley(write(goals), sync_read_positions(servos)): each by itself, and made before",
                advice="what asks several questions is carried out by run(); nothing was sent",
            ) from None


def _flown(
    bus: Bus, order: Exchange[Any], question: Exchange[Any], forgiven: tuple[type[Exception], ...]
) -> Any:
    """The straight way of an order and a question: what came of the question; `UNLIKE` when nothing was sent."""
    if question.whole is None or not rides(order):
        return UNLIKE
    try:
        return fly(bus, question, order)
    except LinkError:
        raise
    except forgiven as error:
        return error


def rides(order: Exchange[Any]) -> bool:
    """Whether this may leave in one write with a question, and nothing but its leaving comes of it."""
    return order.sure and order.replies == () and isinstance(order.request, bytes)


def _sent(bus: Bus, burst: Exchanges) -> list[Flight]:
    """Send them as one, and wait until all that left so are settled; they are the first ones of the burst."""
    for one in burst:
        if one.effect and questions(bus.turns, one):
            return []
    flights = [Flight(exchange) for exchange in burst]
    relay = bus.relay
    try:
        try:
            relay.start(*flights)
            for number, flight in enumerate(flights):
                if number and not (flight.left or flight.done):
                    return flights[:number]
                while not flight.done:
                    relay.turn()
            return flights
        except BaseException:
            given_up(bus, *flights)
            raise
    except BaseException:  # a second interrupt may fall into what the first one has brought about
        given_up(bus, *flights)
        raise
