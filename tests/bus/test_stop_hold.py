"""An emergency stop where devices must be told a position to hold at: only a fresh one counts, else it is asked for."""

from __future__ import annotations

import pytest

from motorbus.bus.known import FRESH
from motorbus.bus.pump import Bus
from motorbus.bus.stop import ROUNDS
from motorbus.core.operation import Operation, Pause, Tune
from tests.bus.lanes import Lanes, Nodes, can_bus, everyone, move, number, read


def stops(bus: Bus) -> list[dict[int, bool]]:
    family = bus.family
    assert isinstance(family, Lanes)
    return family.stops


def wait(bus: Bus, seconds: float) -> None:
    def pause() -> Operation[None]:
        yield from Pause(seconds)

    bus.run(pause())


def test_a_fresh_position_is_held_at_once() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    asked = nodes.asked(1)
    outcome = bus.estop()
    assert outcome.acknowledged == (1,)
    assert outcome.rounds == 1
    assert nodes.orders(1) == [100]
    assert nodes.asked(1) == asked, "nobody had to be asked"


def test_a_position_that_is_not_fresh_is_asked_for_and_then_held_in_the_same_round() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    wait(bus, FRESH)
    nodes.positions[1] = 777
    outcome = bus.estop()
    assert outcome.acknowledged == (1,)
    assert outcome.silent == ()
    assert outcome.rounds == 1
    assert nodes.orders(1) == [777]


def test_an_order_to_move_makes_a_position_stale_at_once() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    bus.run(read(2))
    bus.run(move(1, 500))
    nodes.positions[1] = 300
    bus.estop()
    assert nodes.orders(1) == [500, 300], "not the 100 it was at before it was told to move"
    assert nodes.orders(2) == [200]


def test_frames_made_beforehand_hold_no_old_position() -> None:
    bus, _ = can_bus(pace=True)
    bus.run(read(1))
    bus.run(read(2))
    assert stops(bus)[-1] == {1: False, 2: False}
    with bus.turns.lock:
        bus.turns.latch(bus.link.now())
    assert stops(bus)[-1] == {1: True, 2: True}


def test_an_answer_to_a_question_is_no_acknowledgement_of_the_stop() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    wait(bus, FRESH)
    family = bus.family
    assert isinstance(family, Lanes)
    unknowing = type(
        "Unknowing", (Lanes,), {"stop": lambda self, nodes: Lanes.stop(self, dict.fromkeys(nodes))}
    )
    bus.turns.family = unknowing()
    outcome = bus.estop()
    assert nodes.asked(1) > 1
    assert nodes.orders(1) == []
    assert (outcome.acknowledged, outcome.silent, outcome.rounds) == ((), (1,), ROUNDS)


def test_a_node_that_is_silent_does_not_keep_the_others_from_being_held_at_once() -> None:
    bus, nodes = can_bus(Nodes(tuple(range(1, 9))), pace=True)
    for node in nodes.positions:
        bus.run(read(node))
    wait(bus, FRESH)
    nodes.dead = {1, 5}
    begun = bus.link.now()
    orders: list[float] = []
    obey = nodes.receive

    def receive(data: object, at: float) -> None:
        before = sum(len(nodes.orders(node)) for node in nodes.positions)
        obey(data, at)  # type: ignore[arg-type]
        if sum(len(nodes.orders(node)) for node in nodes.positions) > before:
            orders.append(at - begun)

    nodes.receive = receive  # type: ignore[method-assign]
    outcome = bus.estop()
    assert sorted(outcome.acknowledged) == [2, 3, 4, 6, 7, 8]
    assert outcome.silent == (1, 5)
    assert outcome.rounds == ROUNDS
    assert max(orders) < 0.01, "everyone who answers is held within the first round"
    assert [len(nodes.orders(node)) for node in (2, 3, 4, 6, 7, 8)] == [1] * 6
    assert nodes.asked(1) == 1 + ROUNDS


def test_one_that_hears_but_is_not_heard_is_held_if_its_position_was_fresh() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    nodes.mute = {1}
    outcome = bus.estop()
    assert nodes.orders(1) == [100]
    assert outcome.silent == (1,)


def test_one_that_was_silent_for_a_while_is_held_when_it_answers() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    wait(bus, FRESH)
    nodes.dead = {1}
    obey = nodes.receive

    def receive(data: object, at: float) -> None:
        obey(data, at)  # type: ignore[arg-type]
        if nodes.asked(1) == 3:
            nodes.dead = set()

    nodes.receive = receive  # type: ignore[method-assign]
    outcome = bus.estop()
    assert outcome.acknowledged == (1,)
    assert outcome.rounds == 3
    assert nodes.orders(1) == [100]


def test_a_family_whose_stop_fails_later_has_its_first_frames_repeated() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    bus.run(read(2))
    nodes.mute = {2}
    family = bus.family
    assert isinstance(family, Lanes)
    stop, calls = family.stop, []

    def once(nodes_: object) -> object:
        calls.append(nodes_)
        if len(calls) > 1:
            raise ZeroDivisionError
        return stop(nodes_)  # type: ignore[arg-type]

    family.stop = once  # type: ignore[assignment]
    outcome = bus.estop()
    assert outcome.acknowledged == (1,)
    assert nodes.orders(1) == [100]
    assert nodes.orders(2) == [200] * ROUNDS


def test_a_position_told_by_a_flying_exchange_counts_too() -> None:
    bus, _ = can_bus(pace=True)
    with bus.turns.lock:
        bus.turns.known[1] = None
    answer = bus.run(read(1))
    known = bus.turns.known.fresh(bus.link.now())[1]
    assert known is not None
    assert number(known) == answer
    assert bus.turns.known.fresh(bus.link.now() + FRESH)[1] is None


def test_a_stop_speaks_again_where_an_operation_only_listened() -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))

    def listen() -> Operation[None]:
        yield from Tune(125_000, listen_only=True)

    bus.run(listen())
    outcome = bus.estop()
    assert outcome.acknowledged == (1,)
    assert nodes.rate == bus.rate == 500_000
    assert not bus.turns.listening


def test_a_stop_on_a_link_that_never_speaks_says_that_nothing_was_sent() -> None:
    nodes = Nodes()
    bus, _ = can_bus(nodes)
    with bus.turns.lock:
        bus.turns.known[1] = None
        bus.turns.listen_only = bus.turns.listening = True
    outcome = bus.estop()
    assert nodes.heard == []
    assert outcome.silent == (1,)
    assert outcome.rounds == 0
    assert "only listens" in outcome.promise


@pytest.mark.parametrize("seconds", [0.0, FRESH, 1.0])
def test_twice_is_as_good_as_once(seconds: float) -> None:
    bus, nodes = can_bus(pace=True)
    bus.run(read(1))
    for _ in range(2):
        wait(bus, seconds)
        assert bus.estop().acknowledged == (1,)
    assert nodes.orders(1) == [100, 100]


def test_who_has_answered_everyone_is_known_to_the_stop() -> None:
    bus, nodes = can_bus(pace=True)
    answered = sorted(reply.lane for reply in bus.run(everyone()).replies)
    assert answered
    assert sorted(bus.estop().acknowledged) == answered
    assert all(nodes.orders(node) for node in answered)
