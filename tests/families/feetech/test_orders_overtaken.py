"""What was ordered before the torque went off, or before a setting changed its meaning, moves nothing afterwards."""

from __future__ import annotations

import asyncio
from math import tau
from typing import Any

import pytest

import motorbus
from motorbus.core.steps import Sleep
from motorbus.errors import Interrupted, RequestError
from motorbus.families.feetech import AsyncServo, Servo, action_all, sync_write, sync_write_positions
from motorbus.families.feetech.table import Mode
from tests.families.feetech.maps import simulated

COUNT = tau / 4096
RATES = {"sts3215": 1_000_000, "hls3925": 1_000_000, "sm85blhv": 115_200}
GOALS = (40, 41, 42)
"""Where a packet that goes for a position may begin: at the torque switch, the acceleration, the goal."""


def steps(servo: Any) -> None:
    servo.set_mode("step")


def calibrates(servo: Any) -> None:
    servo.calibrate()


def limits(servo: Any) -> None:
    servo.write(min_position_limit=1450 * COUNT, max_position_limit=3000 * COUNT)


def lets_go(servo: Any) -> None:
    servo.disable_torque()


def stops_all(servo: Any) -> None:
    servo.bus.estop()
    servo.bus.reset()


SETTINGS = [steps, calibrates, limits]


def later(servo: Any, seconds: float = 2.0) -> None:
    servo.bus.run(Sleep(seconds))


def line(bus: Any) -> Any:
    """What the bus writes to; its `write` may be stepped in front of."""
    return bus.link


async def let_go(servo: AsyncServo) -> None:
    await servo.disable_torque()


async def interfered(model: str, lost: bool) -> tuple[list[Any], float, int]:
    """A move from 1500 to 652, and beside it, from the moment its goal is written, torque off; the goal may get lost
    once. What came of both, where the shaft is later, and its torque."""
    with motorbus.simulate("feetech", ids="3", model=model) as simulation:
        async with motorbus.open_async(simulation.url, baud=RATES[model]) as bus:
            real, servo, link, write = simulation[3], AsyncServo(bus, 3), line(bus), bus.link.write
            real.raw_position = 1500
            await servo.prepare()
            await servo.enable_torque()
            beside: list[asyncio.Task[None]] = []

            def wrote(data: Any) -> None:
                if data[4] == 3 and data[5] in GOALS and len(data) > 9 and not beside:
                    beside.append(asyncio.get_running_loop().create_task(let_go(servo)))
                    if lost:
                        return
                write(data)

            link.write = wrote
            came: list[Any] = await asyncio.gather(servo.move(1.0, wait=False), return_exceptions=True)
            came += await asyncio.gather(*beside, return_exceptions=True)
            link.write = write
            await bus.run(Sleep(3.0))
            return came, real.raw_position, real.memory["torque_enable"]


@pytest.mark.parametrize("model", RATES)
def test_a_goal_that_was_lost_is_not_sent_again_once_the_servo_was_let_go(model: str) -> None:
    (moved, let_go), position, torque = asyncio.run(interfered(model, True))
    assert isinstance(moved, Interrupted)
    assert "withdrawn" in moved.summary
    assert (let_go, torque) == (None, 0)
    assert position == pytest.approx(1500, abs=2)


@pytest.mark.parametrize("model", RATES)
def test_one_that_was_heard_before_ends_with_the_torque_too(model: str) -> None:
    (_, let_go), _, torque = asyncio.run(interfered(model, False))
    assert (let_go, torque) == (None, 0)


@pytest.mark.parametrize("change", SETTINGS)
def test_what_a_loop_keeps_is_refused_once_settings_have_changed(change: Any) -> None:
    with simulated("sts") as (real, servo):
        real.raw_position = 1500
        servo.prepare()
        servo.enable_torque()
        kept = sync_write_positions([servo], [1400 * COUNT])
        servo.bus.run(kept)
        later(servo)
        assert real.raw_position == pytest.approx(1400, abs=12)
        change(servo)
        stood = real.motion.position(real._now())
        with pytest.raises(RequestError, match="before the settings of node 3 were changed") as caught:
            servo.bus.run(kept)
        assert "prepare()" in caught.value.advice
        servo.prepare()
        with pytest.raises(RequestError, match="before the settings of node 3 were changed"):
            servo.bus.run(kept)
        later(servo)
        assert real.motion.position(real._now()) == pytest.approx(stood, abs=1)
        assert real.memory["torque_enable"] == 0


def test_what_a_loop_keeps_goes_on_after_a_setting_that_changes_no_meaning() -> None:
    with simulated("sts") as (real, servo):
        servo.prepare()
        kept = sync_write_positions([servo], [1400 * COUNT])
        servo.write(led_mask=5)
        with pytest.raises(RequestError, match="before the settings"):
            servo.bus.run(kept)
        servo.prepare()
        servo.bus.run(kept)
        later(servo)
        assert real.raw_position == pytest.approx(1400, abs=12)


def test_an_order_that_waited_for_a_change_of_settings_is_refused() -> None:
    """Made for position mode while another task was alone with the bus, and at its turn when that has ended."""

    async def both() -> tuple[Any, Any, float, float]:
        with motorbus.simulate("feetech", ids="3") as simulation:
            async with motorbus.open_async(simulation.url) as bus:
                real, servo, link, write = simulation[3], AsyncServo(bus, 3), line(bus), bus.link.write
                await servo.prepare()
                beside: list[asyncio.Task[None]] = []

                def wrote(data: Any) -> None:
                    if data[4:6] == b"\x03\x21":  # the mode is being written
                        order = bus.run(sync_write_positions([servo], [1.0]))
                        beside.append(asyncio.get_running_loop().create_task(order))
                    write(data)

                link.write = wrote
                stood = real.motion.position(real._now())
                await servo.set_mode("step")
                (failure,) = await asyncio.gather(*beside, return_exceptions=True)
                await bus.run(Sleep(3.0))
                return failure, servo.known_mode, stood, real.motion.position(real._now())

    failure, mode, stood, stands = asyncio.run(both())
    assert isinstance(failure, RequestError)
    assert "before the settings of node 3 were changed" in failure.summary
    assert mode is Mode.STEP
    assert stands == pytest.approx(stood, abs=1)


@pytest.mark.parametrize("between", [*SETTINGS, lets_go, stops_all])
@pytest.mark.parametrize("everybody", [False, True])
def test_an_action_does_not_carry_out_what_waited_through_it(between: Any, everybody: bool) -> None:
    with simulated("sts") as (real, servo):
        real.raw_position = 1500
        servo.prepare()
        servo.enable_torque()
        servo.reg_write(goal_position=1400 * COUNT)
        between(servo)
        servo.prepare()
        later(servo, 0.1)
        stood = real.motion.position(real._now())
        with pytest.raises(RequestError, match=r"the REG WRITE that waits|told to let go") as caught:
            servo.bus.run(action_all([servo])) if everybody else servo.action()
        assert "reg_write" in caught.value.advice or "make it again" in caught.value.advice
        later(servo)
        assert real.motion.position(real._now()) == pytest.approx(stood, abs=1)
        assert real.memory["torque_enable"] == (between is limits)


def test_a_reg_write_of_another_object_is_stopped_for_all() -> None:
    """The bus knows of the stop, whoever asked for it."""
    with simulated("sts") as (real, servo):
        servo.enable_torque()
        servo.reg_write(goal_position=1400 * COUNT)
        Servo(servo.bus, 3).disable_torque()
        with pytest.raises(RequestError, match="told to let go"):
            servo.action()
        servo.reg_write(goal_position=1400 * COUNT)
        servo.action()
        later(servo)
        assert real.raw_position == pytest.approx(1400, abs=12)


@pytest.mark.parametrize("mode", [4, 7])
def test_no_goal_is_written_in_a_mode_that_nobody_explains(mode: int) -> None:
    with simulated("hls", unknown_mode="position") as (real, servo):
        real.memory["operating_mode"] = mode
        real.memory["torque_enable"] = 1
        stood = real.motion.position(real._now())
        for name in ("goal_position", "goal_velocity", "goal_torque"):
            with pytest.raises(RequestError, match="nobody has published what goal_"):
                servo.write(**{name: 1.0})
            with pytest.raises(RequestError, match="nobody has published what goal_"):
                servo.reg_write(**{name: 1.0})
            with pytest.raises(RequestError, match="nobody has published what goal_"):
                servo.bus.run(sync_write({servo: {name: 1.0}}))
        later(servo)
        assert real.motion.position(real._now()) == pytest.approx(stood, abs=1)


@pytest.mark.parametrize("change", SETTINGS)
def test_what_somebody_else_handed_over_is_harmless_once_settings_have_changed(change: Any) -> None:
    """Another program's REG WRITE, and its ACTION for everybody, of which nobody here knows."""
    with simulated("sts") as (real, servo):
        real.raw_position = 1500
        servo.enable_torque()
        Servo(servo.bus, 3).reg_write(goal_position=1400 * COUNT)
        change(servo)
        stood = real.motion.position(real._now())
        servo.bus.run(action_all())
        later(servo)
        assert real.motion.position(real._now()) == pytest.approx(stood, abs=1)
        assert real.memory["torque_enable"] == 0
        assert servo.read_raw("reg_write_pending") == {"reg_write_pending": 0}
