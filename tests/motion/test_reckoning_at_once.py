"""An axis that is reckoned makes one movement at a time: whatever is ordered meanwhile, the estimate stays true."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from motorbus import AsyncRobot, Interrupted, NotHomed, RequestError
from motorbus.motion.axis import AsyncAxis
from motorbus.simulation.named import Simulation
from tests.support.machines import machine

"""For one turn of 5 mm, as project 1 of the simulated controller says."""


PULSES = 1600
"""For one turn of 5 mm, as project 1 of the simulated controller says."""


def stands(sims: dict[str, Simulation]) -> float:
    """How far the carriage is from where it was when its controller was switched on (m)."""
    return float(str(sims["stage"][1].status()["position"])) * 0.005 / PULSES


def told_at_once(
    begin: float, orders: Callable[[AsyncRobot, AsyncAxis], list[Coroutine[Any, Any, object]]]
) -> tuple[list[object], float | None, float, bool]:
    """What came of orders that are given at once, the estimate, where it truly is (m), and whether it is under way."""

    async def main() -> tuple[list[object], float | None, float, bool]:
        with machine(lift=True) as (made, sims):
            async with AsyncRobot.of(made) as robot:
                lift = robot["lift"]
                lift.declare(begin)
                async with robot.attended():
                    told = await asyncio.gather(*orders(robot, lift), return_exceptions=True)
                return list(told), lift.estimated, begin + stands(sims), lift.under_way

    return asyncio.run(main())


def refused(told: object) -> bool:
    return (
        isinstance(told, RequestError) and "lift is moving" in str(told) and "nothing was sent" in str(told)
    )


def test_a_second_way_is_refused_and_leads_past_no_limit() -> None:
    told, estimated, true, under_way = told_at_once(
        0.19, lambda _, lift: [lift.move_by(0.005), lift.move_by(0.1)]
    )
    assert told[0] == pytest.approx(0.005, abs=1e-5)
    assert refused(told[1])
    assert estimated == pytest.approx(true, abs=1e-5)
    assert estimated == pytest.approx(0.195, abs=1e-5)
    assert not under_way


def test_what_would_be_refused_anyway_does_not_end_the_account_of_the_first() -> None:
    told, estimated, true, under_way = told_at_once(
        0.0, lambda _, lift: [lift.move_by(0.01), lift.move_by(1e-9)]
    )
    assert told[0] == pytest.approx(0.01, abs=1e-5)
    assert refused(told[1])
    assert estimated == pytest.approx(true, abs=1e-5)
    assert not under_way


def test_a_homing_and_a_way_at_once_are_refused_beside_a_way() -> None:
    told, estimated, true, _ = told_at_once(
        0.0, lambda _, lift: [lift.move_by(0.01), lift.home(deadline=0.5), lift.move_by(0.01), lift.run(1)]
    )
    assert told[0] == pytest.approx(0.01, abs=1e-5)
    assert all(refused(one) for one in told[1:])
    assert estimated == pytest.approx(true, abs=1e-5)


def test_a_way_beside_a_homing_that_finds_nothing_is_refused() -> None:
    told, estimated, _, _ = told_at_once(0.0, lambda _, lift: [lift.home(deadline=0.5), lift.move_by(0.01)])
    assert isinstance(told[0], NotHomed)
    assert refused(told[1])
    assert estimated is None


def test_a_movement_of_the_robot_is_refused_beside_a_jog() -> None:
    told, estimated, true, _ = told_at_once(
        0.1, lambda robot, lift: [lift.jog(0.01, 0.3), robot.move({"lift": 0.15}), lift.move(0.2)]
    )
    assert told[0] == pytest.approx(0.003, abs=1e-5)
    assert all(refused(one) for one in told[1:])
    assert estimated == pytest.approx(true, abs=1e-5)


def test_behind_a_stop_it_is_not_known_where_the_next_movement_begins() -> None:
    async def main() -> None:
        with machine(lift=True) as (made, sims):
            async with AsyncRobot.of(made) as robot:
                lift = robot["lift"]
                lift.declare(0.0)
                first = asyncio.create_task(lift.move_by(0.1))
                while not sims["stage"][1].status()["frequency"]:
                    await asyncio.sleep(0)
                await lift.stop()
                with pytest.raises(RequestError, match="lift is moving"):
                    lift.declare(0.05)  # it slows down
                with pytest.raises(Interrupted):
                    await first
                assert lift.estimated is None
                assert not lift.under_way, "it has stopped, and has had its time to"
                lift.declare(0.05)
                assert await lift.move_by(0.005) == pytest.approx(0.005, abs=1e-5)
                assert lift.estimated == pytest.approx(0.055, abs=1e-5)

    asyncio.run(main())
