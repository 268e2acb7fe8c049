"""Servos that are led: what a train asks beforehand, what its goals are in bytes, and how each is made ready."""

from __future__ import annotations

from math import inf, nan, tau
from random import Random
from typing import Any

import pytest

import motorbus
from motorbus.core.operation import Effect, Exchange, Pause, Rank
from motorbus.errors import DeviceError, LimitExceeded, NoReply, RequestError
from motorbus.families import feetech
from motorbus.families.feetech.driver import Node, Train, limits, sync_write_positions, train
from motorbus.families.feetech.driver.identity import learn
from motorbus.families.feetech.driver.orders import NO_LOAD
from tests.families.feetech.driver_script import (
    ALL,
    SYNC_WRITE,
    Line,
    image,
    packet,
    play,
    prepared,
    prepares,
    reads,
    sync_reads,
    watch,
)
from tests.families.feetech.maps import MODELS, met, simulated

RATE = 1_000_000
COUNT = tau / 4096
SIX = tuple(range(1, 7))


def coupled(*nodes: Node) -> Train:
    """Servos that are known need no exchange to be led."""
    return play(train(nodes, rate=RATE))


def only(exchanges: Any) -> Exchange[None]:
    (one,) = exchanges
    return one  # type: ignore[no-any-return]


# --- before -------------------------------------------------------------------------------------------------


def test_who_is_not_known_is_asked_in_one_packet_and_who_is_costs_nothing() -> None:
    nodes = [Node(1), prepared(2), Node(4)]
    asked = sync_reads(0, {1: tuple(image(1)), 4: tuple(image(4))}, 40)
    assert play(train(nodes, rate=RATE), asked).nodes == (1, 2, 4)
    assert coupled(*nodes).nodes == (1, 2, 4)


def test_positions_of_all_maps_come_in_as_few_exchanges_as_their_maps_allow() -> None:
    nodes = [met("sts", 1), met("scs", 2), met("hls", 3), met("scs2", 4)]
    one, other, last = coupled(*nodes).positions
    together = sync_reads(56, {1: (0, 8), 3: (0, 4)}, 2)
    assert play(one, together).values == {1: pytest.approx(2048 * COUNT), 3: pytest.approx(1024 * COUNT)}
    assert [len(alone.replies) for alone in (other, last)] == [1, 1]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("models", "reads"),
    [("sts3215", (8 + 3) + 3 * 8), ("sts3215+scs0009+hls3925", (8 + 2) + 2 * 8 + (8 + 8))],
)
def test_a_cycle_takes_no_more_of_the_wire_than_its_bytes(models: str, reads: int) -> None:
    with (
        motorbus.simulate("feetech", ids="1-3", model=models) as simulation,
        motorbus.open(simulation.url) as bus,
    ):
        led = bus.run(train([feetech.Servo(bus, id) for id in (1, 2, 3)], rate=RATE))
        cycle = [*led.goals(dict.fromkeys(led.nodes, 1.0)), *led.positions]
        assert sum(bus.family.air_time(one, RATE) for one in cycle) == pytest.approx(
            (8 + 3 * 3 + reads) * 10e-6
        )


def test_replies_of_one_exchange_stay_short_at_a_slow_rate() -> None:
    nodes = [prepared(id) for id in range(1, 13)]
    assert len(play(train(nodes, rate=RATE)).positions) == 1
    assert len(play(train(nodes, rate=115_200)).positions) > 2


@pytest.mark.parametrize(
    ("node", "error", "says"),
    [
        (prepared(1, at_33=1), RequestError, "operating mode velocity"),
        (met("smcl", 1, at_9=0, at_10=0, at_11=0, at_12=0), RequestError, "both position limits"),
        (met("sts", 1, at_0=20), DeviceError, "register map is not"),
    ],
)
def test_who_heeds_no_goal_position_is_not_led(node: Node, error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        play(train([node, prepared(2)], rate=RATE))


def test_nobody_and_somebody_twice_is_refused() -> None:
    for nodes in ([], [prepared(1), prepared(1)]):
        with pytest.raises(RequestError, match="named"):
            play(train(nodes, rate=RATE))


def test_all_who_are_silent_are_told() -> None:
    with simulated("sts") as (_, servo), pytest.raises(NoReply) as caught:
        servo.bus.run(train([servo, feetech.Servo(servo.bus, 7), feetech.Servo(servo.bus, 8)], rate=RATE))
    assert caught.value.node == 7
    assert any("node 8" in note for note in caught.value.__notes__)


@pytest.mark.parametrize("name", MODELS)
def test_limits_are_asked_once_and_then_known(name: str) -> None:
    with simulated(name) as (_, servo):
        low, high = servo.bus.run(limits(servo))
        assert (low, high) == servo.limits
    assert play(limits(servo)) == (low, high)


def test_limits_that_nobody_knows_are_not_told() -> None:
    with pytest.raises(RequestError, match="both position limits"):
        play(limits(met("smcl", 1, at_9=0, at_10=0, at_11=0, at_12=0)))
    with pytest.raises(DeviceError, match="register map"):
        play(limits(met("sts", 1, at_0=20)))


# --- goals --------------------------------------------------------------------------------------------------


def test_goals_of_servos_of_several_maps_leave_in_one_packet() -> None:
    led = coupled(met("sts", 1), met("scs", 2), met("hls", 3))
    exchange = only(led.goals({1: 1304 * COUNT, 2: 0x123 * tau * 5 / 6 / 1024, 3: 2048 * COUNT}))
    watch(exchange, Line(packet(ALL, SYNC_WRITE, 42, 2, 1, 0x18, 5, 2, 1, 0x23, 3, 0, 8), None))
    assert (exchange.effect, exchange.rank, exchange.replies) == (Effect.MOTION, Rank.CONTROL, ())
    assert [goal.node for goal in exchange.goals] == [1, 2, 3]
    assert all(goal.low is not None and goal.high is not None for goal in exchange.goals)


def test_goals_are_those_that_sync_write_positions_makes_of_whatever_number() -> None:
    chance = Random(7)
    nodes = [met("sts", 1), met("smbl", 2, at_30=3), met("scs", 3), met("hls", 4)]
    led = coupled(*nodes)
    for _ in range(500):
        ways = [chance.choice([chance.uniform(0, 5), chance.randrange(5), 2.5]) for _ in nodes]
        mine = only(led.goals(dict(zip(led.nodes, ways, strict=True))))
        plain = sync_write_positions(nodes, ways)
        assert (mine.request, mine.goals) == (plain.request, plain.goals)


def test_goals_for_some_leave_the_others_alone() -> None:
    led = coupled(*(prepared(id) for id in SIX))
    for some in ((2,), (6, 1), SIX, (2,)):
        assert [goal.node for goal in only(led.goals(dict.fromkeys(some, 1.0))).goals] == list(some)
    assert led.goals({}) == []


def test_more_than_a_packet_carries_take_another() -> None:
    led = coupled(*(prepared(id) for id in range(90)))
    assert [len(one.goals) for one in led.goals(dict.fromkeys(led.nodes, 1.0))] == [83, 7]


@pytest.mark.parametrize("goal", [nan, inf, -inf, 400.0, -400.0, True, "1"])
def test_goals_that_are_no_position_of_any_servo_are_refused(goal: Any) -> None:
    with pytest.raises(LimitExceeded, match="is no position") as caught:
        coupled(prepared(1), prepared(2)).goals({1: 1.0, 2: goal})
    assert caught.value.node == 2


def test_goals_for_a_servo_that_is_not_led_are_refused() -> None:
    with pytest.raises(RequestError, match="node 3 is none of those") as caught:
        coupled(prepared(1), prepared(2)).goals({1: 1.0, 3: 1.0})
    assert "1, 2" in caught.value.expected


def test_goals_made_before_a_setting_was_changed_do_not_leave_and_later_ones_are_reckoned_anew() -> None:
    one, other = prepared(1), prepared(2)
    led = coupled(one, other)
    before = only(led.goals({1: 1.0, 2: 1.0}))
    assert before.refusal is not None
    assert before.refusal(lambda node: 0) is None
    led.goals({1: 1.0, 2: 1.0})  # by now it has found that nothing has changed
    learn(other, image(2, at_30=2))
    refused = before.refusal(lambda node: 0)
    assert refused is not None
    assert refused.node == 2
    assert [goal.high for goal in only(led.goals({1: 1.0, 2: 1.0})).goals] == [4095 * COUNT, 4095 * 2 * COUNT]


def test_settings_that_were_read_again_and_are_the_same_change_nothing() -> None:
    one = prepared(1)
    led = coupled(one)
    before = only(led.goals({1: 1.0}))
    learn(one, image(1))
    assert before.refusal is not None
    assert before.refusal(lambda node: 0) is None
    assert only(led.goals({1: 1.0})).request == before.request


def test_while_settings_are_unknown_neither_goals_nor_positions_are_made_up() -> None:
    one, other = prepared(1), met("scs", 2)
    led = coupled(one, other)
    led.goals({1: 1.0, 2: 1.0})
    one.forget_settings()
    other.forget_settings()
    with pytest.raises(RequestError, match="not prepared"):
        led.goals({1: 1.0, 2: 1.0})
    together, alone = led.positions
    answers = (sync_reads(56, {1: (0, 4)}, 2), reads(2, 56, 0, 4))
    for reading, answer in zip((together, alone), answers, strict=True):
        with pytest.raises(RequestError, match="in which unit"):
            play(reading, answer)


def test_a_servo_that_was_put_into_another_mode_gets_no_goals() -> None:
    one = prepared(1)
    led = coupled(one)
    led.goals({1: 1.0})
    learn(one, image(1, at_33=1))
    with pytest.raises(RequestError, match="operating mode velocity"):
        led.goals({1: 1.0})


# --- begin --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("speed", [None, 1.0, 1e6])
def test_each_is_told_to_be_as_quick_as_it_may(name: str, speed: float | None) -> None:
    with simulated(name) as (device, servo):
        led = servo.bus.run(train([servo], rate=servo.bus.rate))
        servo.bus.run(led.begin({} if speed is None else {3: speed}))
        velocity = servo.table["goal_velocity"]
        raw = device.memory["goal_velocity"]
        if speed == 1.0:
            assert speed <= servo.value(velocity, raw) < speed + servo.value(velocity, 1)
        else:
            fastest = NO_LOAD * servo.table["goal_position"].scale
            assert raw == 0 if servo.settings.zero_is_maximum else servo.value(velocity, raw) > fastest * 0.9
        for row in filter(None, (servo.control.acceleration, servo.control.time)):
            assert device.memory[row] == 0
        assert device.memory["torque_enable"] == 1
        if servo.control.current:
            assert device.memory["goal_torque"] > 0


def test_servos_of_several_maps_on_one_bus_are_led_together_no_faster_than_they_may_go() -> None:
    models = "sts3215+scs0009+hls3606+scs15-2"
    with (
        motorbus.simulate("feetech", ids="1-4", model=models) as simulation,
        motorbus.open(simulation.url) as bus,
    ):
        led = bus.run(train([feetech.Servo(bus, id) for id in (1, 2, 3, 4)], rate=RATE))
        bus.run(led.begin(dict.fromkeys(led.nodes, 1.0)))
        begun = heard(bus, led)
        bus.run(only(led.goals({id: here + 0.4 for id, here in begun.items()})))
        bus.run(iter(Pause(0.2)))
        assert all(0.1 < here - begun[id] < 0.23 for id, here in heard(bus, led).items())
        bus.run(iter(Pause(1.0)))
        assert heard(bus, led) == pytest.approx({id: here + 0.4 for id, here in begun.items()}, abs=0.01)


def heard(bus: Any, led: Train) -> dict[int, float]:
    return {id: here for one in led.positions for id, here in bus.run(one).values.items()}


def test_what_another_program_left_in_the_registers_holds_nobody_back() -> None:
    with simulated("sts") as (device, servo):
        servo.write(acceleration=1.0, goal_time=700, goal_velocity=0.1)
        led = servo.bus.run(train([servo], rate=RATE))
        servo.bus.run(led.begin({}))
        assert [device.memory[row] for row in ("acceleration", "goal_time", "goal_velocity")] == [0, 0, 0]


def test_a_servo_with_a_bound_of_0_is_not_left_limp() -> None:
    with simulated("hls") as (device, servo):
        servo.bus.run(feetech.driver.cap_current(servo, 0.5))
        bound = device.memory["goal_torque"]
        led = servo.bus.run(train([servo], rate=RATE))
        servo.bus.run(led.begin({3: 2.0}))
        assert device.memory["goal_torque"] == bound > 0


def test_everyone_is_visited_and_the_first_error_is_raised_with_the_others() -> None:
    with motorbus.simulate("feetech", ids="1-6") as simulation, motorbus.open(simulation.url) as bus:
        servos = [feetech.Servo(bus, id) for id in SIX]
        led = bus.run(train(servos, rate=RATE))
        for dead in (1, 3):
            simulation[dead].unplug()
        with pytest.raises(NoReply) as caught:
            bus.run(led.begin({}))
        assert caught.value.node == 1
        assert any("node 3" in note for note in caught.value.__notes__)
        assert [simulation[id].memory["torque_enable"] for id in (2, 4, 5, 6)] == [1, 1, 1, 1]


@pytest.mark.parametrize("speed", [0, -1.0, nan, inf, True, "1"])
def test_what_is_no_speed_is_refused_before_anything_is_sent(speed: Any) -> None:
    with pytest.raises(RequestError, match="is no speed"):
        play(coupled(prepared(1), prepared(2)).begin({2: speed}))


def test_a_speed_for_a_servo_that_is_not_led_is_refused_before_anything_is_sent() -> None:
    with pytest.raises(RequestError, match="node 9"):
        play(coupled(prepared(1)).begin({9: 1.0}))


def test_a_servo_beyond_its_limits_is_not_made_to_jump_to_them() -> None:
    with simulated("sts", position="2500") as (device, servo):
        servo.write(min_position_limit=1000 * COUNT, max_position_limit=2000 * COUNT)
        led = servo.bus.run(train([servo], rate=RATE))
        with pytest.raises(LimitExceeded, match="outside its limits"):
            servo.bus.run(led.begin({}))
        assert device.memory["torque_enable"] == 0


def test_a_servo_that_another_program_has_put_into_velocity_mode_does_not_begin_to_turn() -> None:
    one = prepared(1)
    with pytest.raises(RequestError, match="operating mode velocity"):
        play(coupled(one).begin({}), prepares(1, at_33=1))
    with simulated("sts") as (device, servo):
        led = servo.bus.run(train([servo], rate=RATE))
        feetech.Servo(servo.bus, 3).set_mode("velocity")
        with pytest.raises(RequestError, match="operating mode velocity"):
            servo.bus.run(led.begin({}))
        assert (device.memory["torque_enable"], device.memory["goal_velocity"]) == (0, 0)
