"""Moving: the manual's frames, the gate, the start rule, and what standing still means."""

from __future__ import annotations

import math
from typing import Any

import pytest

from motorbus.core import units
from motorbus.core.operation import Effect, Rank
from motorbus.errors import DeviceError, LimitExceeded, RequestError
from motorbus.families.kst import driver
from motorbus.families.kst.driver import Promise, Started
from tests.families.kst.bench import abort, bench, node, play, watch

COLUMNS = {-90: "7CFC", -10.9: "93FF", -0.8: "F8FF", 0: "0000", 0.8: "0800", 10.9: "6D00", 90: "8403"}
"""The position table of the manual's command 5."""
ACK = "6003600000000000"


@pytest.mark.parametrize("degrees", COLUMNS)
def test_the_position_table_of_the_manual(degrees: float) -> None:
    to = units.parse(f"{degrees}deg", "position")
    played = watch(driver.move(node(), to, wait=False), (f"605#22036000{COLUMNS[degrees]}0000", ACK))
    (exchange,) = played.exchanges
    assert (exchange.effect, exchange.rank, exchange.repeatable) == (Effect.MOTION, Rank.CONTROL, True)
    (goal,) = exchange.goals
    assert (goal.node, goal.quantity) == (5, "position")
    assert goal.value == pytest.approx(math.radians(degrees))
    assert goal.low == pytest.approx(-math.pi / 2)
    assert goal.high == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("profile", "degrees"), [("kst", 90.1), ("kst-ext", 100.1), ("kingmax", -100.1), ("xqpower", 44.5)]
)
def test_beyond_the_range_of_the_profile_nothing_is_sent(profile: str, degrees: float) -> None:
    with pytest.raises(LimitExceeded, match="out of range"):
        play(driver.move(node(profile), math.radians(degrees)))


def test_travel_limits_are_read_once_and_bound_the_goal() -> None:
    one = node("kst-ext")
    limits = [("605#400A300000000000", "4b0a30009cff0000"), ("605#400B300000000000", "4b0b300064000000")]
    write = ("605#2203600032000000", ACK)
    played = watch(driver.move(one, math.radians(5), wait=False), *limits, write)
    assert played.exchanges[-1].goals[0].low == pytest.approx(math.radians(-10))
    play(driver.move(one, math.radians(5), wait=False), write)


def test_a_servo_without_travel_limits_has_those_of_its_profile() -> None:
    one = node("kst-ext")
    absent = 0x0602_0000
    played = watch(
        driver.move(one, 0.0, wait=False),
        ("605#400A300000000000", abort(0x300A, absent)),
        ("605#400B300000000000", abort(0x300B, absent)),
        ("605#2203600000000000", ACK),
    )
    assert played.exchanges[-1].goals[0].high == pytest.approx(math.radians(100))


@pytest.mark.parametrize(
    "how",
    [{"tolerance": 0}, {"tolerance": True}, {"tolerance": "1"}, {"timeout": math.nan}, {"timeout": "5s"}],
)
def test_how_long_to_wait_is_a_number(how: Any) -> None:
    with pytest.raises(RequestError, match="not a finite number above 0"):
        play(driver.move(node(), 0.1, **how))


def test_where_there_is_a_start_rule_the_start_goes_first_and_is_told() -> None:
    one = node("xqpower")
    played = watch(
        driver.move(one, math.radians(10), wait=False), ("000#0105", None), ("605#22036000B4000000", ACK)
    )
    assert [event for event in played.events if isinstance(event, Started)] == [
        Started(5, played.exchanges[0].request)  # type: ignore[arg-type]
    ]
    assert played.exchanges[0].effect is Effect.MOTION
    assert played.exchanges[0].goals == played.exchanges[1].goals
    with bench(profile="xqpower", settings={"nmt": "none"}) as there:
        there.servo().move(0.1, wait=False)
        there.link.advance(1.0)
        assert there.servo().position() == 0.0, "acknowledged, and ignored"
        there.run(driver.move(node("xqpower"), 0.1))
        assert there.servo().position() == pytest.approx(0.1, abs=0.001)


def test_stop_is_the_position_of_this_moment() -> None:
    played = watch(
        driver.stop(node()),
        ("605#4002600000000000", "4b02600039300000"),
        ("605#2203600039300000", ACK),
    )
    assert played.exchanges[0].tells_position
    (goal,) = played.exchanges[1].goals
    assert goal.low == goal.value == goal.high
    assert "standstill was not verified" in Promise.HOLD_REQUESTED.value


def test_a_servo_that_stands_beyond_its_range_is_held_at_the_end_of_it() -> None:
    here = ("605#4002600000000000", "4b026000e8030000")
    refused = ("605#22036000E8030000", abort(0x6003, 0x0609_0031))
    play(driver.stop(node()), here, refused, ("605#2203600084030000", ACK))
    inside = ("605#4002600000000000", "4b02600008000000")
    with pytest.raises(DeviceError):
        play(driver.stop(node()), inside, ("605#2203600008000000", abort(0x6003, 0x0609_0031)))


def test_a_move_in_the_simulator_and_a_stop_on_its_way() -> None:
    with bench() as there:
        servo = there.servo()
        servo.move(1.0)
        assert servo.position() == pytest.approx(1.0, abs=0.02)
        servo.move(-1.0, wait=False)
        there.link.advance(0.05)
        assert servo.stop() is Promise.HOLD_REQUESTED
        there.link.advance(1.0)
        assert -0.9 < servo.position() < 0.95


def test_a_servo_that_refuses_says_so() -> None:
    with bench() as there, pytest.raises(DeviceError, match="too high"):
        there.servo(profile="kst-ext").move(1.7)
    with bench(out_of_range="clamp") as there:
        there.servo(profile="kst-ext").move(1.7, wait=False)
