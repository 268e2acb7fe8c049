"""A ticket is settled once; a flight keeps exactly the replies that are due."""

from __future__ import annotations

import pytest

from motorbus.bus.ticket import Flight, Ticket
from motorbus.core.operation import ANY, Answer, Event, Exchange, Noise, Notice, Rank, Reply
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


def test_a_flight_takes_all_replies_at_once_only_where_nothing_is_odd() -> None:
    good: list[Event] = [Reply(0, node, reply(node)) for node in (1, 2)]
    one, two = good
    odd: list[list[Event]] = [
        [],
        [one],
        [two, one],
        [one, two, two],
        [one, one],
        [one, Reply(0, 2, reply(2)[:-1])],
        [one, Reply(1, 2, reply(2))],
        [one, Noise(reply(2), "checksum")],
        [one, Notice(2, "report", reply(2))],
    ]
    for events in odd:
        flight = Flight(positions(1, 2))
        assert not flight.take_all(events, ())
        assert (flight.got, flight.last, flight.complete) == ({}, None, False)
    flight = Flight(positions(1, 2))
    assert not flight.take_all(good, (reply(2),)), "it may be an echo"
    flight.unbelieved = (2,)
    assert not flight.take_all(good, ())
    flight = Flight(positions(1, 2))
    flight.take(Reply(0, 2, reply(2)))
    assert not flight.take_all(good, ())
    flight = Flight(positions(1, 2))
    assert flight.take_all(good, (reply(3),))
    assert flight.complete
    assert flight.answer(1.0) == Answer(tuple(one for one in good if isinstance(one, Reply)), (), 1.0)


def test_what_stops_and_what_everybody_answers_is_taken_one_by_one() -> None:
    data = reply(1)
    for exchange in (position(1, rank=Rank.STOP), Exchange(b"ask", ANY)):
        assert not Flight(exchange).take_all([Reply(0, 1, data)], ())


# -- a group of which some are not waited for -------------------------------------------------------------------------


def test_what_somebody_says_who_is_not_waited_for_is_passed_over() -> None:
    flight = Flight(positions(1, 2, 3))
    flight.unbelieved = (2, 3)
    assert flight.take(Reply(0, 1, reply(1)))
    assert flight.complete
    assert flight.passes_over(Reply(0, 2, reply(2)))
    assert not flight.passes_over(Reply(0, 1, reply(1)))
    assert not flight.passes_over(Reply(0, 4, reply(4)))
    assert not flight.passes_over(Reply(0, 3, reply(3) + b"x"))
    flight.unbelieved = ()
    assert not flight.passes_over(Reply(0, 2, reply(2)))
