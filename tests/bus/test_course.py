"""What is known beforehand of an exchange that is kept, and what is made good as soon as anybody looks."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.core.aimed import Aim
from motorbus.core.operation import Answer, Exchange
from tests.bus.struck import kept, struck_bus


def test_whoever_takes_the_lock_finds_all_made_good() -> None:
    bus, _, _ = struck_bus()
    read = kept(1)
    for _ in range(3):
        bus.run(read)
    before, turns = bus.turns.lock.era, bus.turns
    assert turns.pending
    assert turns.lock.owing
    with turns.lock:
        assert turns.lock.era == before + 1
        assert not (turns.pending)
        assert not (turns.counting)
        assert not (turns.lock.owing)
    ledger = bus.statistics.nodes[1]
    assert ledger.sent == ledger.ok == sum(ledger.latency) == 4


def test_the_answer_is_taken_apart_when_somebody_looks() -> None:
    bus, _, _ = struck_bus()
    bus.run(kept(1, 2))
    bus.run(kept(1, 2))
    with bus.turns.lock:
        _, answer = bus.turns.known.seen[2]
    assert [(reply.key, reply.data[5]) for reply in answer.replies] == [(1, 1), (2, 2)]


def test_on_another_bus_it_has_another_course() -> None:
    one, two = struck_bus()[0], struck_bus()[0]
    read = kept(1)
    assert one.run(read) == two.run(read) == one.run(read) == ([(1, 0, 1, 0)], ())
    assert read.course.turns is one.turns


@pytest.mark.parametrize("since", [-inf, -1.0, 0.0, 1.0])
@pytest.mark.parametrize("ordered", [(1, 2), (2,), (1, 2, 3), (9,)])
@pytest.mark.parametrize("tells", [True, False])
def test_an_answer_and_an_order_are_told_in_one_go_as_they_are_one_by_one(
    since: float, ordered: tuple[int, ...], tells: bool
) -> None:
    found = []
    for others in (0, 1):  # a second aim, of which nothing is to be told: then they are looked at one by one
        bus, _, _ = struck_bus()
        read, turns, known = kept(1, 2), bus.turns, bus.turns.known
        if not tells:
            read = Exchange(read.request, read.replies, read.read, whole=read.whole, other=read.other)
        said = Answer((), (), 0.0)
        for _ in range(3):
            bus.run(read)
        (course,) = turns.pending
        known._said.update({1: said, 3: said})
        known[3] = said
        aim = Aim(ordered, lambda _: (), lambda _: None)
        turns.aims[aim] = course.at + since
        for _ in range(others):
            turns.aims[Aim((4,), lambda _: (), lambda _: None)] = -inf
        turns.tell()
        assert not turns.pending
        assert not course.pending
        assert turns.aims[aim] == -inf
        where = {node: None if answer is None else answer.at - course.at for node, answer in known.items()}
        heard = {
            node: (exchange is course.own, answer.at - course.at)
            for node, (exchange, answer) in known.seen.items()
        }
        found.append((where, [heard.get(node) for node in (1, 2)], sorted(known._said)))
    assert found[0] == found[1]
