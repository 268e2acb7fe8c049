"""An axis goes while it is asked to again and again; the last beat is worth a quantum, and no motion follows it."""

from __future__ import annotations

import asyncio
from math import inf, nan, radians

import pytest

from motorbus import AsyncRobot, Robot
from motorbus.core.steps import Sleep
from motorbus.errors import LimitExceeded, MotorbusError, RequestError
from motorbus.motion.quanta import LONGEST, QUANTUM
from tests.support.machines import listened, machine, said

SPEED = radians(45)


def test_it_goes_while_beats_come_at_the_velocity_that_was_said() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        for name, velocity in (("a1", SPEED), ("c1", -SPEED)):
            robot.move({name: 0.0})
            with robot.jogging(name, velocity) as hand:
                for _ in range(5):
                    hand.beat()
                gone = robot.positions()[name]
            assert gone == pytest.approx(velocity * QUANTUM * 5, rel=0.35)


@pytest.mark.parametrize("name", ["a1", "c1"])
def test_without_a_beat_it_goes_no_further_than_a_quantum(name: str) -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        with robot.jogging(name, SPEED) as hand:
            hand.beat()
            hand.beat()
            before = robot.positions()[name]
            bus = robot.buses[robot[name].spec.bus]
            bus.run(Sleep(5.0))  # type: ignore[attr-defined]
            after = robot.positions()[name]
        assert before is not None
        assert after is not None
        assert 0 <= after - before < SPEED * LONGEST


def test_each_beat_of_a_stepper_is_one_bounded_move() -> None:
    with machine(lift=True) as (made, sims), Robot.of(made) as robot:
        robot["lift"].declare(0.1)
        with robot.jogging("lift", -0.01) as hand:
            for _ in range(3):
                hand.beat()
            assert not sims["stage"][1].status()["frequency"]
        assert robot["lift"].estimated == pytest.approx(0.1 - 3 * 0.01 * QUANTUM, abs=1e-4)


def test_it_ends_at_the_limit_and_says_so() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        robot.move({"a1": radians(145)})
        with robot.jogging("a1", SPEED) as hand:
            for _ in range(2):
                try:
                    hand.beat()
                except LimitExceeded:
                    break
            else:
                pytest.fail("it went on")
        assert radians(140) < robot["a1"].position() < radians(150.5)


def test_entering_it_orders_nothing() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        with robot.jogging("a1", SPEED):
            pass
        assert not [one for one in said(sims) if "WRITE" in one]


@pytest.mark.parametrize(
    ("velocity", "rate"),
    [(0.0, 50.0), (nan, 50.0), (inf, 50.0), (99.0, 50.0), (0.5, 3.9), (0.5, nan), (0.5, inf), (0.5, -1.0)],
)
def test_what_cannot_be_is_refused_before_anything_is_sent(velocity: float, rate: float) -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        with pytest.raises(MotorbusError, match="nothing was sent"):
            robot.jogging("a1", velocity, rate=rate)
        with pytest.raises(RequestError, match="rate is"):
            robot.jogging("a1", 0.5, rate="x")  # type: ignore[arg-type]
        assert not said(sims)


def test_beats_are_for_the_inside_of_its_with() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        hand = robot.jogging("a1", SPEED)
        with pytest.raises(RequestError, match="is over"):
            hand.beat()
        with hand:
            hand.beat()
        with pytest.raises(RequestError, match="is over"):
            hand.beat()


def test_on_an_event_loop_it_is_the_same() -> None:
    async def main() -> None:
        with machine(arm="1", lift=True) as (made, _):
            async with AsyncRobot.of(made) as robot:
                robot["lift"].declare(0.1)
                for name, velocity in (("a1", SPEED), ("lift", 0.01)):
                    before = (await robot.positions())[name]
                    async with robot.jogging(name, velocity) as hand:
                        for _ in range(5):
                            await hand.beat()
                    after = (await robot.positions())[name]
                    assert before is not None
                    assert after is not None
                    assert after - before == pytest.approx(velocity * QUANTUM * 5, rel=0.35)

    asyncio.run(main())
