"""What comes in: only the reply that is due, whole, alone and of a node that may be believed, is an answer."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Answer, Due, Exchange
from motorbus.errors import ChecksumError, MotorbusError, NoReply, OutcomeUnknown
from motorbus.families.feetech import wire
from tests.bus.script import Script, ping, position, positions, reply


def test_arriving_bytes_do_not_move_the_deadline() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    deadline = script.turns.due()
    while script.now < deadline - 0.001:
        script.feed(b"\x55" * 20, after=0.001)
        assert script.turns.due() == deadline


def test_leading_noise_is_tolerated_and_trailing_is_not() -> None:
    script = Script()
    good = script.submit(position(1))
    script.sent()
    script.feed(b"\x00\xff\x12" + reply(1))
    assert good.error is None
    assert good.done
    bad = script.submit(position(2))
    script.sent()
    script.feed(reply(2) + b"\x00")
    assert not bad.done
    assert script.send() is None, "node 2 must be left alone and probed first"


@pytest.mark.parametrize("tail", [b"\xff", b"\xff\xff", b"\xff\xff\x02"])
def test_a_tail_that_could_begin_a_frame_is_surplus_too(tail: bytes) -> None:
    script = Script()
    flight = script.submit(position(2))
    script.sent()
    script.feed(reply(2) + tail)
    assert not flight.done


def test_a_reply_of_another_node_is_counted_and_dropped() -> None:
    script = Script()
    flight = script.submit(position(1))
    script.sent()
    script.feed(reply(9))
    assert not flight.done
    script.feed(reply(1))
    assert flight.done
    assert script.turns.statistics.other["foreign"] == 1


def test_a_late_reply_is_never_the_next_answer() -> None:
    script = Script()
    first = script.submit(position(1))
    script.sent()
    script.time_out()
    script.wait(script.turns.family.quiet_time(1_000_000))
    probe = script.sent()
    script.feed(reply(1, 1111))  # the answer to the first request, a whole quiet time late
    assert not first.done
    script.feed(wire.encode_status(1, 0, bytes([1]) + bytes(probe[6] - 1)))
    script.sent()
    script.feed(reply(1, 2222))
    assert first.result().replies[0].data == reply(1, 2222)
    assert script.turns.statistics.other["late"] == 1


def test_a_reply_of_the_wrong_length_spoils_the_try() -> None:
    script = Script()
    flight = script.submit(position(1))
    script.sent()
    script.feed(wire.encode_status(1, 0, b"\x01\x02\x03"))
    script.feed(reply(1))
    assert not flight.done


def test_in_a_group_only_the_node_that_erred_is_lost() -> None:
    script = Script()
    flight = script.submit(positions(1, 2, 3))
    script.sent()
    script.feed(reply(1) + wire.encode_status(2, 0) + reply(3))
    assert flight.result().missing == (2,)


def test_noise_behind_a_reply_of_a_group_casts_doubt_on_that_reply_alone() -> None:
    """One byte too many can make a reply that looks whole out of a wrong one, and leave its last byte behind."""
    script = Script()
    flight = script.submit(positions(1, 2, 3))
    script.sent()
    script.feed(reply(1) + reply(2) + b"\x11" + reply(3))
    assert flight.result().missing == (2,)
    assert not script.turns.trust.of(3).tainted
    assert script.turns.trust.of(2).tainted


def test_noise_in_front_of_a_train_does_no_harm() -> None:
    script = Script()
    flight = script.submit(positions(1, 2))
    script.sent()
    script.feed(b"\x11" + reply(1) + reply(2))
    assert flight.result().missing == ()


def test_replies_of_a_group_may_come_in_any_order_and_any_cut() -> None:
    script = Script()
    flight = script.submit(positions(1, 2, 3))
    script.sent()
    train = reply(3, 3) + reply(1, 1) + reply(2, 2)
    for index in range(len(train)):
        script.feed(train[index : index + 1], after=0.00001)
    assert not flight.done, "what came in pieces gets the time of one more byte"
    script.time_out()
    assert [r.data for r in flight.result().replies] == [reply(1, 1), reply(2, 2), reply(3, 3)]


def test_a_damaged_reply_says_so() -> None:
    script = Script()
    flight = script.submit(ping(1))
    script.sent()
    script.feed(bytes.fromhex("FFFF010200FB"))
    script.time_out()
    with pytest.raises(ChecksumError) as caught:
        flight.result()
    assert "damaged" in str(caught.value)
    assert "FF FF 01 02 01 FB" in str(caught.value)
    assert caught.value.node == 1


def test_an_echo_that_was_not_there_before_forges_nothing() -> None:
    script = Script()
    flight = script.submit(position(1))
    request = script.sent()
    script.feed(request)
    script.time_out()
    assert not flight.done
    script.wait(script.turns.family.quiet_time(1_000_000))
    probe = script.sent()
    script.feed(probe)
    script.feed(wire.encode_status(1, 0, bytes([1]) + bytes(probe[6] - 1)))
    assert script.turns.echo.present is True
    request = script.sent()
    script.feed(request + reply(1, 77))
    assert flight.result().replies[0].data == reply(1, 77)


def test_a_reply_that_looks_like_an_echo_is_believed_once_echo_is_excluded() -> None:
    script = Script()
    flight = script.submit(ping(1))
    request = script.sent()
    alarm = wire.encode_status(1, 1)  # the ping reply with the voltage alarm is the very request
    assert alarm == request
    script.feed(alarm)
    script.time_out()
    assert not flight.done
    script.clear(1)
    script.sent()
    script.feed(alarm)
    assert flight.done
    assert flight.error is None


def test_echo_that_ceases_is_noticed() -> None:
    script = Script()
    script.turns.echo.present = True
    flight = script.submit(position(1))
    script.sent()
    script.feed(reply(1))
    assert not flight.done
    script.clear(1)
    assert script.turns.echo.present is False
    script.sent()
    script.feed(reply(1))
    assert flight.done


def test_a_paced_link_refuses_a_reply_that_came_sooner_than_light() -> None:
    script = Script(paced=True)
    flight = script.submit(position(1))
    script.sent()
    script.feed(reply(1), after=0.00005)
    assert not flight.done
    assert script.turns.statistics.of(1).errors["early"] == 1


def test_statistics_balance() -> None:
    script = Script()
    for node in (1, 2, 1):
        script.submit(position(node))
        script.sent()
        script.feed(reply(node))
    script.submit(ping(5))
    script.sent()
    script.time_out()
    ledger = script.turns.statistics
    assert (ledger.of(1).sent, ledger.of(1).ok) == (2, 2)
    assert ledger.of(5).errors["silence"] == 1
    assert sum(ledger.of(1).latency) == 2
    for one in ledger.nodes.values():
        assert one.sent == one.ok + sum(one.errors.values())


def test_surplus_between_exchanges_taints_those_asked_lately() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    script.feed(reply(1))
    script.feed(b"\xaa\xbb")
    flight = script.submit(position(1))
    script.clear(1)
    script.sent()
    script.feed(reply(1))
    assert flight.done


def test_silence_has_a_cause_and_an_advice() -> None:
    script = Script()
    flight = script.submit(ping(3))
    script.sent()
    script.time_out()
    with pytest.raises(NoReply) as caught:
        flight.result()
    text = str(caught.value)
    assert "sent: FF FF 03 02 01 F9" in text
    assert "expected: 6 bytes from node 3" in text
    assert "likely cause" in text
    assert "what to do" in text


def in_turn(node: int, count: int = 2) -> Exchange[Answer]:
    """A READ whose other form reads a byte more."""
    other = 5 - count
    return Exchange(
        wire.read(node, 56, count),
        (Due(node, node, 6 + count),),
        repeatable=True,
        other=lambda: in_turn(node, other),
    )


def test_a_second_copy_of_the_last_reply_is_not_the_next() -> None:
    script = Script()
    prepared = in_turn(1)
    script.submit(prepared)
    assert script.sent() == wire.read(1, 56, 2)
    script.feed(reply(1, 1111))
    flight = script.submit(prepared)
    assert script.sent() == wire.read(1, 56, 3), "another length than the last"
    script.feed(reply(1, 1111))
    assert not flight.done, "the copy, a little late"
    script.feed(wire.encode_status(1, 0, b"\x22\x22\x00"))
    assert not flight.done, "this node is in doubt now"
    script.clear(1)
    script.sent()
    last = script.turns.flying[0].exchange.replies
    assert isinstance(last, tuple)
    script.feed(wire.encode_status(1, 0, b"\x33\x33\x00"[: last[0].length - 6]))
    assert flight.result().replies[0].data[5:7] == b"\x33\x33"


def test_lengths_take_turns_only_where_the_last_reply_looked_alike() -> None:
    script = Script()
    lengths = []
    for node in (1, 2, 1, 1, 2):
        script.submit(in_turn(node))
        request = script.sent()
        lengths.append((node, request[6]))
        script.feed(wire.encode_status(node, 0, bytes(request[6])))
    assert lengths == [(1, 2), (2, 2), (1, 3), (1, 2), (2, 3)]


def test_the_echo_of_an_earlier_write_is_no_answer() -> None:
    """A WRITE of one byte that nobody acknowledges has the length of the reply to a READ of two."""
    script = Script()
    unanswered: Exchange[Answer] = Exchange(wire.write(1, 41, b"\x07"))
    script.submit(unanswered)
    echo = script.sent()
    flight = script.submit(position(1))
    script.sent()
    script.feed(echo)
    assert not flight.done
    assert script.turns.echo.present is None


def saying(request: bytes) -> Exchange[Answer]:
    """An exchange whose reply is the beginning of its request, as with FEETECH a ping that meets its own alarm."""
    return Exchange(request, (Due(1, 1, 6),))


LONGER = wire.encode_status(1, 0) + bytes(5)
"""A made-up request of 11 bytes that begins with a whole status frame."""


def unsure() -> Script:
    script = Script()
    script.turns.echo.doubted()
    return script


def test_a_reply_that_may_be_an_echo_waits_for_the_rest_of_it() -> None:
    script = unsure()
    flight = script.submit(saying(LONGER))
    script.sent()
    script.feed(LONGER[:6])
    assert not flight.done
    assert script.turns.due() - script.now == pytest.approx(3 * 10 / 1_000_000)
    script.feed(LONGER[6:], after=0.00002)
    assert isinstance(flight.error, MotorbusError), "it was an echo"
    assert script.turns.trust.of(1).tainted


def test_when_no_more_comes_it_is_the_reply() -> None:
    script = unsure()
    flight = script.submit(saying(LONGER))
    script.sent()
    script.feed(LONGER[:6])
    script.time_out()
    assert flight.result().replies[0].data == LONGER[:6]


def test_once_an_echo_is_excluded_nothing_waits() -> None:
    script = unsure()
    script.submit(position(1))
    script.sent()
    script.feed(reply(1))
    assert script.turns.echo.present is False, "an answer came, and no echo before it"
    flight = script.submit(saying(LONGER))
    script.sent()
    script.feed(LONGER[:6])
    assert flight.done


def test_an_echo_that_begins_later_on_is_found_out_though_no_reply_looks_like_it() -> None:
    script = Script()
    flight = script.submit(saying(LONGER))
    script.sent()
    script.feed(LONGER + reply(1))
    assert isinstance(flight.error, OutcomeUnknown)
    assert script.turns.echo.present is None, "the next probe finds out"


def test_the_beginning_of_an_echo_that_should_be_whole_is_no_reply() -> None:
    script = Script()
    script.turns.echo.present = True
    flight = script.submit(saying(LONGER))
    script.sent()
    script.feed(LONGER[:6])
    script.time_out()
    assert isinstance(flight.error, OutcomeUnknown)
