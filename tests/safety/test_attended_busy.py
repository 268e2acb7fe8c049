"""A lease on a bus whose whole time a control loop takes: it is kept, and lost, at the moments that its rule says."""

from __future__ import annotations

import pytest

from motorbus import Robot
from motorbus.core.request import Data
from motorbus.errors import Refused
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.safety.lease import Standing
from tests.conftest import Figures, Rounds
from tests.support.machines import machine

LASTS = 0.2
ARM = "1-6"


class Full(PerfectLine):
    """A wire that counts the bytes of both sides from a moment on, and when the host sent its last one."""

    def __init__(self) -> None:
        self.bytes = 0
        self.sent_at = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        self.bytes += len(data)
        self.sent_at = at if sender is Side.HOST else self.sent_at
        return super().carry(sender, data, at)


def highest(robot: Robot) -> float:
    """The highest rate (Hz) at which its bus can be led."""
    with robot.loop(rate=10.0) as loop:
        (part,) = loop._rounds.parts.values()
        cycle = (*part.train.goals(dict.fromkeys(part.places, 0.0)), *part.reads)
        return 1 / sum(part.bus.driver.air_time(one, part.bus.rate) for one in cycle)


class Holder:
    """Leads all axes at this rate, and says every 0.18 s that he is there, until so long (s) after the begin."""

    def __init__(self, robot: Robot, rate: float, until: float) -> None:
        self.robot, self.rate, self.until = robot, rate, until
        self.begun = self.beaten = self.ended = robot.now

    def leads(self) -> None:
        robot = self.robot
        with robot.attended(lasts=LASTS) as hand, robot.loop(rate=self.rate) as loop:
            self.begun = self.beaten = robot.now
            hand.beat()
            for _ in loop:
                self.ended = robot.now
                for name in robot.axes:
                    loop.goal[name] = 0.5
                if self.ended - self.beaten > 0.9 * LASTS and self.ended - self.begun < self.until:
                    hand.beat()
                    self.beaten = self.ended
                assert robot.lease is not None
                held = robot.lease.standing(self.ended) is Standing.HELD
                assert held is (self.ended <= self.beaten + LASTS)


@pytest.mark.parametrize("silent_at", [0.0, 0.3])
def test_a_loop_that_takes_the_whole_bus_neither_starves_a_lease_nor_keeps_it(
    silent_at: float, rounds: Rounds, figures: Figures
) -> None:
    with machine(arm=ARM) as (made, sims), Robot.of(made) as robot:
        rate = highest(robot)
        line = sims["arm"].line = Full()
        holder = Holder(robot, rate, silent_at * rounds(20, 1))
        with pytest.raises(Refused, match="was lost") as lost:
            holder.leads()
        assert (lost.value.reason, lost.value.unmoved) == ("lease", False)
        share = line.bytes * 10 / robot.buses["arm"].link.rate / (robot.now - holder.begun)
        late = holder.ended - holder.beaten - LASTS
        figures(
            f"A lease on a full bus, silent after {holder.until:g} s", family="feetech",
            rate=round(rate), late_s=round(late, 4),
        )  # fmt: skip
        assert share > 0.9, "the bus was busy"
        assert abs(late) <= 1 / rate, "it held up to its end; the cycle in which that falls is the last one"
        assert not any(axis.under_way for axis in robot.axes.values())
        assert robot.lease is not None
        assert robot.lease.losses == 1
