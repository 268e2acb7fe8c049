"""A program that was held up in the midst of a movement does not send axes to where they would be by now."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.core.steps import Progress
from motorbus.errors import Interrupted
from motorbus.link.base import Delivery, Side
from motorbus.motion.moving.stream import HELD_UP
from motorbus.session.robot import Robot
from tests.motion.loop.lines import Doubtful
from tests.support.machines import machine


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


@pytest.mark.parametrize("axis", ["a1", "c1"])
@pytest.mark.parametrize("share", [0.4, 0.6, 0.7, 0.8, 0.9, 0.99])
def test_nobody_is_blamed_for_what_the_host_did_not_say(axis: str, share: float) -> None:
    """So short a gap that the movement might go on; where an axis cannot make up for it that is why it ends."""
    with machine(arm="1", can="0x25") as (made, _):
        machines: list[Any] = []
        held: list[int] = []
        ended: list[str] = []

        def hear(event: object) -> None:
            if isinstance(event, Progress) and event.done > 500 and not held:
                held.append(event.done)
                next(iter(machines[0].buses.values())).link.advance(share * HELD_UP)  # they share a clock

        with Robot.of(made, report=hear) as robot:
            machines.append(robot)
            try:
                robot.move({axis: 0.8}, duration=1.6)
            except Interrupted as told:
                ended.append(told.cause)
            assert all("held up" in cause for cause in ended)
            assert share > 0.5 or not ended, "so short a gap is made up for"
            assert not any(one.under_way for one in robot.axes.values())
        assert held


def test_a_host_that_is_held_up_while_an_answer_is_on_its_way_is_told_as_that() -> None:
    with machine(arm="1") as (made, sims):
        machines: list[Any] = []
        held: list[float] = []

        class Frozen(Doubtful):
            """The host is held up while an answer is on its way."""

            def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
                if held == [1.0] and sender is Side.DEVICE:
                    held.append(at)
                    machines[0].buses["arm"].link.advance(0.45)
                return super().carry(sender, data, at)

        def hear(event: object) -> None:
            if isinstance(event, Progress) and event.done > 500 and not held:
                held.append(1.0)

        sims["arm"].line = Frozen()
        with Robot.of(made, report=hear) as robot:
            machines.append(robot)
            with pytest.raises(Interrupted, match=r"told where to go for \d") as told:
                robot.move({"a1": 0.8}, duration=1.6)
            assert "held up" in told.value.cause
        assert len(held) == 2


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
