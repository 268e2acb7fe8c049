"""Turns are forgotten by 0x0A where a servo obeys it, and whoever does not is told; it is never 0x06."""

from __future__ import annotations

import math

import pytest

from motorbus.core.request import Effect, Priority
from motorbus.errors import DeviceError, RequestError, VerificationFailed
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver import Node, clear_turns, factory_restore
from motorbus.families.feetech.table import CONTROL, TABLES
from tests.families.feetech.driver_script import (
    Line,
    low_high,
    packet,
    play,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import met, prepares_as, simulated

COUNT = math.tau / 4096
OFF = writes(3, 40, 0)
CLEAR = Line(packet(3, 0x0A), packet(3, 0))


def at(position: int) -> Line:
    return reads(3, 56, *low_high(position))


def test_torque_goes_off_first_and_nobody_else_is_on_the_bus() -> None:
    script = (prepares_as("hls"), at(9000), OFF, CLEAR, at(808))
    played = watch(clear_turns(Node(3)), *script)
    assert played.alone == 1
    assert (played.requests[3].effect, played.requests[3].priority) == (
        Effect.PERSISTENT,
        Priority.CONFIGURATION,
    )
    assert play(clear_turns(Node(3)), *script) == pytest.approx(808 * COUNT)


def test_it_is_another_instruction_than_the_factory_restore() -> None:
    assert wire.clear_turns(3) == packet(3, 0x0A)
    assert wire.factory_restore(3) == packet(3, 0x06)
    assert clear_turns.__name__ != factory_restore.__name__


def test_a_silent_model_is_named() -> None:
    with pytest.raises(DeviceError, match=r"STS3215, firmware 3\.10") as caught:
        play(clear_turns(Node(3)), prepares_as("sts"), at(808), OFF, unheard(CLEAR), at(808))
    assert "power cycle" in caught.value.advice
    assert caught.value.code == 0x0A
    with pytest.raises(DeviceError, match="answers, but not to the order"):
        play(clear_turns(Node(3)), prepares_as("sts"), at(9000), OFF, unheard(CLEAR), at(9000))


def test_a_lost_acknowledgement_is_no_failure_where_the_turns_are_gone() -> None:
    script = (prepares_as("hls"), at(-3000), OFF, unheard(CLEAR), at(1096))
    assert play(clear_turns(Node(3)), *script) == pytest.approx(1096 * COUNT)


def test_one_that_acknowledges_and_does_nothing_is_found_out() -> None:
    with pytest.raises(VerificationFailed, match="raw position 9000"):
        play(clear_turns(Node(3)), prepares_as("hls"), at(9000), OFF, CLEAR, at(9000))


def test_a_servo_that_acknowledges_nothing_is_judged_by_its_position() -> None:
    silent = (unheard(OFF), reads(3, 40, 0), unheard(CLEAR))
    level_0 = prepares_as("hls", status_return_level=0)
    assert play(clear_turns(Node(3)), level_0, at(9000), *silent, at(808)) == pytest.approx(808 * COUNT)
    with pytest.raises(VerificationFailed):
        play(clear_turns(Node(3)), level_0, at(9000), *silent, at(9000))


@pytest.mark.parametrize("name", [name for name in TABLES if not CONTROL[name].clear_turns])
def test_where_nobody_is_known_to_obey_nothing_is_sent(name: str) -> None:
    with pytest.raises(RequestError, match="no servo with the register map") as caught:
        play(clear_turns(met(name)), prepares_as(name))
    assert "hls" in caught.value.expected


def test_turns_of_a_simulated_hls_are_counted_and_forgotten() -> None:
    with simulated("hls") as (real, servo):
        for name, raw in (("phase", 16), ("min_position_limit", 0), ("max_position_limit", 0)):
            real.memory[name] = raw
        servo.enable_torque()
        servo.move(9000 * COUNT)
        assert servo.position() == pytest.approx(9000 * COUNT, abs=0.05)
        assert servo.clear_turns() == pytest.approx(808 * COUNT, abs=0.05)
        assert real.memory["torque_enable"] == 0
        servo.enable_torque()
        assert servo.position() == pytest.approx(808 * COUNT, abs=0.05)


def test_a_simulated_hls_forgets_and_an_sts_is_silent() -> None:
    with simulated("hls") as (real, servo):
        assert servo.clear_turns() == pytest.approx(math.pi)
        assert real.memory["torque_enable"] == 0
    with simulated("sts") as (real, servo), pytest.raises(DeviceError, match="forget its turns"):
        servo.clear_turns()
    assert real.memory["torque_enable"] == 0
