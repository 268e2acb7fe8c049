"""A ticket is settled once; a flight keeps exactly the replies that are due."""

from __future__ import annotations

import pytest

from motorbus.bus.ticket import Flight, Ticket
from motorbus.core.operation import Reply
from tests.bus.script import position, positions, reply


def test_a_ticket_is_settled_once_and_wakes_once() -> None:
    woken: list[int] = []
    ticket = Ticket(wake=lambda: woken.append(1))
    ticket.finish(1)
    ticket.finish(2)
    assert ticket.result() == 1
    assert woken == [1]


def test_a_failed_ticket_raises_its_error() -> None:
    ticket = Ticket()
    ticket.finish(error=ValueError("no"))
    with pytest.raises(ValueError, match="no"):
        ticket.result()


def test_a_flight_takes_a_reply_by_key_and_exact_length_once() -> None:
    flight = Flight(position(1))
    assert not flight.take(Reply(0, 2, reply(2)))
    assert not flight.take(Reply(0, 1, reply(1)[:-1]))
    assert flight.take(Reply(0, 1, reply(1)))
    assert flight.complete
    assert not flight.take(Reply(0, 1, reply(1)))


def test_the_answer_is_in_the_order_due_and_names_the_missing() -> None:
    flight = Flight(positions(1, 2, 3))
    flight.take(Reply(0, 3, reply(3)))
    flight.take(Reply(0, 1, reply(1)))
    answer = flight.answer(5.0)
    assert [r.key for r in answer.replies] == [1, 3]
    assert answer.missing == (2,)
    assert answer.at == 5.0


def test_a_reply_of_an_unbelieved_node_counts_as_missing() -> None:
    flight = Flight(positions(1, 2))
    flight.unbelieved = (2,)
    flight.take(Reply(0, 1, reply(1)))
    assert flight.complete
    flight.take(Reply(0, 2, reply(2)))
    assert flight.answer(0.0).missing == (2,)
