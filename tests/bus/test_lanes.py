"""Several lanes on one wire: who goes when, how long a reply may take, and who gets what everyone was asked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import pytest

from motorbus.bus.pace import MARGIN
from motorbus.bus.pump import Bus
from motorbus.core.operation import (
    CanFrame,
    Operation,
    Rank,
    Runnable,
    Timeout,
    Together,
    Tune,
    outcome,
)
from motorbus.errors import NoReply
from tests.bus.lanes import (
    GOAL,
    NUMBER,
    POSITION,
    RATE,
    READ,
    WRITE,
    CanScript,
    Nodes,
    can_bus,
    everyone,
    move,
    read,
    said,
)


def side_by_side(bus: Bus, operations: Sequence[Runnable[None]]) -> None:
    def all_of_them() -> Operation[None]:
        yield from Together(operations)

    bus.run(all_of_them())


# -- together on the wire ---------------------------------------------------------------------------------------


def test_as_many_lanes_fly_as_the_window_allows_and_one_exchange_on_each() -> None:
    script = CanScript(window=3)
    flights = [script.submit(read(node)) for node in (1, 1, 2, 3, 4)]
    assert script.sent() == [1, 2, 3]
    script.feed(said(2, READ, POSITION, 22))
    assert [flight.done for flight in flights] == [False, False, True, False, False]
    assert script.sent() == [4], "the second of node 1 waits for its lane"
    script.feed(said(1, READ, POSITION, 11))
    assert script.sent() == [1]


def test_replies_in_any_order_go_to_their_own_exchange() -> None:
    script = CanScript()
    flights = {node: script.submit(read(node)) for node in (1, 2, 3)}
    script.sent()
    script.feed(*(said(node, READ, POSITION, 10 * node) for node in (3, 1, 2)))
    assert [flight.exchange.read(flight.result()) for flight in flights.values()] == [10, 20, 30]  # type: ignore[misc]


def test_a_deadline_allows_for_whatever_flies_with_it() -> None:
    script = CanScript()
    flights = [script.submit(read(node)) for node in range(1, 9)]
    script.sent()
    air = script.turns.family.air_time(read(1), RATE)
    own = 0.002 + MARGIN[Timeout.REPLY]
    expected = [script.now + 8 * air + own] * 8
    assert [flight.deadline for flight in flights] == pytest.approx(expected, abs=8 * 10 / RATE)


def test_what_flies_later_puts_it_off_no_longer_than_a_full_window() -> None:
    script = CanScript(window=4)
    silent = script.submit(read(9))
    script.sent()
    latest = script.now + 4 * 1.1 * script.turns.family.air_time(read(9), RATE) + 0.022
    for turn in range(200):
        script.submit(read(1 + turn % 3))
        (node,) = script.sent()
        assert silent.deadline < latest
        script.feed(said(node, READ, POSITION), after=0.0001)
    assert script.turns.statistics.of(9).errors["silence"] == 0
    script.feed(after=0.01)
    assert script.turns.statistics.of(9).errors["silence"] == 1


def test_no_frame_that_arrives_moves_a_deadline() -> None:
    script = CanScript()
    first, second = script.submit(read(1)), script.submit(read(2))
    script.sent()
    before = second.deadline
    for _ in range(50):
        script.feed(CanFrame(0x582, bytes(4)), said(9, READ, POSITION), after=0.0001)
    script.feed(said(1, READ, POSITION))
    assert first.done
    assert second.deadline == before


def test_on_one_lane_a_deadline_is_what_it_was() -> None:
    script = CanScript(window=1)
    first = script.submit(read(1))
    script.submit(read(1))
    script.sent()
    air = script.turns.family.air_time(read(1), RATE)
    assert first.deadline == pytest.approx(script.now + air + 0.002 + MARGIN[Timeout.REPLY])


@pytest.mark.parametrize("rate", [20_000, 125_000, 1_000_000])
def test_a_full_window_on_a_slow_wire_times_nobody_out(rate: int) -> None:
    bus, _ = can_bus(Nodes(tuple(range(1, 17))), pace=True)

    def all_of_them() -> Operation[list[int]]:
        yield from Tune(rate)
        values: list[int] = []
        for _ in range(20):
            values += yield from Together([read(node) for node in range(1, 17)])
        return values

    assert bus.run(all_of_them()) == [100 * node for node in range(1, 17)] * 20
    assert all(ledger.sent == ledger.ok == 20 for ledger in bus.statistics.nodes.values())


# -- fairness ---------------------------------------------------------------------------------------------------


def test_nodes_get_turns_in_the_order_they_came() -> None:
    script = CanScript(window=2)
    for node in (5, 3, 9, 1, 7):
        script.submit(read(node))
    order = script.sent()
    while len(order) < 5:
        script.feed(said(order[-1], READ, POSITION))
        order += script.sent()
    assert order == [5, 3, 9, 1, 7]


def test_a_higher_rank_goes_first_whatever_its_lane() -> None:
    script = CanScript(window=1)
    for node, rank in ((1, Rank.CONFIGURATION), (2, Rank.POLL), (3, Rank.CONTROL)):
        script.submit(read(node, rank=rank))
    order = script.sent()
    while len(order) < 3:
        script.feed(said(order[-1], READ, POSITION))
        order += script.sent()
    assert order == [3, 2, 1]


def readings(nodes: Nodes, dead: int, counts: Counter[int]) -> Callable[[int], Operation[None]]:
    def endless(node: int) -> Operation[None]:
        for _ in range(20 if node == dead else 400):
            answer = yield from outcome(read(node))
            counts[node] += answer == nodes.positions[node]

    return endless


def test_a_dead_node_holds_up_nobody_else() -> None:
    """Nor does it take anything from them but the room its requests need."""
    took = {}
    for dead in (0, 3):
        bus, nodes = can_bus(Nodes(tuple(range(1, 7))), window=4, pace=True)
        nodes.dead = {dead}
        counts: Counter[int] = Counter()
        nodes_but_dead = [node for node in range(1, 7) if node != dead or not dead]
        one = readings(nodes, 3, counts)
        side_by_side(bus, [one(node) for node in range(1, 7)])
        took[dead] = bus.link.now()
        assert all(counts[node] == 400 for node in nodes_but_dead if node != 3)
    assert took[3] < 1.3 * took[0]


def test_all_nodes_get_the_same_share() -> None:
    bus, nodes = can_bus(Nodes(tuple(range(1, 17))), window=4, pace=True)
    counts: Counter[int] = Counter()
    least: list[int] = []

    def endless(node: int) -> Operation[None]:
        while sum(counts.values()) < 3200:
            assert (yield from read(node)) == nodes.positions[node]
            counts[node] += 1
            least.append(max(counts.values()) - min(counts[other] for other in nodes.positions))

    side_by_side(bus, [endless(node) for node in nodes.positions])
    assert max(least) <= 2, "nobody is ever more than a turn ahead"


def test_a_change_of_rate_is_not_put_off_for_ever_by_other_lanes() -> None:
    bus, nodes = can_bus(window=4)
    tuned = []

    def endless(node: int) -> Operation[None]:
        for _ in range(100):
            yield from read(node, rank=Rank.CONFIGURATION)

    def tune() -> Operation[None]:
        yield from read(1)
        yield from Tune(125_000)
        tuned.append(len(nodes.heard))

    side_by_side(bus, [*(endless(node) for node in (1, 2, 3, 4)), tune()])
    assert tuned[0] < 30


# -- whoever is there -------------------------------------------------------------------------------------------


def test_whoever_is_asked_by_all_answers_on_its_own_lane() -> None:
    script = CanScript()
    asked = script.submit(everyone())
    assert script.sent() == [0]
    script.feed(said(7, READ, NUMBER, 7), said(3, READ, NUMBER, 3))
    assert not asked.done, "others may come until the deadline"
    script.feed(said(5, READ, NUMBER, 5))
    script.time_out()
    assert [reply.lane for reply in asked.result().replies] == [7, 3, 5]
    assert script.turns.statistics.other["foreign"] == 0


def test_a_reply_that_somebody_awaits_is_not_taken_for_everyones() -> None:
    script = CanScript()
    own = script.submit(read(3))
    asked = script.submit(everyone())
    assert script.sent() == [3, 0]
    script.feed(said(3, READ, POSITION, 33), said(3, READ, NUMBER, 3), said(4, READ, NUMBER, 4))
    assert own.exchange.read is not None
    assert own.exchange.read(own.result()) == 33
    script.time_out()
    assert [(reply.lane, reply.data[1]) for reply in asked.result().replies] == [(3, NUMBER), (4, NUMBER)]


def test_the_answer_of_a_node_with_another_exchange_in_flight_is_everyones() -> None:
    script = CanScript()
    own, asked = script.submit(read(3)), script.submit(everyone())
    script.sent()
    script.feed(said(3, READ, NUMBER, 3))
    assert not own.done
    script.feed(said(3, READ, POSITION, 33))
    assert own.done
    assert own.error is None
    script.time_out()
    assert len(asked.result().replies) == 1


def test_what_is_outstanding_is_late_and_not_everyones() -> None:
    script = CanScript()
    lost = script.submit(read(3, timeout=Timeout.SCAN))
    script.sent()
    script.time_out()
    with pytest.raises(NoReply):
        lost.result()
    asked = script.submit(everyone())
    script.sent()
    script.feed(said(3, READ, POSITION, 33), said(3, READ, NUMBER, 3))
    script.time_out()
    assert [reply.data[1] for reply in asked.result().replies] == [NUMBER]
    assert script.turns.statistics.other["late"] == 1


def test_two_questions_to_everyone_do_not_overlap() -> None:
    script = CanScript()
    first, second = script.submit(everyone()), script.submit(everyone())
    assert script.sent() == [0]
    script.feed(said(3, READ, NUMBER, 3))
    script.time_out()
    assert len(first.result().replies) == 1
    assert script.sent() == [0]
    script.time_out()
    assert second.result().replies == ()


def test_a_broadcast_through_the_whole_bus() -> None:
    bus, nodes = can_bus(pace=True)
    replies = bus.run(everyone()).replies
    assert [reply.lane for reply in replies] == list(nodes.positions)


# -- what is not an answer --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "other", [said(1, READ, GOAL, 5), said(1, WRITE, POSITION, 5), said(2, READ, POSITION, 5)]
)
def test_an_answer_to_something_else_is_dropped_and_counted(other: CanFrame) -> None:
    script = CanScript()
    flight = script.submit(read(1))
    script.sent()
    script.feed(other)
    assert not flight.done
    assert script.turns.statistics.other["foreign"] == 1
    script.feed(said(1, READ, POSITION, 7))
    assert flight.exchange.read is not None
    assert flight.exchange.read(flight.result()) == 7


def test_a_reply_that_is_there_twice_is_asked_for_again() -> None:
    script = CanScript()
    flight = script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 7), said(1, READ, POSITION, 7))
    assert not flight.done


def test_a_write_is_settled_by_the_acknowledgement_of_its_own_object() -> None:
    script = CanScript()
    flight = script.submit(move(1, 5))
    script.sent()
    script.feed(said(1, WRITE, POSITION))
    assert not flight.done
    script.feed(said(1, WRITE, GOAL))
    assert flight.done
