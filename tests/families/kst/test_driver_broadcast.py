"""Everyone at once: which frames, who acknowledged, and what is refused."""

from __future__ import annotations

import math

import pytest

from motorbus.core.operation import Alone, CanFrame
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.kst import (
    Started,
    broadcast_bit_rate,
    broadcast_node_id,
    broadcast_position,
    broadcast_read,
    broadcast_save,
    dialect_of,
)
from tests.families.kst.bench import abort, bench, play


def test_everyone_is_read_at_once() -> None:
    assert play(
        broadcast_read("present_position"),
        (
            "600#4002600000000000",
            ["1:4b02600084030000", "9:4b0260007cfc0000", "7:" + abort(0x6002, 0x0800_0000)],
        ),
    ) == {1: pytest.approx(math.pi / 2), 9: pytest.approx(-math.pi / 2)}
    with bench(ids=(1, 9)) as there:
        assert there.run(broadcast_read("node_id")) == {1: 1, 9: 9}


def test_what_cannot_be_read_is_refused() -> None:
    for name in ("store", "no_such_object"):
        with pytest.raises(RequestError):
            play(broadcast_read(name))


@pytest.mark.parametrize("ack", [True, False])
def test_everyone_moves_and_is_known_to_the_stop(ack: bool) -> None:
    with bench(ids=(1, 9, 20), broadcast_ack=ack) as there:
        assert there.run(broadcast_position(0.5, (1, 9, 20))) == ((1, 9, 20) if ack else ())
        assert there.sent() == ["600#220360001E010000"]
        assert sorted(there.estop().acknowledged) == [1, 9, 20]


def test_a_goal_for_everyone_passes_the_gate() -> None:
    with bench() as there:
        for to in (2.0, math.nan):
            with pytest.raises(LimitExceeded):
                there.run(broadcast_position(to, (5,)))
        with pytest.raises(RequestError, match="who is on this bus"):
            there.run(broadcast_position(0.1, ()))
        assert there.sent() == []


def test_everyone_saves_and_is_left_alone() -> None:
    with bench(ids=(1, 9)) as there:
        there.run(broadcast_bit_rate(250_000))
        assert there.run(broadcast_save()) == ()
        assert there.sent() == ["600#2201300004000000", "600#2210100173617665"]
        assert there.link.now() >= 0.17
        for node in (1, 9):
            there.sim(node).power_cycle()
            assert there.sim(node).bit_rate == 250_000


def test_nobody_gives_everyone_one_id_by_mistake() -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="every servo on this bus"):
            there.run(broadcast_node_id(9))
        with pytest.raises(RequestError):
            there.run(broadcast_node_id(128, force=True))
        assert there.sent() == []
        assert there.run(broadcast_node_id(9, dialect_of(there.family), force=True)) == (5,)
        assert there.sent() == ["600#2200300009000000"]


def test_both_id_formats_where_either_may_be() -> None:
    with bench(settings={"id_format": "auto"}, id_format="ext") as there:
        assert there.run(broadcast_read("node_id", dialect_of(there.family))) == {5: 5}
        assert there.sent() == ["600#4000300000000000", "00000600#4000300000000000"]


def test_where_there_is_a_start_rule_everyone_is_started_first() -> None:
    with bench(ids=(1, 9), profile="xqpower") as there:
        assert there.run(broadcast_position(0.3, (1, 9), dialect_of(there.family))) == (1, 9)
        assert there.of(Started) == [Started(0, CanFrame(0, b"\x01\0"))]
        there.link.advance(2.0)
        assert there.servo(9).position() == pytest.approx(0.3, abs=0.001)


def test_what_two_servos_with_one_id_say_is_no_value() -> None:
    with bench(ids=(1, 9), duplicate="9", duplicate_delay=0.0002) as there:
        there.simulator.servos[2].raw_position = 100
        assert there.run(broadcast_read("present_position")) == {1: 0.0}
        assert there.run(broadcast_read("node_id")) == {1: 1, 9: 9}


def test_an_answer_of_another_size_is_no_value() -> None:
    script = ("600#4002600000000000", ["1:4f02600084030000", "9:4302600000100100", "7:4302600084030000"])
    assert play(broadcast_read("present_position"), script) == {7: pytest.approx(math.pi / 2)}


def test_everyone_is_addressed_with_the_bus_alone_for_answers_do_not_tell_who_was_asked() -> None:
    for operation in (
        broadcast_read("node_id"),
        broadcast_position(0.0, (1,)),
        broadcast_bit_rate(250_000),
        broadcast_node_id(9, force=True),
        broadcast_save(),
    ):
        assert isinstance(next(operation), Alone)


def test_who_obeyed_an_order_to_everyone_is_stopped_although_nobody_named_it() -> None:
    with bench(ids=(1, 9)) as there:
        assert there.run(broadcast_position(1.2, (1,))) == (1, 9)
        outcome = there.estop()
        assert (sorted(outcome.acknowledged), outcome.silent) == ([1, 9], ())
        there.link.advance(1.0)
        assert there.sim(9).raw_position < 687, "1.2 rad was never reached"
