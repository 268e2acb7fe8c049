"""Servos that are led: what is asked beforehand, what goals are as frames, and how each is made ready."""

from __future__ import annotations

from math import inf, nan, pi, radians
from typing import Any

import pytest

from motorbus.core.operation import Effect, Exchange, Rank
from motorbus.errors import DeviceError, LimitExceeded, NoReply, RequestError
from motorbus.families.kst.driver import Node, Started, Train, limits, train
from tests.families.kst.bench import Bench, bench, node, play, watch

HERE = ("605#4002600000000000", "4b02600084030000")  # 900, a quarter turn
BEYOND = 4.0
SPEEDS: Any = [0, -1.0, nan, inf, True, "1"]


def coupled(there: Bench, *ids: int) -> Train:
    return there.run(train([there.servo(id) for id in ids], rate=500_000))


def heard(one: Node, at: float = 1.0) -> Node:
    one.at = at
    return one


# --- before -------------------------------------------------------------------------------------------------


def test_a_servo_that_was_never_heard_is_asked_whether_it_is_there() -> None:
    play(train([node()], rate=500_000), ("605#4000300000000000", "4f00300005000000"))
    play(train([heard(node())], rate=500_000))


def test_a_servo_with_travel_limits_is_asked_for_them_once() -> None:
    with bench((1, 2), profile="kst-ext") as there:
        servo = there.servo(1)
        servo.set_travel_limits(radians(-30), radians(40))
        there.sent()
        assert there.run(limits(servo)) == pytest.approx((radians(-30), radians(40)), abs=0.01)
        assert len(there.sent()) == 2
        assert there.run(train([servo], rate=500_000)).nodes == (1,)
        assert there.sent() == []


def test_which_id_format_it_answers_is_found_out_before() -> None:
    with bench((1, 2), settings={"id_format": "auto"}, id_format="ext") as there:
        led = coupled(there, 1, 2)
        there.sent()
        assert [there.run(one).values for one in led.positions] == [{1: 0.0}, {2: 0.0}]
        assert all(frame.startswith("0000060") for frame in there.sent())


def test_all_who_are_silent_are_told() -> None:
    with bench((1, 2, 3)) as there:
        there.sim(1).unplug()
        there.sim(3).unplug()
        with pytest.raises(NoReply) as caught:
            coupled(there, 1, 2, 3)
        assert caught.value.node == 1
        assert any("node 3" in note for note in caught.value.__notes__)


def test_nobody_and_somebody_twice_is_refused() -> None:
    for nodes in ([], [node(), node()]):
        with pytest.raises(RequestError, match="named"):
            play(train(nodes, rate=500_000))


def test_a_position_is_told_as_those_of_several_and_each_has_its_lane() -> None:
    led = play(train([heard(node()), heard(node(number=7))], rate=500_000))
    assert [one.lane for one in led.positions] == [5, 7]
    found = play(led.positions[0], HERE)
    assert found.values == {5: pytest.approx(pi / 2)}
    assert found.missing == ()
    with pytest.raises(NoReply):
        play(led.positions[0], (HERE[0], None))


# --- goals --------------------------------------------------------------------------------------------------


def test_goals_are_a_frame_for_each_with_the_limits_for_the_gate() -> None:
    led = play(train([heard(node()), heard(node(number=7))], rate=500_000))
    one, other = led.goals({7: 0.0, 5: radians(10.85)})
    assert [one.lane, other.lane] == [7, 5]
    watch(one, ("607#2203600000000000", "6003600000000000"))
    watch(other, ("605#220360006D000000", "6003600000000000"))
    (goal,) = other.goals
    assert goal.node == 5
    assert goal.value == pytest.approx(radians(10.9))
    assert (goal.low, goal.high) == play(limits(heard(node())))
    assert (other.effect, other.rank, other.repeatable) == (Effect.MOTION, Rank.CONTROL, True)


@pytest.mark.parametrize("goal", [nan, inf, -inf, BEYOND, -BEYOND])
def test_goals_that_no_servo_of_this_make_could_be_told_are_refused(goal: float) -> None:
    with pytest.raises(LimitExceeded) as caught:
        play(train([heard(node())], rate=500_000)).goals({5: goal})
    assert caught.value.node == 5


def test_goals_for_a_servo_that_is_not_led_are_refused() -> None:
    with pytest.raises(RequestError, match="node 6 is none of those"):
        play(train([heard(node())], rate=500_000)).goals({6: 0.0})


def test_goals_made_before_the_limits_were_written_do_not_leave_and_no_later_ones_are_made() -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        led = there.run(train([servo], rate=500_000))
        there.run(led.begin({}))
        (goal,) = led.goals({5: 0.1})
        servo.set_travel_limits(radians(-30), radians(40))
        there.sent()
        with pytest.raises(RequestError, match="goals may mean something else"):
            there.run(goal)
        with pytest.raises(RequestError, match="begin another"):
            led.goals({5: 0.1})
        assert there.sent() == []


# --- begin --------------------------------------------------------------------------------------------------


def test_a_make_with_a_start_rule_is_started_and_then_told_to_stay() -> None:
    with bench((1, 2), profile="xqpower") as there:
        led = coupled(there, 1, 2)
        there.run(led.begin({1: 1.0}))
        assert sorted(started.node for started in there.of(Started)) == [1, 2]
        for exchange in led.goals({1: 0.3, 2: 0.2}):
            there.run(exchange)
        there.link.advance(2.0)
        found = [there.run(one).values for one in led.positions]
        assert found == [{1: pytest.approx(0.3, abs=0.01)}, {2: pytest.approx(0.2, abs=0.01)}]


def test_a_servo_that_wants_the_length_stated_is_found_out_before_the_first_goal() -> None:
    with bench(accept_unsized=False) as there:
        led = coupled(there, 5)
        there.run(led.begin({}))
        there.sent()
        (goal,) = led.goals({5: 0.1})
        there.run(goal)
        assert there.sent() == ["605#2B03600039000000"]


def test_everyone_is_visited_and_the_first_error_is_raised() -> None:
    with bench((1, 2, 3)) as there:
        led = coupled(there, 1, 2, 3)
        there.sim(2).unplug()
        there.sent()
        with pytest.raises(NoReply) as caught:
            there.run(led.begin({}))
        assert caught.value.node == 2
        assert {frame[:4] for frame in there.sent() if "#2203" in frame} == {"601#", "603#"}


@pytest.mark.parametrize("speed", SPEEDS)
def test_what_is_no_speed_is_refused_before_anything_is_sent(speed: Any) -> None:
    with pytest.raises(RequestError, match="is no speed"):
        play(play(train([heard(node())], rate=500_000)).begin({5: speed}))


def test_a_refusal_of_a_goal_is_the_servo_s_own() -> None:
    led = play(train([heard(node())], rate=500_000))
    (goal,) = led.goals({5: 0.1})
    assert isinstance(goal, Exchange)
    with pytest.raises(DeviceError):
        play(goal, (str(goal.request), "8003600030000906"))
