"""A program that was held up in the midst of a movement does not send axes to where they would be by now."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.operation import Data, Progress
from motorbus.errors import Interrupted
from motorbus.link.base import Delivery, Side
from motorbus.motion.moving.stream import HELD_UP
from motorbus.session.robot import Robot
from tests.motion.loop.lines import Doubtful
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


class SomeLost(Doubtful):
    """As many answers as `left` says are lost, of those that are mute."""

    left = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        found = super().carry(sender, data, at)
        if sender is Side.DEVICE and not found:
            self.left -= 1
            self.mute = self.mute if self.left else set()
        return found


def test_who_was_not_asked_meanwhile_is_not_called_silent_for_one_answer_that_is_lost_then() -> None:
    with machine(arm="1-2") as (made, sims):
        machines: list[Any] = []
        held: list[int] = []
        sims["arm"].line = line = SomeLost()

        def hear(event: object) -> None:
            if isinstance(event, Progress) and event.done > 1500 and not held:
                held.append(event.done)
                line.mute, line.left = {1}, 2
                machines[0].buses["arm"].link.advance(0.9 * HELD_UP)

        with Robot.of(made, report=hear) as robot:
            machines.append(robot)
            robot.move({"a1": 0.6, "a2": 0.6}, duration=2.0)
            assert robot["a1"].position() == pytest.approx(0.6, abs=0.01)
        assert held
        assert not line.mute


def _place(sims: Any, axis: str) -> float:
    """Where it really is (rad of its device)."""
    if axis == "a1":
        return float(sims["arm"][1].raw_position) * 2 * 3.141592653589793 / 4096
    return float(sims["can"][0x25].raw_position) * 3.141592653589793 / 1800
