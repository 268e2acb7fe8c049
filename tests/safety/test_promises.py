"""The points that a machine with motors should be able to rely on, each with a test that bears its number.

More tests of each stand where the part is that they are about: `docs/explanation/safety.md` has the list, and
`test_points_named` sees to it that the list names tests that there are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan, pi, radians
from typing import Any

import pytest

import motorbus
from motorbus.core.request import Data
from motorbus.core.steps import Sleep
from motorbus.errors import LimitExceeded, MotorbusError, Refused, RequestError
from motorbus.families.feetech import ServoGroup, sync_write
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.safety.standstill import Rest, stopped
from motorbus.session.robot import Robot
from tests.conftest import Rounds
from tests.safety.points import asks, known, sent
from tests.safety.test_estop import is_stop, requests
from tests.support.machines import listened, machine, said
from tests.support.world import Queue


def test_01_nothing_moves_on_connect(rounds: Rounds) -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, sims):
        listened(sims)
        before = {
            name: [node.status() for node in sim.simulator.nodes.values()] for name, sim in sims.items()
        }
        for _ in range(rounds(1_000, 250)):
            with Robot.of(made) as robot:
                robot.positions()
        assert len(sent(sims)) > 1000
        assert [data for data in sent(sims) if not asks(data)] == []
        after = {name: [node.status() for node in sim.simulator.nodes.values()] for name, sim in sims.items()}
        assert after == before


@pytest.mark.parametrize("node", [1, 2])
def test_01_torque_on_moves_by_a_count_at_most(node: int) -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        sims["arm"][node].memory["goal_position"] = 500  # an old goal, far away
        here = sims["arm"][node].raw_position
        robot[f"a{node}"].enable_torque()
        for _ in range(100):
            robot.buses["arm"].link.advance(0.01)  # type: ignore[attr-defined]
            assert abs(sims["arm"][node].raw_position - here) <= 1


def test_02_unknown_is_not_safe_and_a_stop_is_allowed_all_the_same() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        kept = ServoGroup([known(robot["a1"])]).write("goal_position")([pi + 0.1])
        sims["arm"][1].unplug()
        with pytest.raises(Refused) as caught:
            robot.buses["arm"].run(kept)  # type: ignore[attr-defined]
        assert caught.value.reason == "stale"
        sims["arm"][1].plug()
        robot.stop()


def spellings(robot: Any, to: float) -> dict[str, Callable[[], object]]:
    """Ways to order the device of a1 to an angle (rad of the device), which is at pi and whose axis is at 0."""
    axis = robot["a1"]
    bus, device, own = axis.bus, known(axis), axis.spec.from_device(to)
    return {
        "the axis": lambda: axis.move(own),
        "the machine": lambda: robot.move({"a1": own}),
        "the device": lambda: device.move(to, velocity=1.0, wait=False),
        "a register": lambda: device.write(goal_position=to),
        "a group": lambda: bus.run(sync_write({device: {"goal_position": to}})),
        "a prepared group": lambda: bus.run(ServoGroup([device]).write("goal_position")([to])),
        "a buffer": lambda: device.reg_write(goal_position=to),
        "another object": lambda: motorbus.feetech.Servo(bus, 1).move(to, velocity=1.0, wait=False),
    }


WAYS = (
    "the axis",
    "the machine",
    "the device",
    "a register",
    "a group",
    "a prepared group",
    "a buffer",
    "another object",
)


@pytest.mark.parametrize("way", WAYS)
def test_03_one_gate_refuses_the_same_in_every_spelling_and_lets_the_same_pass(way: str) -> None:
    axes = {"a1": {"low": "-60 deg", "high": "60 deg"}}
    with machine(arm="1", axes=axes) as (made, sims), Robot.of(made) as robot:
        robot["a1"].enable_torque()
        assert tuple(spellings(robot, pi)) == WAYS
        for wrong in (pi + radians(61), pi - radians(61), nan, inf):
            ordered = spellings(robot, wrong)[way]
            listened(sims)
            with pytest.raises((LimitExceeded, RequestError)):
                ordered()
            assert [data for data in sent(sims) if not asks(data)] == []
        ordered = spellings(robot, pi + radians(5))[way]
        listened(sims)
        ordered()
        assert [data for data in sent(sims) if not asks(data)] != []


def test_04_a_led_axis_that_is_left_alone_goes_to_its_last_small_goal_and_no_farther() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        course = []
        with robot.loop(100, ["a1"]) as loop:
            for _ in loop:
                course.append(sims["arm"][1].memory["goal_position"])
                loop.goal["a1"] = 2.0
                if len(course) == 60:
                    break
            sims["arm"].line = Gone()  # the host dies: nothing that it says arrives any more
            robot.buses["arm"].link.advance(5.0)  # type: ignore[attr-defined]
            assert 2100 < course[-1] < 3000, "it is on its way"
            assert abs(sims["arm"][1].raw_position - sims["arm"][1].memory["goal_position"]) <= 2
            cycle = 90 / 360 * 4096 / 100  # counts, at its greatest velocity
            assert 0 <= sims["arm"][1].memory["goal_position"] - course[-1] <= cycle + 1
            sims["arm"].line = PerfectLine()


class Gone(PerfectLine):
    """A wire on which nothing arrives any more: its host is dead, or it is cut."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        return []


def test_04_a_motion_without_an_end_needs_somebody_who_attends() -> None:
    with machine(arm="1", lift=True) as (made, sims), Robot.of(made) as robot:
        device = robot["a1"].device
        device.set_mode("velocity")
        device.enable_torque()
        listened(sims)
        for endless in (lambda: device.set_velocity(0.5), robot["lift"].home):
            with pytest.raises(Refused) as caught:
                endless()
            assert caught.value.reason == "unattended"
        assert [data for data in sent({"arm": sims["arm"]}) if not asks(data)] == []
        assert sims["stage"].simulator.nodes[1].status()["phase"] == "idle"
        with robot.attended():
            device.set_velocity(0.5)
            robot.buses["arm"].link.advance(0.5)  # type: ignore[attr-defined]
            assert sims["arm"][1].status()["moving"]
        robot.buses["arm"].link.advance(1.0)  # type: ignore[attr-defined]
        assert not sims["arm"][1].status()["moving"]


def test_05_a_holder_who_falls_silent_loses_the_machine_until_somebody_resets_it() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        device = robot["a1"].device
        device.set_mode("velocity")
        device.enable_torque()

        def falls_silent() -> None:
            with robot.attended(lasts=0.5) as hand:
                device.set_velocity(0.5)
                hand.beat()
                robot.buses["arm"].run(Sleep(0.4))  # type: ignore[attr-defined]
                assert sims["arm"][1].status()["moving"]
                robot.buses["arm"].run(Sleep(2.0))  # type: ignore[attr-defined]
                assert not sims["arm"][1].status()["moving"]

        with pytest.raises(Refused) as caught:
            falls_silent()
        assert caught.value.reason == "lease"
        with pytest.raises(Refused):
            device.set_velocity(0.5)
        assert robot.lease is not None
        robot.lease.reset(robot.now)
        with robot.attended():
            device.set_velocity(0.5)


def test_06_an_emergency_stop_goes_before_all_that_waits_on_every_bus_and_latches() -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque(["a1", "a2"])
        queues = []
        for name, bus in robot.buses.items():
            node = {"arm": 1, "can": 0x25, "stage": 1}[name]
            queues.append(Queue(bus, requests(bus, (node,))))
        listened(sims)
        robot.estop()
        first = {name: next(data for data in sim.line.sent) for name, sim in sims.items()}  # type: ignore[attr-defined]
        assert [name for name, sim in sims.items() if not is_stop(sim.family.name, first[name])] == []
        assert not any(map(asks, (first["arm"], first["stage"])))
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [0, 0]
        assert all(bus.latched for bus in robot.buses.values())
        for queue in queues:
            queue.tree.drop()
        with pytest.raises(MotorbusError):
            robot.move({"a1": 0.1})
        robot.reset()
        robot.enable_torque(["a1"])
        robot.move({"a1": 0.1})


def test_07_stopped_is_said_of_what_was_seen_to_rest_and_of_nothing_else() -> None:
    with machine(arm="1", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        found = {name: robot[name].bus.run(stopped(robot[name])) for name in ("a1", "c1", "lift")}
        assert {name: (one.promise.name, one.rest) for name, one in found.items()} == {
            "a1": ("HOLD_ACCEPTED", Rest.STOPPED),
            "c1": ("HOLD_REQUESTED", Rest.STOPPED),
            "lift": ("STOP_ACCEPTED", Rest.UNSEEN),
        }


@pytest.mark.parametrize("verb", ["stop", "disable_torque"])
def test_08_every_axis_is_visited_with_alarms_dead_nodes_and_errors_on_the_way(verb: str) -> None:
    with machine(arm="1-6", can="0x25,0x26", lift=True) as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        sims["arm"][1].unplug()
        sims["arm"][2].alarm = 0x20
        sims["can"][0x25].unplug()

        async def breaks(device: object) -> Any:
            raise MotorbusError("a driver that fails")

        robot["a3"].able = replace(robot["a3"].able, **{verb: breaks})  # type: ignore[arg-type]
        listened(sims)
        with pytest.raises(MotorbusError) as caught:
            getattr(robot, verb)()
        text = str(caught.value) + "".join(getattr(caught.value, "__notes__", ()))
        assert "a driver that fails" in text
        assert "a1" in text
        frames = said(sims)
        for node in (1, 2, 4, 5, 6):
            assert any(f"servo {node}" in frame for frame in frames), f"servo {node} was skipped"
        if verb == "disable_torque":
            assert [sims["arm"][node].memory["torque_enable"] for node in (2, 4, 5, 6)] == [0] * 4
        else:
            assert any("node 38" in frame for frame in frames)
            assert "c1" in text
