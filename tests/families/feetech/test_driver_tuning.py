"""Torque limit, gains and protection by verbs: the right register of each map, guarded where it is kept for good."""

from __future__ import annotations

import math
from typing import Any

import pytest

from motorbus.core.operation import Effect, Pause
from motorbus.errors import LimitExceeded, RequestError, VerificationFailed
from motorbus.families.feetech.driver import (
    Node,
    gains,
    protection,
    set_gains,
    set_protection,
    set_torque_limit,
    torque_limit,
)
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import looks, play, reads, watch, writes
from tests.families.feetech.maps import met, prepares_as, simulated

IDLE = reads(3, 64, 0)
OFF = writes(3, 40, 0)


def guarded(*lines: Any, lock: int = 55) -> tuple[Any, ...]:
    opened = (*looks(*lines), writes(3, lock, 0), OFF, IDLE)
    return (*opened, *lines, reads(3, lock, 0), writes(3, lock, 1), reads(3, lock, 1))


# -- torque limit --------------------------------------------------------------------------------------------


def test_a_torque_limit_in_ram_acts_at_once() -> None:
    before, after = reads(3, 48, 0xE8, 3), (writes(3, 48, 0xF4, 1), reads(3, 48, 0xF4, 1))
    played = watch(set_torque_limit(met("sts"), 0.5), before, *after)
    assert played.exchanges[1].effect is Effect.TORQUE
    assert play(torque_limit(met("sts")), reads(3, 48, 0xF4, 1)) == 0.5
    told = play(set_torque_limit(met("hls"), 0.5), before, *after)
    assert told == (0.5, ("torque_limit",), False)


def test_with_persistent_it_is_kept_too() -> None:
    told = play(
        set_torque_limit(met("sts"), 1, persistent=True),
        *guarded(writes(3, 16, 0xE8, 3), reads(3, 16, 0xE8, 3)),
        *(writes(3, 48, 0xE8, 3), reads(3, 48, 0xE8, 3)),
    )
    assert told == (1, ("torque_limit", "max_torque"), True)


@pytest.mark.parametrize(("name", "word"), [("scs", (1, 0xF4)), ("scs2", (1, 0xF4)), ("smcl", (0xF4, 1))])
def test_where_48_is_the_lock_it_is_max_torque_and_kept(name: str, word: tuple[int, int]) -> None:
    told = play(
        set_torque_limit(met(name), 0.5), *guarded(writes(3, 16, *word), reads(3, 16, *word), lock=48)
    )
    assert told == (0.5, ("max_torque",), True)
    assert play(torque_limit(met(name)), reads(3, 16, *word)) == 0.5


@pytest.mark.parametrize("limit", [-0.1, 1.1, math.nan, math.inf, True, "half", None])
def test_what_is_no_torque_limit_sends_nothing(limit: Any) -> None:
    with pytest.raises(RequestError, match="no torque limit"):
        play(set_torque_limit(Node(3), limit))


def test_a_limit_that_does_not_hold_is_told() -> None:
    with pytest.raises(VerificationFailed, match="register 48 to 49"):
        play(
            set_torque_limit(met("sts"), 0.5),
            *(reads(3, 48, 0xE8, 3), writes(3, 48, 0xF4, 1), reads(3, 48, 0, 0)),
        )


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_after_a_limit_of_0_it_stays_where_it_hangs(name: str) -> None:
    with simulated(name) as (real, servo):
        servo.enable_torque()
        servo.set_torque_limit(0)
        real.raw_position = real.raw_position - 900
        hangs = real.raw_position
        assert servo.set_torque_limit(1.0).value == 1.0
        servo.bus.run(iter(Pause(2.0)))
        assert abs(real.raw_position - hangs) <= 1
        servo.set_torque_limit(0)
        servo.write(min_position_limit=4.0)
        servo.enable_torque(jump=6.0)
        with pytest.raises(LimitExceeded, match="with its force back it would go for the nearer one"):
            servo.set_torque_limit(0.5)
        assert real.memory["torque_limit"] == 0


@pytest.mark.parametrize(("name", "mode"), [("sts", "velocity"), ("sts", "pwm"), ("hls", "velocity")])
def test_after_a_limit_of_0_it_does_not_run_off(name: str, mode: str) -> None:
    with simulated(name) as (real, servo):
        servo.set_mode(mode)
        servo.enable_torque()
        servo.set_torque_limit(0)
        if mode == "velocity":
            servo.set_velocity(3.0)
        else:
            servo.set_duty(0.5)
        stood = real.motion.position(servo.bus.link.now())
        servo.set_torque_limit(1.0)
        servo.bus.run(iter(Pause(2.0)))
        assert real.motion.position(servo.bus.link.now()) == pytest.approx(stood, abs=1)


@pytest.mark.parametrize("mode", ["position", "step"])
def test_a_limp_servo_is_given_its_limit_and_nothing_else(mode: str) -> None:
    with simulated("sts") as (real, servo):
        servo.set_mode(mode)
        servo.set_torque_limit(0)
        servo.set_torque_limit(0.5)
        assert (real.memory["torque_enable"], real.memory["torque_limit"]) == (0, 500)


def test_in_a_mode_that_nobody_explains_a_limit_of_0_is_not_raised() -> None:
    script = (reads(3, 48, 0, 0), prepares_as("sts", at_33=9), reads(3, 40, 1))
    with pytest.raises(RequestError, match="operating mode 9"):
        play(set_torque_limit(met("sts"), 0.5), *script)


# -- gains ---------------------------------------------------------------------------------------------------


def test_gains_are_read_in_one_go_where_they_adjoin() -> None:
    found = play(
        gains(met("sts")),
        reads(3, 21, 32, 33, 1),
        reads(3, 37, 10, 200, 11),
    )
    assert (found.p, found.i, found.d, found.velocity_p, found.velocity_i) == (32, 1, 33, 10, 11)
    assert found[5:] == (None,) * 5


def test_gains_of_hls_have_a_current_loop_and_live_ones() -> None:
    found = play(
        gains(met("hls")),
        reads(3, 21, 32, 33, 1),
        reads(3, 34, 50, 51, 0, 10, 200, 11),
        reads(3, 50, 20, 22, 21),
    )
    assert (found.current_p, found.current_i) == (50, 51)
    assert (found.live_p, found.live_d, found.live_i) == (20, 22, 21)


def test_gains_are_kept_by_the_guarded_sequence() -> None:
    lines = (writes(3, 21, 16, 20), reads(3, 21, 16, 20))
    play(set_gains(met("sts"), p=16, d=20), *guarded(*lines))


def test_live_gains_are_tried_without_letting_go() -> None:
    played = watch(set_gains(met("hls"), live_p=40), writes(3, 50, 40), reads(3, 50, 40))
    assert played.alone == 0


@pytest.mark.parametrize(
    ("name", "gain", "has"),
    [
        ("sts", "current_p", "p, i, d, velocity_p, velocity_i"),
        ("sts", "live_p", "p, i, d, velocity_p, velocity_i"),
        ("smcl", "velocity_p", "p, i, d"),
        ("scs", "velocity_i", "p, i, d"),
        ("scs2", "i", "p, d"),
    ],
)
def test_a_gain_that_a_map_lacks_names_those_it_has(name: str, gain: str, has: str) -> None:
    with pytest.raises(RequestError, match=f"no register for '{gain}'") as caught:
        play(set_gains(met(name), **{gain: 1}))
    assert caught.value.expected == f"one of {has}"


@pytest.mark.parametrize("value", [255, -1, 1.5, True, "32", math.nan])
def test_a_gain_out_of_range_sends_nothing(value: Any) -> None:
    with pytest.raises(RequestError):
        play(set_gains(met("sts"), p=value))


def test_no_gain_at_all_is_no_order() -> None:
    with pytest.raises(RequestError, match="no gain was named"):
        play(set_gains(Node(3)))


# -- protection ----------------------------------------------------------------------------------------------


def test_protection_is_told_in_units() -> None:
    found = play(
        protection(met("sts")),
        reads(3, 13, *(70, 80, 40, 0xE8, 3, 12, 44, 47, *[0] * 7, 0xF4, 1, 1, 0, 0, 0, 20, 200, 80, 10, 200)),
    )
    assert (found.torque, found.threshold, found.time) == (0.2, 0.8, 2.0)
    assert found.current == pytest.approx(3.25)
    assert found.current_time == 2.0
    assert (found.max_temperature, found.max_voltage, found.min_voltage) == (70, 8, 4)
    assert found.unload == ("temperature", "current", "overload")
    assert found.led == ("voltage", "sensor", "temperature", "current", "overload")


def test_scs_count_their_time_in_40_ms() -> None:
    lines = (writes(3, 37, 30, 50), reads(3, 37, 30, 50))
    play(set_protection(met("scs"), torque=0.3, time=2.0), *guarded(*lines, lock=48))


@pytest.mark.parametrize("part", ["torque", "time", "threshold"])
def test_the_current_loop_of_hls_is_never_written_as_protection(part: str) -> None:
    """34 and 35 are gains of the current loop there, and 36 is nothing."""
    values: dict[str, Any] = {part: 0.2}
    with pytest.raises(RequestError, match=f"no register for '{part}'") as caught:
        play(set_protection(met("hls"), **values))
    assert "current_time" in caught.value.expected


@pytest.mark.parametrize(
    "values",
    [
        {"torque": 1.01},
        {"torque": -0.1},
        {"threshold": 1.5},
        {"time": 2.55},
        {"max_temperature": 101},
        {"current": math.nan},
        {"current": "much"},
        {"unload": ("voltag",)},
        {"unload": 44},
        {},
    ],
)
def test_nonsense_sends_nothing(values: dict[str, Any]) -> None:
    with pytest.raises(RequestError):
        play(set_protection(met("sts"), **values))


def test_masks_are_said_by_the_names_of_alarms() -> None:
    lines = (writes(3, 19, 0x24, 0), reads(3, 19, 0x24, 0))
    play(set_protection(met("sts"), unload=("overload", "temperature"), led=()), *guarded(*lines))
    with pytest.raises(RequestError, match="sensor: no alarm of this servo") as caught:
        play(set_protection(met("scs"), led=("sensor", "overload")))
    assert caught.value.expected == "any of voltage, temperature, overload, or none"


def test_an_alarm_that_is_named_twice_is_one_bit() -> None:
    for names in (("current",), ("current", "current")):
        play(set_protection(met("sts"), unload=names), *guarded(writes(3, 19, 0b1000), reads(3, 19, 0b1000)))


def test_voltages_that_leave_none_between_are_refused() -> None:
    with pytest.raises(RequestError, match="does not exist"):
        play(set_protection(met("sts"), max_voltage=4.0), reads(3, 14, 80, 40))
    lines = (writes(3, 14, 140, 90), reads(3, 14, 140, 90))
    play(
        set_protection(met("sts"), max_voltage=14.0, min_voltage=9.0), reads(3, 14, 80, 40), *guarded(*lines)
    )


# -- on simulated servos of every map ------------------------------------------------------------------------


@pytest.mark.parametrize("name", TABLES)
def test_a_torque_limit_holds_as_long_as_it_says(name: str) -> None:
    with simulated(name) as (real, servo):
        told = servo.set_torque_limit(0.3)
        assert servo.torque_limit() == 0.3
        real.power_cycle()
        assert (servo.torque_limit() == 0.3) == told.kept
        servo.set_torque_limit(0.4, persistent=True)
        real.power_cycle()
        assert servo.torque_limit() == 0.4
        assert real.memory["lock"] == 1


@pytest.mark.parametrize("name", TABLES)
def test_every_gain_that_a_map_has_is_set_and_read(name: str) -> None:
    with simulated(name) as (_, servo):
        has = [gain for gain, value in servo.gains()._asdict().items() if value is not None]
        wanted = {gain: 20 + place for place, gain in enumerate(has)}
        servo.set_gains(**wanted)
        assert {gain: getattr(servo.gains(), gain) for gain in has} == wanted


@pytest.mark.parametrize("name", TABLES)
def test_every_part_of_the_protection_that_a_map_has_is_set_and_kept(name: str) -> None:
    wanted: dict[str, Any] = {
        "torque": 0.3, "threshold": 0.7, "time": 1.2, "current": 1.3, "current_time": 0.8, "max_temperature": 60.0,
        "max_voltage": 9.1, "min_voltage": 4.4, "unload": ("overload",), "led": ("voltage", "overload"),
    }  # fmt: skip
    with simulated(name) as (real, servo):
        had = servo.protection()._asdict()
        has = {part: value for part, value in wanted.items() if had[part] is not None}
        servo.set_protection(**has)
        real.power_cycle()
        found = servo.protection()._asdict()
    assert {part: found[part] for part in has} == {
        part: pytest.approx(value) if isinstance(value, float) else value for part, value in has.items()
    }
    assert all(found[part] is None for part in set(wanted) - set(has))
    assert (had["torque"] is None) == (name == "hls")
