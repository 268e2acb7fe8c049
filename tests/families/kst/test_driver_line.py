"""What the bus is told of these servos: times, probes, and the emergency stop."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.can_bits import bits, least, most
from motorbus.core.operation import (
    ANY,
    EVERY_LANE,
    Answer,
    CanFrame,
    Effect,
    Exchange,
    Rank,
    Reply,
    Timeout,
)
from motorbus.errors import DeviceError
from motorbus.families.kst import FAMILY, broadcast_position, dialect_of, wire
from motorbus.families.kst.driver import PLAIN, Dialect, Promise, line
from motorbus.families.kst.simulator import Servo
from tests.families.kst.bench import abort, bench, node


def test_air_time_is_about_what_the_bits_are() -> None:
    exchange = FAMILY.probe(5, 0)
    assert isinstance(exchange.request, CanFrame)
    estimate = FAMILY.air_time(exchange, 500_000) * 500_000
    assert 2 * least(8) < estimate < 2 * most(8)
    assert estimate == pytest.approx(2 * bits(exchange.request), rel=0.03)
    wide: Exchange[Any] = Exchange(exchange.request._replace(extended=True), exchange.replies)
    assert FAMILY.air_time(wide, 500_000) > FAMILY.air_time(exchange, 500_000) * 1.15


def test_a_broadcast_has_many_replies_and_a_save_at_most_one() -> None:
    frame = wire.encode_upload(0, 0x3000)
    everyone = FAMILY.air_time(Exchange(frame, ANY, lane=EVERY_LANE), 500_000)
    one = FAMILY.air_time(Exchange(frame, ANY, lane=5), 500_000)
    assert everyone / one == pytest.approx(64)


def test_times_to_think() -> None:
    def thinks(timeout: Timeout, lane: int = 5, flash_wait: float = 0.15) -> float:
        return line.turnaround(Exchange(CanFrame(1, b""), ANY, lane=lane, timeout=timeout), flash_wait)

    assert (thinks(Timeout.REPLY), thinks(Timeout.SCAN)) == (0.030, 0.005)
    assert thinks(Timeout.STORE) == pytest.approx(0.170)
    assert thinks(Timeout.STORE, EVERY_LANE, 0.5) == pytest.approx(0.52)
    assert thinks(Timeout.REPLY, EVERY_LANE) == 0.1
    assert line.quiet_time(1_000_000) == pytest.approx(0.0207, abs=0.0001)
    assert line.quiet_time(20_000) > 0.05


def answer(data: str) -> Answer:
    (reply,) = wire.FrameReceiver().feed(CanFrame(0x585, bytes.fromhex(data)))
    assert isinstance(reply, Reply)
    return Answer((reply,), (), 1.0)


@pytest.mark.parametrize(
    ("attempt", "data", "right"),
    [
        (0, "4f00300005000000", True),
        (0, "4f00300009000000", True),  # written, and not in force yet
        (0, "4f00300000000000", False),
        (0, "4f00300080000000", False),
        (0, abort(0x3000, 0x0602_0000), True),
        (0, abort(0, 0x0602_0000), False),
        (0, "4f00300105000000", False),
        (1, "430a1000312e3030", True),
        (1, "410a100010000000", True),
        (2, abort(0x3000, 0x0609_0011, 1), True),
        (2, abort(0x3000, 0x0609_0011), False),
        (2, "e000300000000000", False),
    ],
)
def test_a_probe_is_right_when_it_names_what_was_asked(attempt: int, data: str, right: bool) -> None:
    probe = line.probe(node(), attempt)
    assert probe.read is not None
    reply = Reply(5, wire.upload_due(5, 0x3000).key, bytes.fromhex(data))
    assert probe.read(Answer((reply,), (), 1.0)) is right


def test_of_three_probes_in_a_row_two_are_answered_by_data_whatever_refusals_repeat() -> None:
    for mux in ("echo", "index-only", "zero"):
        with bench(abort_mux=mux) as there:
            right = [there.run(there.family.probe(5, attempt)) for attempt in range(6)]
            assert right.count(True) >= 4
            assert right[0] is right[1] is True


def test_stop_holds_where_the_position_is_known_and_asks_where_it_is_not() -> None:
    stop = line.stop({7: None, 5: answer("4b02600084030000"), 6: answer(abort(0x6002, 0x0800_0000))}, PLAIN)
    assert [str(one.request) for one in stop.exchanges] == [
        "605#2203600084030000",
        "606#4002600000000000",
        "607#4002600000000000",
    ]
    assert [one.effect for one in stop.exchanges] == [Effect.MOTION, Effect.NONE, Effect.NONE]
    assert [one.tells_position for one in stop.exchanges] == [False, True, True]
    assert {one.rank for one in stop.exchanges} == {Rank.STOP}
    assert stop.promise == Promise.HOLD_REQUESTED.value


def test_a_refused_stop_is_no_acknowledgement() -> None:
    hold = line.stop({5: answer("4b02600084030000")}, PLAIN).exchanges[0]
    assert hold.read is not None
    acknowledged = answer("6003600000000000")
    assert hold.read(acknowledged) is acknowledged
    with pytest.raises(DeviceError):
        hold.read(answer(abort(0x6003, 0x0609_0031)))


def test_a_servo_that_refuses_to_be_held_is_not_said_to_have_acknowledged() -> None:
    with bench(ids=(5, 6)) as there:
        for node_ in (5, 6):
            there.servo(node_).ping()
        refuse_holds(there.sim(6))
        outcome = there.estop()
        assert (outcome.acknowledged, outcome.silent) == ((5,), (6,))


def refuse_holds(servo: Servo) -> None:
    """Travel limits of a servo whose host does not know that it has any."""
    object.__setattr__(servo.switches, "beyond_limits", "abort")
    servo.values["negative_limit"], servo.values["positive_limit"] = 100, 200


def test_beyond_the_range_the_end_of_the_range_is_held_before_this_place() -> None:
    stop = line.stop({5: answer("4b026000b6030000")}, PLAIN)
    assert [str(one.request) for one in stop.exchanges] == ["605#2203600084030000", "605#22036000B6030000"]
    with bench() as there:
        there.sim().raw_position = -950
        there.servo().move(1.0, wait=False)
        assert there.estop().acknowledged == (5,)
        there.link.advance(3.0)
        assert there.sim().raw_position == -900, "the nearest place at which it lets itself be held"


def test_who_takes_only_writes_with_a_length_is_stopped_in_the_second_round() -> None:
    with bench(accept_unsized=False) as there:
        there.servo().ping()
        there.sim().raw_position = 450
        outcome = there.estop()
        assert (outcome.acknowledged, outcome.rounds) == ((5,), 2)
        assert there.sent()[-1] == "605#2B036000C2010000"
    with bench(accept_unsized=False, settings={"sized": "no"}) as there:
        there.servo().ping()
        assert there.estop().silent == (5,)


def test_who_speaks_in_a_form_that_nobody_knows_is_stopped_in_both() -> None:
    with bench(settings={"id_format": "auto"}, id_format="ext", broadcast_ack=False) as there:
        assert there.run(broadcast_position(1.2, (5,), dialect_of(there.family))) == ()
        there.sent()
        outcome = there.estop()
        assert (outcome.acknowledged, outcome.silent) == ((5,), ())
        assert {frame.partition("#")[0] for frame in there.sent()} == {"605", "00000605"}
        assert there.sim().status()["moving"] is True  # it goes back to where it was asked
        there.link.advance(1.0)
        assert there.sim().status()["moving"] is False


def test_stop_speaks_as_the_bus_does() -> None:
    stop = line.stop({5: answer("4b02600084030000")}, Dialect(id_format="ext", sized="yes"))
    assert str(stop.exchanges[0].request) == "00000605#2B03600084030000"
