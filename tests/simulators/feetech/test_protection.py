"""Trips at their exact moments, worked out by hand, and what they leave of the torque."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.families.feetech.simulator.effort import Load
from motorbus.families.feetech.simulator.protection import Watch, above
from motorbus.families.feetech.simulator.servo import Servo
from tests.simulators.feetech.host import REG_WRITE, Host, packet, word

POSITION, TORQUE, LIMIT, LOCK = 42, 40, 48, 55

# The clockwork.


def load(begin: float, end: float, duty: float = 0.0, slope: float = 0.0) -> Load:
    return Load(begin, end, duty, slope, 0.0, 0.0)


def duty_above(limit: float, *given: Load) -> list[tuple[float, float]]:
    return list(above(given, lambda one: (one.duty, one.slope), limit))


def test_when_a_ramp_is_above_a_limit() -> None:
    # from -1 to 1 in 10 s: above 0.6 in the first 2 s, downwards, and in the last 2 s
    first, second = duty_above(0.6, load(5.0, 15.0, -1.0, 0.2))
    assert (*first, *second) == pytest.approx((5.0, 7.0, 13.0, 15.0))
    assert duty_above(0.6, load(5.0, 15.0, 0.0, 0.05)) == []
    assert duty_above(0.6, load(0.0, 1.0, 0.6), load(1.0, inf, -0.7)) == [(1.0, inf)]


def test_it_must_last_without_a_break() -> None:
    watch = Watch()
    assert watch.trips([(1.0, 2.0), (2.0, 3.5), (4.0, 5.5)], 0.0, 2.0) == 3.0
    assert watch.trips([(1.0, 2.0), (2.5, 4.0), (4.5, inf)], 0.0, 2.0) == 6.5
    assert watch.trips([(1.0, 2.0)], 0.0, 2.0) == inf
    assert watch.trips([(1.0, 3.0)], 0.0, 2.0) == 3.0


def test_what_was_above_before_counts() -> None:
    watch = Watch()
    watch.pass_to(5.0, [(4.0, inf)], 0.0)
    assert watch.since == 4.0
    assert watch.trips([(5.0, inf)], 5.0, 2.0) == 6.0
    assert watch.trips([(5.1, inf)], 5.0, 2.0) == pytest.approx(7.1)  # it was kept for a moment
    watch.pass_to(5.5, [(5.0, inf)], 5.0)
    assert watch.since == 4.0
    watch.pass_to(7.0, [(5.5, 6.0)], 5.5)
    assert watch.since is None


# A servo.


def holding(torque: float, **options: object) -> tuple[Host, Servo]:
    """An STS3215 that holds its place from 1 s on against an outside torque."""
    host = Host(goal_at_power_up="present", **options)
    host.write(1, TORQUE, 1)
    servo = host.bus.nodes[1]
    servo.torque = torque
    return host, servo


def test_overload_as_shipped_is_more_than_80_percent_for_2_s() -> None:
    host, servo = holding(0.81)
    host.wait(1.999)
    assert (servo.tripped, host.read(1, 60), host.read(1, 65, 1)) == (False, 810, 0)
    host.wait(0.001)
    assert servo.tripped
    assert host.say(packet(1, 1)) == ["FF FF 01 02 20 DC"]
    assert host.read(1, 65, 1) == 0x20
    assert (host.read(1, 60), host.read(1, 69)) == (200, 100)  # 20 % is left: 0.65 A
    assert servo.status()["alarm"] == ["overload"]


@pytest.mark.parametrize("torque", [0.8, -0.8, 0.3])
def test_80_percent_are_not_more_than_80(torque: float) -> None:
    host, servo = holding(torque)
    host.wait(3600.0)
    assert not servo.tripped


def test_the_direction_is_of_no_account() -> None:
    host, servo = holding(-0.9)
    host.wait(2.0)
    assert servo.tripped
    assert host.read(1, 60) == 200 | 0x400


def test_the_registers_decide() -> None:
    host, servo = holding(0.3)
    host.write(1, 34, 10, 50, 25)  # 10 %, 0.5 s, more than 25 %
    host.wait(0.499)
    assert not servo.tripped
    host.wait(0.001)
    assert (servo.tripped, host.read(1, 60)) == (True, 100)


def test_scs_counts_in_40_ms() -> None:
    host = Host((1,), "scs0009", goal_at_power_up="present")
    servo = host.bus.nodes[1]
    host.write(1, TORQUE, 1)
    servo.torque = 0.9
    host.wait(3.999)  # 100 times 40 ms as shipped
    assert not servo.tripped
    host.wait(0.001)
    assert servo.tripped
    assert host.bus.nodes[1].error == 0x20


def test_hls_has_no_such_registers() -> None:
    host = Host((1,), "hls3930", goal_at_power_up="present")
    servo = host.bus.nodes[1]
    host.write(1, TORQUE, 1)
    servo.torque = 0.9
    host.wait(1.9)
    assert not servo.tripped
    host.wait(100.0)
    assert not servo.tripped


def test_a_relief_begins_the_time_anew() -> None:
    host, servo = holding(0.9)
    host.wait(1.5)
    servo.torque = 0.5
    host.wait(0.001)
    servo.torque = 0.9
    host.wait(1.999)
    assert not servo.tripped
    host.wait(0.001)
    assert servo.tripped


def test_commands_meanwhile_do_not_begin_it_anew() -> None:
    host, servo = holding(0.9)
    for _ in range(199):
        host.write(1, POSITION, *word(2048))
        host.wait(0.01)
    assert not servo.tripped
    host.write(1, POSITION, *word(2048))
    host.wait(0.0101)
    assert servo.tripped


def test_the_moment_is_exact_however_late_one_asks() -> None:
    # stopped by a wall after a way of 500 counts at 1000 counts/s: 0.5 s and 1000/25400 s more, then 2 s of pressing
    host = Host(position=1000)
    servo = host.bus.nodes[1]
    servo.blocked = (0.0, 1500.0)
    host.write(1, POSITION, *word(2000), 0, 0, *word(1000))
    hit = 1.0 + 0.5 + 0.5 * 1000 / 25_400
    assert servo.motion.done_at == pytest.approx(hit)
    assert servo.protection.next == pytest.approx(hit + 2.0)
    host.wait(1000.0)
    assert servo.motion.start == pytest.approx(hit + 2.0)  # then it thought again
    assert (servo.tripped, servo.raw_position) == (True, 1500)


def test_a_torque_limit_below_the_threshold_never_trips() -> None:
    host, servo = holding(0.9)
    host.write(1, LIMIT, *word(800))
    host.wait(100.0)
    assert not servo.tripped
    assert host.read(1, 60) == 800


def test_a_mask_without_the_bit_tells_and_does_nothing() -> None:
    host, servo = holding(0.9)
    host.write(1, 19, 44 - 32)
    host.wait(2.0)
    assert (servo.tripped, host.read(1, 65, 1), host.read(1, 60)) == (True, 0x20, 900)


def test_a_threshold_or_a_time_of_0_protects_from_nothing() -> None:
    for register in (35, 36):
        host, servo = holding(0.9)
        host.write(1, register, 0)
        host.wait(100.0)
        assert not servo.tripped


@pytest.mark.parametrize(("switch", "left"), [("power_cycle", 0x20), ("torque_off", 0)])
def test_what_ends_it(switch: str, left: int) -> None:
    host, servo = holding(0.9, overload_clears=switch)
    host.wait(2.0)
    host.write(1, TORQUE, 0)
    assert host.read(1, 65, 1) == left
    servo.torque = 0.0
    host.wait(1.0).write(1, TORQUE, 1)
    assert host.read(1, 65, 1) == left
    servo.power_cycle()
    assert (servo.tripped, host.read(1, 65, 1)) == (False, 0)


def test_a_load_that_was_put_down_and_taken_up_again_has_its_whole_time() -> None:
    host, servo = holding(0.9, overload_clears="torque_off")
    host.wait(1.9)
    host.write(1, TORQUE, 0)
    host.wait(0.01).write(1, TORQUE, 1)
    host.wait(1.99)
    assert not servo.tripped
    host.wait(0.02)
    assert servo.tripped
    host.write(1, TORQUE, 0)
    host.write(1, TORQUE, 1)
    assert not servo.tripped
    host.wait(2.0)
    assert servo.tripped


def test_after_it_a_torque_off_is_obeyed_and_a_goal_with_a_fifth_of_the_speed() -> None:
    host, servo = holding(0.9)
    host.wait(2.0)
    servo.torque = 0.0
    host.write(1, POSITION, *word(3048))
    host.wait(0.5)
    assert host.read(1, 58) == 680  # 20 % of 3400
    assert host.write(1, TORQUE, 0) == ["FF FF 01 02 20 DC"]
    assert not servo.motion.moving(host.now)


def test_over_current_by_hand() -> None:
    # more than 250 units, 1.625 A, for 2 s; 0.6 of 3.25 A are 1.95 A
    host, servo = holding(0.6)
    host.write(1, 28, *word(250))
    host.wait(1.999)
    assert servo.error == 0
    host.wait(0.001)
    assert servo.error == 0x08
    assert (host.read(1, 60), host.read(1, 69), host.read(1, TORQUE, 1)) == (
        0,
        0,
        1,
    )  # the mask lets all of it go
    assert not servo.tripped


def test_over_current_as_shipped_is_more_than_the_stall_current() -> None:
    host, servo = holding(0.75)
    host.wait(100.0)
    assert servo.error == 0


def test_even_the_idle_current_can_be_too_much() -> None:
    host = Host()
    host.write(1, 28, *word(20))  # 0.13 A; it takes 0.15 A to turn
    host.write(1, 33, 1)
    host.write(1, TORQUE, 1)
    host.write(1, 46, *word(500))
    host.wait(2.0)
    assert host.bus.nodes[1].error == 0x08


def test_heat_by_hand() -> None:
    # 0.7 of the stall torque ends at 45 + 63.15 * 0.49 = 75.9435: 70 is reached after 200 ln(30.9435 / 5.9435) s
    host, servo = holding(0.7, ambient=45)
    moment = 329.973
    host.wait(moment - 0.01)
    assert (servo.error, host.read(1, 63, 1), host.read(1, 60)) == (0, 70, 700)
    host.wait(0.02)
    assert (servo.error, host.read(1, 65, 1), host.read(1, 60)) == (0x04, 0x04, 0)
    # it cools from 70 to 65 in 200 ln(25/20) = 44.629 s, and then it holds again
    host.wait(44.61)
    assert servo.error == 0x04
    host.wait(0.04)
    assert (servo.error, host.read(1, 60)) == (0, 700)


def test_a_register_that_is_lowered_makes_it_too_hot() -> None:
    host, servo = holding(0.0)
    servo.temperature = 60.0
    host.write(1, 13, 50)
    assert (servo.error, host.read(1, 60)) == (0x04, 0)
    host.write(1, 13, 70)
    assert servo.error == 0


def test_a_servo_at_rest_is_as_warm_as_its_surroundings() -> None:
    host = Host(ambient=21.5).wait(0.0)
    servo = host.bus.nodes[1]
    assert servo.temperature == 21.5
    servo.temperature = 41.5
    host.wait(200.0)
    assert servo.temperature == pytest.approx(21.5 + 20 / 2.718281828)
    host.wait(1e6)
    assert servo.temperature == pytest.approx(21.5)


def test_nothing_is_expected_of_a_servo_that_nothing_burdens() -> None:
    host = Host()
    servo = host.bus.nodes[1]
    host.write(1, POSITION, *word(3000))
    assert servo.next == inf
    host.say(packet(1, REG_WRITE, 46, 0, 1))
    assert servo.next == inf
