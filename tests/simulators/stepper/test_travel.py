"""A home switch that the load closes: homing ends by itself, wherever it begins, and a jog away opens it."""

from __future__ import annotations

import pytest

from tests.simulators.stepper.host import (
    FORWARD,
    HOME,
    REVERSE,
    SAVE,
    STOP,
    Host,
    frame,
    step,
    written,
)

READ_5 = frame(0, 0x0B, 5)


def wired(**options: object) -> Host:
    host = Host(home_switch="wired", **options)
    host.write([*written(1, step(1)), frame(SAVE, 1)])
    return host


def level(host: Host) -> int:
    return int(host.say(READ_5, 0.01).split()[-1])


def load(host: Host) -> int:
    return host.device.travel.position(host.device.state, host.now)


def test_homing_ends_at_the_switch() -> None:
    host = wired(home_at=-4000)
    began = host.now
    host.say(HOME, 10.0)
    assert (host.device.position, load(host)) == (0, -4000)
    assert host.device.state.homed
    (homed,) = [one.at for one in host.device.told if one.kind == "homed"]
    assert homed - began == pytest.approx(4000 / 1600, abs=1 / 1600)
    assert level(host) == 1


def test_homing_twice_meets_the_same_place() -> None:
    host = wired(home_at=-4000)
    host.say(HOME, 10.0)
    host.say(FORWARD, 3.0)
    host.say(STOP, 0.1)
    away = load(host)
    assert away == pytest.approx(-4000 + 4800, abs=4)
    assert level(host) == 0
    host.say(HOME, 10.0)
    assert (host.device.position, load(host)) == (0, -4000)


def test_a_jog_opens_and_closes_it_at_its_place() -> None:
    host = wired(home_at=-1600)
    levels = []
    for order, seconds in (
        (REVERSE, 0.9),
        (STOP, 0.05),
        (REVERSE, 0.5),
        (STOP, 0.05),
        (FORWARD, 1.0),
        (STOP, 0.05),
    ):
        host.say(order, seconds)
        if order == STOP:
            levels.append(level(host))
    assert levels == [0, 1, 0]


def test_a_motor_that_stands_on_it_does_not_home_and_knows_it_at_power_on() -> None:
    host = wired(home_at=0)
    assert level(host) == 1
    host.say(HOME, 1.0)
    assert load(host) == 0
    host.say(FORWARD, 1.0)
    host.say(STOP, 0.05)
    host.device.power_cycle()
    assert level(host) == 0
    host.say(HOME, 5.0)
    host.device.power_cycle()
    assert level(host) == 1


def test_homing_at_power_on_ends_by_itself() -> None:
    host = wired(home_at=-800)
    host.write([frame(0xAE, 1), frame(SAVE, 1)])
    host.device.power_cycle()
    assert host.device.status()["phase"] == "homing"
    host.wait(2.0)
    status = host.device.status()
    assert (status["phase"], status["homed"], status["load"]) == ("idle", True, -800)


def test_a_slow_stop_goes_beyond_it_and_counts_from_there() -> None:
    host = wired(home_at=-3000, home_stop="mode")
    host.write(written(1, step(1, rpm=120, start=100, acceleration=10), stop=0))
    host.say(HOME, 10.0)
    assert host.device.position == 0
    assert load(host) < -3000


def test_a_hand_does_not_move_a_switch_that_the_load_closes() -> None:
    host = wired()
    host.device.set_input(5, True)
    assert level(host) == 0


def test_it_can_end_a_step() -> None:
    host = wired(home_at=-400)
    host.write(written(1, step(1, direction=1, stop=5)))
    host.say(frame(0x4E, 1), 5.0)
    assert load(host) == -400
