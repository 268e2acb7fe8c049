"""Operations step by step: results, errors and interruptions go where they belong."""

from __future__ import annotations

import pytest

from motorbus.bus.pump import Bus
from motorbus.core.operation import (
    Alone,
    Effect,
    Exchange,
    Journal,
    Listen,
    Notice,
    Operation,
    Pause,
    Progress,
    Report,
    Runnable,
    Together,
    Tune,
    outcome,
)
from motorbus.errors import Interrupted, MotorbusError, NoReply, RequestError
from tests.bus.responder import LOCK, guarded, memory_bus, position, positions, write


def test_an_operation_gets_its_answers_and_returns_its_value() -> None:
    bus, _ = memory_bus()

    def everything() -> Operation[tuple[int, list[int], int]]:
        one = yield from position(1)
        two = yield from Together([position(2), position(3)])
        three = yield from Alone(position(4))
        return one, two, three

    assert bus.run(everything()) == (1, [2, 3], 4)


def test_a_pause_lets_time_pass_on_the_links_clock() -> None:
    bus, _ = memory_bus()

    def wait() -> Operation[None]:
        yield from Pause(3600.0)

    bus.run(wait())
    assert bus.link.now() == pytest.approx(3600.0)


def test_a_listener_gets_none_when_nothing_is_said() -> None:
    bus, _ = memory_bus()

    def wait() -> Operation[Notice | None]:
        return (yield from Listen(lambda notice: True, 0.5))

    assert bus.run(wait()) is None
    assert bus.link.now() == pytest.approx(0.5)


def test_tune_reaches_link_and_turns() -> None:
    bus, responder = memory_bus()

    def change() -> Operation[tuple[int, int, int]]:
        before = yield from Tune(500_000)
        present = yield from Tune(0)
        return before, present, (yield from position(1))

    assert bus.run(change()) == (1_000_000, 500_000, 1)
    assert (bus.rate, responder.rate) == (500_000, 500_000)


def test_one_failure_in_together_does_not_stop_the_others() -> None:
    bus, responder = memory_bus()
    responder.dead = {2, 4}

    def several() -> Operation[list[int]]:
        return (yield from Together([position(n) for n in (1, 2, 3, 4)]))

    with pytest.raises(NoReply, match="node 2") as caught:
        bus.run(several())
    assert "node 4" in "".join(caught.value.__notes__)
    assert {packet.id for packet in responder.heard} == {1, 2, 3, 4}


def test_outcomes_are_collected_in_order() -> None:
    bus, responder = memory_bus()
    responder.dead = {2}

    def several() -> Operation[list[int | MotorbusError]]:
        tries: list[Operation[int | MotorbusError]] = [outcome(position(n)) for n in (1, 2, 3)]
        return (yield from Together(tries))

    one, two, three = bus.run(several())
    assert (one, three) == (1, 3)
    assert isinstance(two, NoReply)


def test_nothing_interleaves_with_an_operation_alone_not_even_a_sibling() -> None:
    bus, responder = memory_bus()

    def pair(node: int) -> Operation[None]:
        yield from write(node, 20, 1)
        yield from Alone(write(node, 21, 1))  # nested: belongs to the outer one
        yield from write(node, 22, 1)

    def siblings() -> Operation[None]:
        operations: list[Runnable[object]] = [alone(pair(1)), alone(pair(2)), position(3)]
        yield from Together(operations)

    def alone(operation: Operation[None]) -> Operation[None]:
        yield from Alone(operation)

    bus.run(siblings())
    order = [packet.id for packet in responder.heard]
    for node in (1, 2):
        first = order.index(node)
        assert order[first : first + 3] == [node] * 3, "three in a row, whatever stands around them"
    assert sorted(order) == [1, 1, 1, 2, 2, 2, 3]
    assert bus.turns.idle


def test_an_empty_together_is_an_empty_list() -> None:
    bus, _ = memory_bus()

    def nothing() -> Operation[list[int]]:
        empty: list[Exchange[int]] = []
        return (yield from Together(empty))

    assert bus.run(nothing()) == []


def test_reports_reach_the_listener_before_the_next_step() -> None:
    bus, responder = memory_bus()
    seen: list[tuple[object, int]] = []

    def work() -> Operation[None]:
        yield from Report(Progress(0, 2))
        yield from position(1)
        yield from Report(Progress(1, 2))
        yield from position(2)

    bus.run(work(), report=lambda event: seen.append((event, len(responder.heard))))
    assert seen == [(Progress(0, 2), 0), (Progress(1, 2), 1)]


def test_what_a_listener_raises_goes_into_the_operation() -> None:
    bus, responder = memory_bus()

    def work() -> Operation[None]:
        try:
            yield from Report("full disk")
        finally:
            yield from write(1, LOCK, 1)

    def fail(event: object) -> None:
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        bus.run(work(), report=fail)
    assert responder.heard[-1].parameters[0] == LOCK


def test_without_a_journal_a_guarded_change_is_refused_before_it_begins() -> None:
    bus, responder = memory_bus()

    def change() -> Operation[None]:
        yield from Report(Journal("change the id", "begun", {}))
        yield from write(1, 5, 2)

    with pytest.raises(RequestError, match="keeps no journal"):
        bus.run(change())
    assert responder.heard == []


def test_an_error_in_the_reader_is_raised_in_the_operation() -> None:
    bus, _ = memory_bus()

    def refuse(answer: object) -> int:
        raise RequestError("not this")

    def work() -> Operation[str]:
        try:
            yield from Exchange(position(1).request, position(1).replies, refuse)
        except RequestError:
            return "caught"
        return "missed"

    assert bus.run(work()) == "caught"


def interrupted(bus: Bus, operation: Operation[None], after: int) -> None:
    """Run it and press Ctrl-C when the bus has been turned `after` times."""
    turn, count = bus.relay.turn, 0

    def pressed() -> None:
        nonlocal count
        count += 1
        if count == after:
            raise KeyboardInterrupt
        turn()

    bus.relay.turn = pressed  # type: ignore[method-assign]
    try:
        bus.run(operation)
    finally:
        bus.relay.turn = turn  # type: ignore[method-assign]


@pytest.mark.parametrize("after", range(1, 5))
def test_an_interrupted_sequence_closes_its_lock(after: int) -> None:
    bus, responder = memory_bus()
    with pytest.raises(KeyboardInterrupt):
        interrupted(bus, guarded(1, 9), after)
    assert responder.memory[1][LOCK] == 1
    assert bus.run(position(1)) == 1


@pytest.mark.parametrize("after", range(1, 8))
def test_children_are_cancelled_in_order_and_all_clean_up(after: int) -> None:
    bus, responder = memory_bus()

    def several() -> Operation[None]:
        yield from Together([guarded(1, 9), guarded(2, 9)])

    with pytest.raises(KeyboardInterrupt):
        interrupted(bus, several(), after)
    assert responder.memory[1][LOCK] == responder.memory[2][LOCK] == 1
    assert bus.run(positions(1, 2)).missing == ()


def test_what_a_clean_up_failed_with_goes_with_the_interruption() -> None:
    bus, _ = memory_bus()

    def turning() -> Operation[None]:
        try:
            yield from Pause(1e9)
        finally:
            error = RequestError("the motor may be turning")
            error.add_note("project 1 is as it was lent")
            raise error

    with pytest.raises(KeyboardInterrupt) as cut:
        interrupted(bus, turning(), 2)
    assert cut.value.__notes__ == ["the motor may be turning", "project 1 is as it was lent"]
    with pytest.raises(KeyboardInterrupt) as plain:
        interrupted(bus, guarded(1, 9), 2)
    assert not hasattr(plain.value, "__notes__")


def test_of_several_that_were_cut_off_each_thing_is_said_once() -> None:
    bus, _ = memory_bus()

    def waiting(error: RequestError | None = None) -> Operation[None]:
        try:
            yield from Pause(1e9)
        finally:
            if error is not None:
                raise error

    def together(*errors: RequestError | None) -> Operation[None]:
        yield from Together([waiting(error) for error in errors])

    with pytest.raises(KeyboardInterrupt) as plain:
        interrupted(bus, together(None, None), 2)
    assert not hasattr(plain.value, "__notes__")
    with pytest.raises(KeyboardInterrupt) as cut:
        interrupted(bus, together(None, RequestError("it may turn"), RequestError("it may turn")), 2)
    assert cut.value.__notes__ == ["it may turn"]
    with pytest.raises(KeyboardInterrupt) as first:
        interrupted(bus, together(RequestError("it may turn"), None, RequestError("so may this")), 2)
    assert first.value.__notes__ == ["it may turn", "so may this"]


def test_of_several_that_an_emergency_stop_ended_it_is_said_once() -> None:
    bus, _ = memory_bus()
    bus.estop()

    def together() -> Operation[None]:
        yield from Together([write(node, 0, 9, Effect.MOTION) for node in (1, 2)])

    with pytest.raises(Interrupted) as stopped:
        bus.run(together())
    assert not hasattr(stopped.value, "__notes__")


def test_a_clean_up_that_cannot_end_is_given_up() -> None:
    bus, responder = memory_bus()

    def stubborn() -> Operation[None]:
        try:
            yield from Pause(1e9)
        finally:
            for _ in range(1000):
                yield from outcome_of_pause()

    def outcome_of_pause() -> Operation[None]:
        try:
            yield from Pause(1.0)
        except MotorbusError:
            return

    with pytest.raises(KeyboardInterrupt):
        interrupted(bus, stubborn(), 2)
    assert bus.link.now() < 1000
    assert bus.run(position(1)) == 1
    assert responder.dead == set()


@pytest.mark.parametrize(
    ("rest", "reached"), [(0.4, True), (1.9, True), (5.0, True), (29.0, True), (31.0, False)]
)
def test_a_clean_up_that_waits_for_something_to_come_to_rest_gets_its_time(
    rest: float, reached: bool
) -> None:
    bus, responder = memory_bus()

    def turning() -> Operation[None]:
        try:
            yield from Pause(1e9)
        finally:
            yield from Pause(rest)
            yield from write(1, 0, 9)

    with pytest.raises(KeyboardInterrupt):
        interrupted(bus, turning(), 2)
    assert (responder.memory[1][0] == 9) is reached


def test_a_second_ctrl_c_takes_that_time_away() -> None:
    bus, _ = memory_bus()
    presses, turn = [2, 3], bus.relay.turn
    count = 0

    def pressed() -> None:
        nonlocal count
        count += 1
        if count in presses:
            raise KeyboardInterrupt
        turn()

    def turning() -> Operation[None]:
        try:
            yield from Pause(0.1)
            yield from Pause(1e9)
        finally:
            yield from Pause(20.0)

    bus.relay.turn = pressed  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        bus.run(turning())
    assert bus.link.now() < 1.0
