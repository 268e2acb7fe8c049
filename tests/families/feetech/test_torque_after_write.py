"""A write to EEPROM by name gives back the torque that it took, with the goal at the present position."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import tau
from typing import Any

import pytest

import motorbus
from motorbus.core.steps import Sleep
from motorbus.errors import MotorbusError
from motorbus.families.feetech import AsyncServo, Servo
from motorbus.families.feetech.driver import TorqueAfterWrite

COUNT = tau / 4096
SAGGED = 1400


@contextmanager
def holding(hook: Callable[[Any, Any, bytes], bool], **switches: Any) -> Iterator[tuple[Any, Any, list[Any]]]:
    """Servo 3 with torque at 1500, under way to 2500; `hook(real, servo, frame)` sees each frame, True drops it."""
    events: list[Any] = []
    with (
        motorbus.simulate("feetech", ids="3", **switches) as simulation,
        motorbus.open(simulation.url, report=events.append) as bus,
    ):
        real, servo = simulation[3], Servo(bus, 3)
        real.raw_position = 1500
        servo.enable_torque()
        servo.move(2500 * COUNT, velocity=0.5, wait=False)
        servo.prepare()
        send = bus.link.write

        def write(data: Any) -> None:
            if not hook(real, servo, bytes(data)):
                send(data)

        bus.link.write = write  # type: ignore[method-assign]
        yield real, servo, events
        bus.link.write = send  # type: ignore[method-assign]


def sags(real: Any, _: Any, frame: bytes) -> bool:
    if frame[4:6] == b"\x03\x0d":  # while max_temperature is written, without torque
        assert real.memory["torque_enable"] == 0
        real.raw_position = SAGGED
    return False


def test_torque_returns_where_the_servo_is_then_and_it_does_not_move() -> None:
    with holding(sags) as (real, servo, events):
        servo.write(max_temperature=65)
        servo.bus.run(Sleep(1.0))
        assert (real.memory["max_temperature"], real.memory["torque_enable"]) == (65, 1)
        assert real.memory["goal_position"] == pytest.approx(SAGGED, abs=1)
        assert real.raw_position == pytest.approx(SAGGED, abs=1)
        assert events == [TorqueAfterWrite(3, True)]


def test_torque_that_was_off_stays_off() -> None:
    with holding(sags) as (real, servo, events):
        servo.disable_torque()
        servo.write(max_temperature=65)
        assert real.memory["torque_enable"] == 0
        assert events == []


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"operating_mode": 1}, "operating_mode changes what a goal means"),
        ({"angular_resolution": 2}, "angular_resolution changes what a goal means"),
        ({"min_position_limit": 0, "max_position_limit": 0}, "position limits of 0"),
        ({"min_position_limit": 2000 * COUNT}, "outside its limits"),
    ],
)
def test_torque_stays_off_where_holding_is_not_safe_and_that_is_reported(values: Any, why: str) -> None:
    with holding(lambda *_: False) as (real, servo, events):
        servo.write(**values)
        assert real.memory["torque_enable"] == 0
        (event,) = events
        assert not event.on
        assert why in event.why


FRAMES = 24
"""More frames than a write sends from its first read to its last."""


@pytest.mark.parametrize("at", range(FRAMES))
def test_an_interrupt_in_front_of_any_frame_ends_with_torque_and_at_rest(at: int) -> None:
    sent = 0

    def interrupt(real: Any, servo: Any, frame: bytes) -> bool:
        nonlocal sent
        sent += 1
        if sent == at + 1:
            raise KeyboardInterrupt
        return False

    with holding(interrupt) as (real, servo, events):
        try:
            servo.write(max_temperature=65)
        except KeyboardInterrupt as error:
            told = [*map(str, events), *getattr(error, "__notes__", ())]
            assert at < 2 or any("torque is on again" in text for text in told)
        assert real.memory["torque_enable"] == 1
        assert real.memory["lock"] == 1
        if at >= 2:  # before that, nothing has been changed and its move goes on
            servo.bus.run(Sleep(0.5))
            stands = real.raw_position
            servo.bus.run(Sleep(1.0))
            assert real.raw_position == stands


def test_a_write_that_fails_gives_the_torque_back_and_says_so() -> None:
    with (
        holding(lambda _real, _servo, frame: frame[4:6] == b"\x03\x0d") as (real, servo, _),
        pytest.raises(MotorbusError) as caught,
    ):
        servo.write(max_temperature=65)
    assert real.memory["torque_enable"] == 1
    assert real.memory["max_temperature"] == 70
    assert any("torque is on again" in note for note in caught.value.__notes__)


def test_after_a_restart_it_stays_off_and_the_error_says_so() -> None:
    def restart(real: Any, _: Any, frame: bytes) -> bool:
        if frame[4:6] == b"\x03\x0d":
            real.power_cycle()
        return False

    with holding(restart) as (real, servo, _), pytest.raises(MotorbusError) as caught:
        servo.write(max_temperature=65)
    assert real.memory["torque_enable"] == 0
    assert any("it has restarted" in note for note in caught.value.__notes__)


def test_torque_off_by_another_task_meanwhile_is_not_undone() -> None:
    async def both() -> tuple[int, list[Any]]:
        events: list[Any] = []
        with motorbus.simulate("feetech", ids="3") as simulation:
            async with motorbus.open_async(simulation.url, report=events.append) as bus:
                servo, send = AsyncServo(bus, 3), bus.link.write
                await servo.enable_torque()
                beside: list[asyncio.Task[None]] = []

                def write(data: Any) -> None:
                    if bytes(data[4:6]) == b"\x03\x0d" and not beside:
                        beside.append(asyncio.get_running_loop().create_task(off()))
                    send(data)

                async def off() -> None:
                    await AsyncServo(bus, 3).disable_torque()

                bus.link.write = write  # type: ignore[method-assign]
                await servo.write(max_temperature=65)
                await asyncio.gather(*beside)
                return simulation[3].memory["torque_enable"], events

    torque, (event,) = asyncio.run(both())
    assert torque == 0
    assert "it was stopped" in event.why
