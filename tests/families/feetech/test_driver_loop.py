"""Prepared group operations: made once, run each cycle, and refused when the servos are not known."""

from __future__ import annotations

from math import inf, nan, tau
from typing import Any

import pytest

from motorbus.core.operation import ANY, UNLIKE, Answer, Effect, Goal, Rank, Reply
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.driver import (
    Node,
    position_reads,
    read_positions,
    sync_read_positions,
    sync_write_positions,
)
from tests.families.feetech.driver_script import (
    ALL,
    SYNC_WRITE,
    Line,
    low_high,
    packet,
    play,
    prepared,
    sync_reads,
    unheard,
    watch,
)

COUNT = tau / 4096


def test_positions_of_all_in_one_exchange_that_may_be_kept() -> None:
    one, other = prepared(1), prepared(2)
    exchange = sync_read_positions([one, other])
    assert exchange.tells_position
    for raw in (0, 1304):
        found = play(exchange, sync_reads(56, {1: low_high(raw), 2: low_high(-5)}, 2))
        assert found.values == {1: pytest.approx(raw * COUNT), 2: pytest.approx(-5 * COUNT)}
        assert (found.missing, found.at) == ((), one.at)


def test_where_they_are_is_told_by_the_settings_that_they_have_when_it_is_asked() -> None:
    one, other = prepared(1), prepared(2)
    exchange = sync_read_positions([one, other])
    tells: Any = exchange.tells_position
    replies = tuple(Reply(0, node, packet(node, 0, *low_high(raw))) for node, raw in ((1, 1000), (2, 2048)))
    answer = Answer(replies, (), 1.0)
    fresh = tells(answer)
    assert fresh == {1: pytest.approx(1000 * COUNT), 2: pytest.approx(2048 * COUNT)}
    assert exchange.read is not None
    exchange.read(answer).values.clear()  # what was given away is not what is kept
    assert tells(answer) == fresh
    assert tells(answer._replace(replies=replies[:1])) == {1: fresh[1]}
    other.settings = prepared(2, at_30=2).settings
    assert tells(answer) == {1: fresh[1], 2: pytest.approx(2048 * COUNT * 2)}
    one.forget_settings()
    assert tells(answer) == {2: pytest.approx(2048 * COUNT * 2)}


def test_settings_that_were_read_once_more_and_are_the_same_count_as_the_same() -> None:
    one, other = prepared(1), prepared(2)
    exchange: Any = sync_read_positions([one, other])
    data = packet(1, 0, *low_high(1304)) + packet(2, 0, *low_high(8))
    frames = tuple(Reply(0, id, packet(id, 0, *low_high(raw))) for id, raw in ((1, 1304), (2, 8)))
    for at in (1.0, 2.0, 3.0):
        found = exchange.whole(data, at)
        assert found.values == {1: 1304 * COUNT, 2: 8 * COUNT}
        assert exchange.tells_position(Answer(frames, (), found.at)) == found.values
        one.settings = prepared(1).settings
    other.settings = prepared(2, at_30=2).settings
    assert exchange.tells_position(Answer(frames, (), found.at)) == {1: 1304 * COUNT, 2: 2 * 8 * COUNT}
    assert exchange.whole(data, 4.0) is UNLIKE
    one.forget_settings()
    assert exchange.whole(data, 5.0) is UNLIKE


def test_a_missing_position_is_missing_and_never_replaced() -> None:
    one, other = prepared(1), prepared(2)
    frames = [packet(2, 0x01, 0, 8)]
    found = play(sync_read_positions([one, other]), Line(sync_reads(56, {1: None, 2: None}, 2).sent, frames))
    assert found.values == {2: pytest.approx(2048 * COUNT)}
    assert found.missing == (1,)
    assert other.alarm == ("voltage",)


def test_a_train_too_long_for_a_stop_is_refused_unless_asked_for() -> None:
    nodes = [prepared(id) for id in range(51)]
    with pytest.raises(RequestError, match="more than 4 ms of air"):
        sync_read_positions(nodes)
    assert len(sync_read_positions(nodes, air=0.005).replies) == 51  # type: ignore[arg-type]
    with pytest.raises(RequestError, match="at 115200 bit/s"):
        sync_read_positions(nodes[:6], rate=115_200)


def test_goals_of_all_in_one_packet() -> None:
    one, other = prepared(1), prepared(2, at_30=2)
    exchange = sync_write_positions([one, other], [1304 * COUNT, 2 * 2048 * COUNT])
    assert exchange.goals == (
        Goal(1, "position", 1304 * COUNT, 0.0, 4095 * COUNT),
        Goal(2, "position", 2048 * COUNT * 2, 0.0, 4095 * COUNT * 2),
    )
    assert (exchange.effect, exchange.rank, exchange.replies) == (Effect.MOTION, Rank.CONTROL, ())
    watch(exchange, Line(packet(ALL, SYNC_WRITE, 42, 2, 1, 0x18, 5, 2, 0, 8), None))


@pytest.mark.parametrize("to", [nan, inf, -inf])
def test_goals_that_are_no_numbers_are_refused(to: float) -> None:
    with pytest.raises(LimitExceeded, match="is no position"):
        sync_write_positions([prepared(1)], [to])


def test_servos_that_are_not_prepared_are_refused_with_advice() -> None:
    for make in (lambda: sync_read_positions([Node(1)]), lambda: sync_write_positions([Node(1)], [0.0])):
        with pytest.raises(RequestError, match="not prepared") as caught:
            make()
        assert "prepare()" in caught.value.advice


def test_servos_in_other_modes_are_refused() -> None:
    with pytest.raises(RequestError, match="operating mode velocity"):
        sync_write_positions([prepared(1, at_33=1)], [0.0])


def test_more_than_a_packet_carries_are_refused() -> None:
    nodes = [prepared(id) for id in range(84)]
    assert sync_write_positions(nodes[:83], [0.0] * 83).replies == ()
    with pytest.raises(RequestError, match="one packet cannot carry"):
        sync_write_positions(nodes, [0.0] * 84)


@pytest.mark.parametrize(("count", "message"), [(1, "1 positions for 2 servos"), (3, "3 positions for 2")])
def test_each_servo_needs_its_position(count: int, message: str) -> None:
    with pytest.raises(RequestError, match=message):
        sync_write_positions([prepared(1), prepared(2)], [0.0] * count)


def test_a_servo_named_twice_is_refused() -> None:
    one = prepared(1)
    with pytest.raises(RequestError, match="named twice"):
        sync_read_positions([one, one])


def test_the_exchanges_behind_a_reading_keep_each_train_short_and_may_be_kept() -> None:
    nodes = [prepared(id) for id in range(1, 41)]
    slow = position_reads(nodes, rate=115_200)
    assert len(slow) > 1
    assert sum(len(one.replies) for one in slow if one.replies is not ANY) == 40
    assert len(position_reads(nodes)) == 1


def test_a_reading_of_all_is_made_anew_and_tells_who_is_missing() -> None:
    nodes = [prepared(1), prepared(2)]
    line = sync_reads(56, {1: (0, 8), 2: None}, 2)
    found = play(read_positions(nodes), line)
    assert (found.values, found.missing) == ({1: 2048 * COUNT}, (2,))
    nobody = play(read_positions([prepared(1)]), unheard(sync_reads(56, {1: (0, 0)}, 2)))
    assert (nobody.values, nobody.missing, nobody.at) == ({}, (1,), -inf)
    with pytest.raises(RequestError, match="not prepared"):
        play(read_positions([Node(1)]))
