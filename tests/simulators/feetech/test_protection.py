"""Loads, obstacles and overload: when a servo trips, and what is left of its torque."""

from __future__ import annotations

from math import inf

import pytest

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


@pytest.mark.parametrize(
    ("model", "share", "settings"),
    [
        ("sts", 0.9, (35, 0)),
        ("sts", 0.9, (36, 0)),
        ("sts", 0.9, (LIMIT, *word(800))),
        ("sts", -0.8, ()),  # 80 % are not more than 80
        ("hls", 0.9, ()),  # it has no such registers
    ],
)
def test_what_never_trips(model: str, share: float, settings: tuple[int, ...]) -> None:
    host, servo = holding(share, model)
    if settings:
        host.write(1, *settings)
    assert (tripped(host.wait(3600.0)), servo.trips_at) == (False, inf)


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
    host.wait(1.0).write(1, POSITION, *word(3048))
    assert host.wait(0.2).read(1, 58) == (680 if left else 3400)  # 20 % of 3400
    assert host.read(1, ALARM, 1) == left
    servo.power_cycle()
    assert host.read(1, ALARM, 1) == 0


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
