"""What is known beforehand of an exchange that is kept, and what is made good as soon as anybody looks."""

from __future__ import annotations

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
