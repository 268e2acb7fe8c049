"""What a loop costs on each bus of a machine, from the exchanges of its cycle alone."""

from __future__ import annotations

import asyncio
from math import inf, nan

import pytest

from motorbus.errors import RequestError
from motorbus.motion.budget import BusBudget, RobotBudget, check_figures, refuse_above
from motorbus.session.robot import AsyncRobot, Robot
from tests.support.machines import Heard, machine

FAST = BusBudget(("a",), 1_000_000, 2, 6, wire=0.001, turnaround=0.0, waits=0.0)
SLOW = BusBudget(("b",), 500_000, 4, 4, wire=0.003, turnaround=0.00025, waits=0.001)


def test_a_bus_carries_what_its_cycle_leaves_room_for() -> None:
    assert FAST.highest_rate == pytest.approx(1000.0)
    assert SLOW.highest_rate == pytest.approx(250.0)
    assert SLOW.load(125.0) == pytest.approx(0.5)


def test_the_slowest_bus_decides() -> None:
    found = RobotBudget(250.0, {"fast": FAST, "slow": SLOW})
    assert found.slowest == "slow"
    assert found.highest_rate == pytest.approx(250.0)
    assert found.fits()
    refuse_above(found)
    above = RobotBudget(251.0, found.buses)
    assert not above.fits()
    with pytest.raises(
        RequestError, match="a loop of 251 Hz cannot be: slow carries 250.0 Hz at most"
    ) as refused:
        refuse_above(above)
    assert "nothing moved" in refused.value.advice
    assert RobotBudget(5.0, {}).highest_rate == inf
    assert RobotBudget(5.0, {}).slowest == ""


def test_a_machine_of_all_kinds() -> None:
    with machine(arm="1-6", can="0x21-0x22", lift=True) as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = line = Heard()
        found = robot.budget(100.0)
        assert found.without == ("lift",)
        arm, can = found.buses["arm"], found.buses["can"]
        assert arm.wire == pytest.approx(880e-6)  # 88 bytes of ten bits at 1 Mbaud
        assert (arm.requests, arm.replies, arm.axes) == (2, 6, ("a1", "a2", "a3", "a4", "a5", "a6"))
        assert can.wire == pytest.approx(8 * 111 * 1.1 / 500_000)
        assert (can.requests, can.replies, can.waits) == (4, 4, 0.0)
        assert found.highest_rate == can.highest_rate
        assert {data[4] for data in line.sent if isinstance(data, bytes)} <= {
            0x02,
            0x82,
        }  # it reads, and writes nothing


def test_devices_that_think_make_it_lower_where_they_are_waited_for() -> None:
    with machine(arm="1-6") as (made, _), Robot.of(made) as robot:
        quick, slow = robot.budget(), robot.budget(turnaround=0.0001)
        assert slow.buses["arm"].waits == pytest.approx(0.0006)
        assert 1 / slow.highest_rate - 1 / quick.highest_rate == pytest.approx(0.0006)
        assert robot.budget(axes="a1").highest_rate > quick.highest_rate


@pytest.mark.parametrize(
    ("rate", "turnaround"), [(-1.0, 0.0), (nan, 0.0), (inf, 0.0), (1.0, -1.0), (1.0, nan)]
)
def test_figures_that_cannot_be(rate: float, turnaround: float) -> None:
    with (
        machine(arm="1") as (made, _),
        Robot.of(made) as robot,
        pytest.raises(RequestError, match="is (-1|nan|inf)"),
    ):
        robot.budget(rate, turnaround=turnaround)


def test_what_is_no_number_is_no_figure() -> None:
    for wrong in ("x", True, 10**400):
        with pytest.raises(RequestError, match="rate is .*"):
            check_figures(wrong)  # type: ignore[arg-type]


def test_it_is_awaited_on_an_async_robot() -> None:
    async def main() -> RobotBudget:
        with machine(arm="1-2") as (made, _):
            async with AsyncRobot.of(made) as robot:
                return await robot.budget(50.0)

    assert asyncio.run(main()).fits()
