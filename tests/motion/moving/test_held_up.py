"""A program that was held up in the midst of a movement does not send axes to where they would be by now."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.operation import Progress
from motorbus.errors import Interrupted
from motorbus.motion.moving.stream import HELD_UP
from motorbus.session.robot import Robot
from tests.motion.machines import machine


@pytest.mark.parametrize("axis", ["a1", "c1"])
@pytest.mark.parametrize("seconds", [HELD_UP + 0.1, 3.0, 20.0])
def test_after_a_gap_all_stop_where_they_are(axis: str, seconds: float) -> None:
    with machine(arm="1", can="0x25") as (made, sims):
        machines: list[Any] = []
        held: list[float] = []

        def hear(event: object) -> None:
            if isinstance(event, Progress) and event.done > 1500 and not held:
                held.append(machines[0][axis].spec.from_device(_place(sims, axis)))
                for bus in machines[0].buses.values():
                    bus.link.advance(seconds)

        with Robot.of(made, report=hear) as robot:
            machines.append(robot)
            with pytest.raises(Interrupted, match=r"told where to go for \d") as told:
                robot.move({"a1": 0.6, "c1": 0.6}, duration=6.0)
            assert "held up" in told.value.cause
            assert robot[axis].position() == pytest.approx(held[0], abs=0.05)
            assert not any(one.under_way for one in robot.axes.values())


def test_a_short_one_is_made_up_for() -> None:
    with machine(arm="1", can="0x25") as (made, _):
        machines: list[Any] = []
        held: list[int] = []

        def hear(event: object) -> None:
            if isinstance(event, Progress) and event.done > 1500 and not held:
                held.append(event.done)
                for bus in machines[0].buses.values():
                    bus.link.advance(HELD_UP / 2)

        with Robot.of(made, report=hear) as robot:
            machines.append(robot)
            robot.move({"a1": 0.6, "c1": 0.6}, duration=6.0)
            assert robot["a1"].position() == pytest.approx(0.6, abs=0.01)
        assert held


def _place(sims: Any, axis: str) -> float:
    """Where it really is (rad of its device)."""
    if axis == "a1":
        return float(sims["arm"][1].raw_position) * 2 * 3.141592653589793 / 4096
    return float(sims["can"][0x25].raw_position) * 3.141592653589793 / 1800
