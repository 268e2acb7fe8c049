"""Out of an overload without a jump; where only a power cycle helps, that is said and the servo is limp."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import inf, nan
from typing import Any

import pytest

from motorbus.core.steps import Sleep
from motorbus.errors import DeviceError, MotorbusError, NoReply, RequestError
from motorbus.families.feetech.driver import Recovery, recover_overload
from motorbus.families.feetech.driver.overload import REST, TRIPS
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import Line, Played, play, reads, unheard, writes
from tests.families.feetech.maps import met, prepares_as, simulated

OFF = writes(3, 40, 0, error=32)
ON = (writes(3, 40, 1, 0, 0xD0, 7), reads(3, 40, 1))
BOUNDS = (70, 80, 40)


def feedback(error: int, voltage: int = 74) -> Any:
    return reads(3, 56, *(0xD0, 7, 0, 0, 0, 0, voltage, 30, 0, error, 0, 0, 0, 0, 0), error=error)


def stands() -> tuple[Line, Line]:
    return (reads(3, 40, *[0] * 8), reads(3, 56, 0xD0, 7))


def test_off_a_rest_the_goal_to_where_it_stands_and_on() -> None:
    played = Played(
        [feedback(32), OFF, prepares_as("sts"), *stands(), *ON, feedback(0), feedback(0)],
    )
    begun = played.now
    assert played.run(recover_overload(met("sts"))) == Recovery(("overload",), ())
    assert played.script == []
    assert played.now - begun > REST


def test_without_such_an_alarm_nothing_is_done() -> None:
    assert play(recover_overload(met("sts")), feedback(0), feedback(0)) == Recovery((), ())
    told = play(
        recover_overload(met("sts")), feedback(1, 121), feedback(1, 121), reads(3, 13, *BOUNDS, error=1)
    )
    assert told.tripped == ()
    assert "supply 12.1 V above limit 8.0 V" in told.remaining[0]


@pytest.mark.parametrize("error", [32, 8, 40])
def test_an_alarm_that_stays_is_told_and_it_is_limp(error: int) -> None:
    script = [
        *(feedback(error), OFF, prepares_as("sts"), *stands(), *ON),
        *(feedback(error), OFF),
    ]
    played = Played(script)
    with pytest.raises(DeviceError, match="still set after its torque was off and on") as caught:
        played.run(recover_overload(met("sts")))
    assert played.script == []
    assert "switch its supply off and on" in caught.value.advice


@pytest.mark.parametrize("missing", [prepares_as("sts"), ON[1], feedback(0)])
def test_whatever_goes_wrong_on_the_way_it_is_limp_in_the_end(missing: Line) -> None:
    whole = [feedback(32), OFF, prepares_as("sts"), *stands(), *ON, feedback(0)]
    at = whole.index(missing)
    with pytest.raises(NoReply):
        play(recover_overload(met("sts")), *whole[:at], unheard(missing), OFF)


def test_when_even_letting_go_is_not_acknowledged_that_is_told_with_it() -> None:
    silent = [*[unheard(OFF)] * 3, unheard(reads(3, 40, 0))]
    with pytest.raises(NoReply) as caught:
        play(recover_overload(met("sts")), feedback(32), OFF, unheard(prepares_as("sts")), *silent)
    assert "may still hold" in caught.value.__notes__[0]


@pytest.mark.parametrize("rest", [nan, inf, -1.0, True, "1", None, 1e9])
def test_a_rest_that_is_no_time_costs_no_packet(rest: Any) -> None:
    with pytest.raises(RequestError, match="is no time to rest"):
        play(recover_overload(met("sts"), rest=rest))


def test_both_alarms_that_stay_after_their_cause_are_meant() -> None:
    assert {"overload", "current"} == TRIPS


@contextmanager
def overloaded(name: str, **options: Any) -> Iterator[tuple[Any, Any]]:
    """A simulated servo of this map that has been kept from its goal until its protection tripped."""
    with simulated(name, **options) as (real, servo):
        if name == "hls":  # HLS protect themselves by their current
            servo.write(protection_current=1.0, overcurrent_time=1.0)
        servo.enable_torque()
        stood = real.raw_position
        real.blocked = (stood - 5, stood + 5)
        here = servo.position()
        with pytest.raises(MotorbusError):
            servo.move(here + 0.5, timeout=12.0)
        for _ in range(100):
            if TRIPS.intersection(servo.telemetry().alarm):
                break
            servo.bus.run(pause())
        assert TRIPS.intersection(servo.telemetry().alarm)
        yield real, servo


async def pause() -> None:
    await Sleep(0.1)


@pytest.mark.parametrize("name", TABLES)
def test_a_simulated_servo_that_forgets_with_its_torque_is_recovered(name: str) -> None:
    with overloaded(name, overload_clears="torque_off") as (real, servo):
        before = real.raw_position
        told = servo.recover_overload()
        assert told == Recovery(("current" if name == "hls" else "overload",), ())
        assert servo.telemetry().alarm == ()
        assert real.memory["torque_enable"] == 1
        assert abs(real.raw_position - before) <= 1
        assert servo.recover_overload() == Recovery((), ())


@pytest.mark.parametrize("name", TABLES)
def test_a_simulated_servo_that_forgets_with_its_supply_only_is_told(name: str) -> None:
    with overloaded(name, overload_clears="power_cycle") as (real, servo):
        with pytest.raises(DeviceError, match="still set"):
            servo.recover_overload()
        assert real.memory["torque_enable"] == 0
        real.power_cycle()
        assert servo.recover_overload() == Recovery((), ())
        servo.enable_torque()
        assert servo.blockers() == ()
