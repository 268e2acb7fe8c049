"""The points that a machine with motors should be able to rely on, each with a test that bears its number.

 1 nothing moves on connect       test_01…, and test_killed
 2 unknown is not safe            test_02…, test_gate, test_guard
 3 one gate for all commands      test_property, test_fence
 4 bounded motion                 test_killed, test_gate (endless motion needs somebody who attends)
 5 watchdogs                      test_lease
 6 an emergency stop pre-empts    test_estop
 7 what a stop means              test_07…, test_standstill
 8 every axis is visited          test_08…
12 stale data drive nothing       test_12…, test_track
13 all or nothing                 test_13…
14 load and heat                  test_strain
15 degraded buses can be stopped  test_15…
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from math import nan, pi
from typing import Any

import pytest

import motorbus
from motorbus.core.operation import CanFrame, Data, Report
from motorbus.errors import LimitExceeded, MotorbusError, Refused
from motorbus.families.feetech import sync_write_positions
from motorbus.motion.safety.standstill import Rest, stopped
from motorbus.session.robot import Robot
from tests.motion.machines import Heard, listened, machine, said


def asks(data: Data) -> bool:
    """PING, READ or SYNC READ of FEETECH; an SDO upload; read project or read input of a stepper controller."""
    if isinstance(data, CanFrame):
        return data.id > 0x600 and data.data[0] & 0xE0 == 0x40
    if data[:2] == b"\xff\xff":
        return data[4] in (1, 2, 0x82)
    return data[2] in (0x3E, 0x00)


def sent(sims: Any) -> list[Data]:
    """What left for these since `listened`."""
    return [data for sim in sims.values() for data in sim.line.sent if isinstance(sim.line, Heard)]


def test_01_nothing_moves_on_connect(rounds: Callable[[int], int]) -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, sims):
        listened(sims)
        before = {
            name: [node.status() for node in sim.simulator.nodes.values()] for name, sim in sims.items()
        }
        for _ in range(rounds(1_000)):
            with Robot.of(made) as robot:
                robot.positions()
        assert len(sent(sims)) > 4000
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
        kept = sync_write_positions([_known(robot["a1"])], [pi + 0.1])
        sims["arm"][1].unplug()
        with pytest.raises(Refused) as caught:
            robot.buses["arm"].run(kept)  # type: ignore[attr-defined]
        assert caught.value.reason == "stale"
        sims["arm"][1].plug()
        robot.stop()


def _known(axis: Any) -> Any:
    """The device of an axis, once its limits and units have been read."""
    axis.bus.run(axis.able["limits"](axis.device))
    return axis.device


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

        def breaks(device: object) -> Any:
            raise MotorbusError("a driver that fails")
            yield from ()

        robot["a3"].able = {**robot["a3"].able, verb: breaks}
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


def test_12_a_position_is_not_used_once_it_is_old() -> None:
    with machine(arm="1", axes={"a1": {"max_step": "10 deg"}}) as (made, sims), Robot.of(made) as robot:
        robot.positions()
        sims["arm"][1].raw_position = 3000  # turned by hand, by 84 degrees
        robot.buses["arm"].link.advance(1.0)  # type: ignore[attr-defined]
        with pytest.raises(LimitExceeded) as caught:
            robot["a1"].device.move(pi + 0.1, velocity=1.0)
        assert caught.value.reason == "step"
        robot["a1"].device.move(3000 * 2 * pi / 4096 + 0.1, velocity=1.0)


@pytest.mark.parametrize("wrong", [nan, 9.0])
def test_13_a_synchronous_move_is_all_or_nothing(wrong: float) -> None:
    with machine(arm="1-3", can="0x25") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque(["a1", "a2", "a3"])
        listened(sims)
        with pytest.raises(LimitExceeded):
            robot.move({"a1": 0.1, "a2": 0.1, "a3": 0.1, "c1": wrong})
        for values in ([pi, pi, pi + wrong], [pi + wrong, pi, pi]):
            devices = [robot[name].device for name in ("a1", "a2", "a3")]
            with pytest.raises(LimitExceeded):
                robot.buses["arm"].run(sync_write_positions(devices, values))  # type: ignore[attr-defined]
        assert [data for data in sent(sims) if not asks(data)] == []


def test_15_a_bus_can_be_stopped_when_everything_around_it_fails() -> None:
    def full(event: object) -> None:
        raise OSError(28, "No space left on device")

    with ExitStack() as stack:
        sim = stack.enter_context(motorbus.simulate("feetech", ids="1-4"))
        bus = stack.enter_context(motorbus.open(sim.url, report=full))
        watcher = bus.trace.subscribe(limit=1)
        for node in (1, 2, 3, 4):
            motorbus.feetech.Servo(bus, node).enable_torque()
        with pytest.raises(OSError, match="No space left"):
            bus.run(iter(Report("something")))
        sim[3].unplug()
        outcome = bus.estop()
        assert (set(outcome.acknowledged), outcome.silent) == ({1, 2, 4}, (3,))
        assert [sim[node].memory["torque_enable"] for node in (1, 2, 4)] == [0, 0, 0]
        assert watcher.dropped > 10
