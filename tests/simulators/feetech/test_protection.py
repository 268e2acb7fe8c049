"""Loads, obstacles and overload: when a servo trips, and what is left of its torque."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.core.plant import move
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.servo import Servo
from tests.simulators.feetech.host import Host, packet, word

POSITION, TORQUE, LIMIT, LOAD, CURRENT, ALARM = 42, 40, 48, 60, 69, 65
COUNT = 6.283185307179586 / 4096


def holding(share: float, model: str = "", **options: object) -> tuple[Host, Servo]:
    """A servo that holds its position from 1 s on against a load."""
    host = Host((1,), model, goal_at_power_up="present", **options)
    host.write(1, TORQUE, 1)
    host.servo.load_shaft(share)
    return host, host.servo


def tripped(host: Host) -> bool:
    return bool(host.servo.error & 0x20)


def test_overload_as_shipped_is_more_than_80_percent_for_2_s() -> None:
    host, _ = holding(0.81)
    host.wait(1.999)
    assert (tripped(host), host.read(1, LOAD), host.read(1, ALARM, 1)) == (False, 810, 0)
    host.wait(0.001)
    assert host.say(packet(1, 1)) == ["FF FF 01 02 20 DC"]
    assert host.read(1, ALARM, 1) == 0x20
    assert (host.read(1, LOAD), host.read(1, CURRENT)) == (200, 100)  # 20 % are left: 0.65 A


@pytest.mark.parametrize("share", [0.8, -0.8, 0.3])
def test_80_percent_are_not_more_than_80(share: float) -> None:
    host, _ = holding(share)
    assert not tripped(host.wait(3600.0))


@pytest.mark.parametrize(
    ("model", "share", "settings", "seconds", "load"),
    [
        ("sts", -0.9, (), 2.0, 200 | 0x400),
        ("sts", 0.3, (34, 10, 50, 25), 0.5, 100),  # 10 % are left; 0.5 s; more than 25 %
        ("scs", 0.9, (), 4.0, 200),  # 100 times 40 ms
        ("sts", 0.9, (19, 44 - 32), 2.0, 900),  # the unload mask does not name it
    ],
)
def test_registers_decide(
    model: str, share: float, settings: tuple[int, ...], seconds: float, load: int
) -> None:
    host, _ = holding(share, model)
    if settings:
        host.write(1, *settings)
    assert not tripped(host.wait(seconds - 0.001))
    assert tripped(host.wait(0.001))
    assert host.read(1, LOAD, order="big" if model == "scs" else "little") == load


@pytest.mark.parametrize("settings", [(35, 0), (36, 0), (LIMIT, *word(800))])
def test_threshold_or_time_of_0_and_a_lower_limit_never_trip(settings: tuple[int, ...]) -> None:
    host, _ = holding(0.9)
    host.write(1, *settings)
    assert not tripped(host.wait(100.0))


def test_hls_has_no_overload_registers() -> None:
    host, servo = holding(0.9, "hls")
    assert (servo.trips_at, tripped(host.wait(100.0))) == (inf, False)


def test_time_starts_again_after_a_relief_and_not_after_a_command() -> None:
    host, servo = holding(0.9)
    host.wait(1.5)
    servo.load_shaft(0.5)
    host.wait(0.001)
    servo.load_shaft(0.9)
    for _ in range(199):
        host.write(1, POSITION, *word(2048))
        host.wait(0.01)
    assert not tripped(host)
    host.write(1, POSITION, *word(2048))
    assert tripped(host.wait(0.0101))


def test_exact_moment_however_late_the_host_asks() -> None:
    # 500 counts at 1000 counts/s and half of the ramp to a stop, then 2 s of pressing
    host = Host(position=1000)
    servo = host.servo
    servo.block_shaft((0.0, 1500 * COUNT))
    host.write(1, POSITION, *word(2000), 0, 0, *word(1000))
    hit = 1.0 + 0.5 + 0.5 * 1000 / 25_400
    assert servo.motion.done_at == pytest.approx(hit)
    assert servo.trips_at == pytest.approx(hit + 2.0)
    host.wait(1000.0)
    assert servo.motion.start == pytest.approx(hit + 2.0)
    assert (tripped(host), servo.raw_position) == (True, 1500)


@pytest.mark.parametrize(("switch", "left"), [("power_cycle", 0x20), ("torque_off", 0)])
def test_what_ends_it(switch: str, left: int) -> None:
    host, servo = holding(0.9, overload_clears=switch)
    host.wait(2.0).write(1, TORQUE, 0)
    assert host.read(1, ALARM, 1) == left
    servo.release_shaft()
    host.wait(1.0).write(1, TORQUE, 1)
    assert host.read(1, ALARM, 1) == left
    servo.power_cycle()
    assert host.read(1, ALARM, 1) == 0


def test_tripped_servo_moves_with_the_torque_that_is_left() -> None:
    host, servo = holding(0.9)
    host.wait(2.0)
    servo.release_shaft()
    host.write(1, POSITION, *word(3048))
    assert host.wait(0.5).read(1, 58) == 680  # 20 % of 3400
    assert host.write(1, TORQUE, 0) == ["FF FF 01 02 20 DC"]
    assert not servo.motion.moving(host.now)


# -- world -----------------------------------------------------------------------------------------


def test_load_takes_its_part_of_the_speed_and_stalls_a_weak_motor() -> None:
    host = Host(position=0)
    host.servo.load_shaft(0.25)
    host.write(1, POSITION, *word(4000))
    assert host.wait(0.5).read(1, 58) == 2550  # 75 % of 3400
    host.write(1, LIMIT, *word(200))
    there = host.servo.raw_position
    assert host.wait(1.0).servo.raw_position == there
    assert host.read(1, LOAD) == 200
    host.servo.release_shaft()
    assert host.wait(0.5).read(1, 58) == 680


@pytest.mark.parametrize(("goal", "stands"), [(3000, 2100), (1000, 1900), (2050, 2050)])
def test_blocked_shaft_stops_at_the_obstacle_and_presses(goal: int, stands: int) -> None:
    host = Host()
    host.servo.block_shaft((1900 * COUNT, 2100 * COUNT))
    host.write(1, POSITION, *word(goal))
    assert host.wait(1.0).servo.raw_position == stands
    assert host.read(1, LOAD) == (0 if stands == goal else 1000 | (0x400 if goal < stands else 0))
    host.servo.release_shaft()
    assert host.wait(2.0).servo.raw_position == goal


def test_overshoot_over_both_bounds_stops_at_the_first() -> None:
    host = Host()
    servo = host.servo
    host.write(1, TORQUE, 1)
    servo.blocked = (2000.0, 2100.0)
    servo.course = servo.course._replace(motion=move(host.now, 2048, 9000, velocity=3400, speed=3400))
    host.write(1, 41, 1, *word(1000), 0, 0, *word(3400))  # it cannot brake within 52 counts
    assert host.wait(1.0).servo.raw_position == 2100


def test_pushed_shaft() -> None:
    host = Host(position=1000).wait(0.0)
    host.servo.push_shaft(100 * COUNT)
    assert host.servo.raw_position == 1000  # limp: it takes its time
    assert (host.wait(0.05).read(1, LOAD), host.read(1, CURRENT)) == (0, 0)
    assert host.read(1, 58) > 0
    assert host.wait(1.0).servo.raw_position == 1100
    host.write(1, POSITION, *word(1100))
    host.servo.push_shaft(-100 * COUNT)
    assert host.servo.raw_position == 1000
    assert host.wait(1.0).servo.raw_position == 1100


def test_impossible_influences() -> None:
    servo = Host().servo
    with pytest.raises(RequestError, match=r"the shaft is at 180.0 deg|3\.14"):
        servo.block_shaft((0.0, 1.0))
    with pytest.raises(RequestError, match="too far"):
        servo.push_shaft(100.0)
    with pytest.raises(RequestError, match="150%"):
        servo.load_shaft(1.5)
