"""Single exchanges, and what becomes of a write that is not acknowledged."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Due, Effect, Goal, Rank, Timeout
from motorbus.errors import ChecksumError, Interrupted, NoReply, OutcomeUnknown, VerificationFailed
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.exchanges import (
    Block,
    acknowledged,
    changed_since,
    confirmed,
    read_block,
    unanswered,
    verified,
    write_block,
)
from motorbus.families.feetech.driver.identity import learn
from tests.families.feetech.driver_script import (
    Line,
    image,
    packet,
    play,
    prepared,
    reads,
    unheard,
    watch,
    writes,
)

BLOCK = Block(41, b"\x05\x06", Effect.TORQUE)


def test_a_read_is_owed_its_exact_length_and_may_be_repeated() -> None:
    exchange = read_block(Node(3), 56, 2, bytes)
    assert exchange.replies == (Due(3, 3, 8),)
    assert exchange.repeatable
    assert (exchange.effect, exchange.rank, exchange.timeout) == (Effect.NONE, Rank.POLL, Timeout.REPLY)


@pytest.mark.parametrize(
    ("address", "count", "tells"), [(56, 2, True), (56, 15, True), (56, 1, False), (58, 2, False)]
)
def test_reads_that_begin_with_the_position_say_so(address: int, count: int, tells: bool) -> None:
    assert bool(read_block(Node(3), address, count, bytes).tells_position) is tells


def test_alarm_bits_travel_beside_the_value_and_never_raise() -> None:
    node = Node(3)
    assert play(read_block(node, 62, 1, bytes), reads(3, 62, 121, error=0x21)) == b"\x79"
    assert node.alarm == ("voltage", "overload")
    assert node.at > 100


def test_an_acknowledgement_with_alarms_is_an_acknowledgement() -> None:
    node = Node(3)
    play(write_block(node, BLOCK), writes(3, 41, 5, 6, error=0xFF))
    assert "temperature" in node.alarm
    assert len(node.alarm) == 8


def test_a_write_carries_effect_goals_and_repeatability() -> None:
    goal = Goal(3, "position", 1.0, 0.0, 2.0)
    exchange = write_block(Node(3), Block(42, b"\0\0", Effect.MOTION, (goal,), repeatable=False))
    assert (exchange.effect, exchange.goals, exchange.repeatable) == (Effect.MOTION, (goal,), False)
    assert exchange.replies == (Due(3, 3, 6),)


def test_nothing_is_due_from_a_servo_that_acknowledges_nothing() -> None:
    assert write_block(prepared(at_8=0), BLOCK).replies == ()


def test_what_comes_after_is_done_when_the_answer_is_there() -> None:
    done: list[str] = []
    exchange = acknowledged(Node(3), packet(3, 5), after=lambda: done.append("here"))
    assert done == []
    play(exchange, Line(packet(3, 5), packet(3, 0)))
    play(
        unanswered(packet(254, 5), Effect.MOTION, after=lambda: done.append("all")),
        Line(packet(254, 5), None),
    )
    assert done == ["here", "all"]


def test_an_acknowledged_write_is_not_read_back() -> None:
    play(confirmed(Node(3), BLOCK), writes(3, 41, 5, 6))


def test_a_servo_that_acknowledges_nothing_is_read_back() -> None:
    node = prepared(at_8=0)
    play(confirmed(node, BLOCK), unheard(writes(3, 41, 5, 6)), reads(3, 41, 5, 6))


@pytest.mark.parametrize("doubt", [NoReply("n"), OutcomeUnknown("o"), ChecksumError("c")])
def test_a_doubtful_write_is_read_back(doubt: BaseException) -> None:
    play(confirmed(Node(3), BLOCK), Line(writes(3, 41, 5, 6).sent, doubt), reads(3, 41, 5, 6))


def test_a_doubtful_write_that_did_not_take_effect_says_what_is_there() -> None:
    with pytest.raises(VerificationFailed, match="register 41 to 42") as caught:
        play(confirmed(Node(3), BLOCK), unheard(writes(3, 41, 5, 6)), reads(3, 41, 5, 7))
    assert (caught.value.sent, caught.value.received, caught.value.node) == (b"\5\6", b"\5\7", 3)
    assert isinstance(caught.value.__cause__, OutcomeUnknown)


def test_a_doubtful_write_stays_in_doubt_when_nobody_answers() -> None:
    with pytest.raises(OutcomeUnknown):
        play(confirmed(Node(3), BLOCK), unheard(writes(3, 41, 5, 6)), unheard(reads(3, 41, 0, 0)))


def test_a_write_that_must_not_be_repeated_stays_in_doubt_at_once() -> None:
    with pytest.raises(OutcomeUnknown):
        play(confirmed(Node(3), BLOCK._replace(repeatable=False)), unheard(writes(3, 41, 5, 6)))


def test_an_emergency_stop_is_no_doubt_to_be_settled() -> None:
    stopped = Interrupted("the bus is stopped")
    with pytest.raises(Interrupted):
        play(confirmed(Node(3), BLOCK), Line(writes(3, 41, 5, 6).sent, stopped))


@pytest.mark.parametrize("silent", [True, False])
def test_a_write_that_left_and_of_which_nobody_tells_is_of_unknown_outcome(silent: bool) -> None:
    """Also one whose effect is none: only the reply, or its reading back, can say whether it was heard."""
    asked = writes(3, 41, 5, 6)
    node, line = (
        (prepared(at_8=0), unheard(asked)) if silent else (prepared(), Line(asked.sent, NoReply("n")))
    )
    with pytest.raises(OutcomeUnknown, match="whether the write took effect is not known"):
        play(confirmed(node, BLOCK), line, unheard(reads(3, 41, 0, 0)))


def test_reading_back_may_take_as_long_as_the_write() -> None:
    played = watch(verified(Node(3), BLOCK, timeout=Timeout.STORE), reads(3, 41, 5, 6))
    assert played.exchanges[0].timeout is Timeout.STORE


def test_one_register_that_differs_is_named_alone() -> None:
    with pytest.raises(VerificationFailed, match="register 21 reads back different"):
        play(verified(Node(3), Block(21, b"\1")), reads(3, 21, 2))


def test_an_order_is_refused_once_the_settings_it_was_made_under_are_others() -> None:
    node = prepared()
    order = Block(42, b"\0\0", Effect.MOTION)
    at_once, kept = write_block(node, order), write_block(node, order._replace(under=node.settings))
    both = changed_since([(node, None), (prepared(4), None)])
    asked = [at_once.refusal, kept.refusal, both]
    assert all(refusal is not None and refusal(lambda _: 9) is None for refusal in asked)
    learn(node, image())  # read again, and the same
    assert all(refusal is not None and refusal(lambda _: 0) is None for refusal in asked)
    for change in (node.forget_settings, lambda: learn(node, image(at_33=1))):
        change()
        for refusal in asked:
            assert refusal is not None
            error = refusal(lambda _: 0)
            assert error is not None
            assert "before the settings of node 3 were changed" in error.summary
    assert kept.refusal is not None
    learn(node, image())
    assert kept.refusal(lambda _: 0) is None
