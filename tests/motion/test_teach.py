"""Teaching by hand: axes are limp, and where they are guided is written down on the grid."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from pathlib import Path

import pytest

from motorbus.errors import LinkLost, MotionError, MotorbusError, NoReply, RequestError
from motorbus.motion.machine import Machine
from motorbus.motion.trajectory import Trajectory
from motorbus.session.robot import AsyncRobot, Robot
from tests.motion.loop.lines import Doubtful
from tests.motion.test_follow import move
from tests.support.machines import described, machine
from tests.support.processes import Simulated

LATE = 0.0005
"""s; a reading is there so long after the beginning of its cycle, at most."""


def test_what_is_taught_has_the_times_of_its_readings_from_0_on() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        found = robot.teach(seconds=1.0)
        assert isinstance(found, Trajectory)
        assert found.times == pytest.approx([number / 50 for number in range(51)], abs=LATE)
        assert set(found.axes) == {"a1", "a2"}
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [0, 0]
        assert not robot["a1"].engaged


def test_where_it_is_guided_is_what_is_written_down() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        axis.enable_torque()
        robot.buses["arm"].run(  # type: ignore[attr-defined]  # something else moves it meanwhile
            axis.able.move(axis.device, axis.spec.to_device(1.0), velocity=1.5, wait=False)
        )
        found = robot.teach("a1", seconds=2.0, limp=False)
        places = found.axes["a1"]
        assert places[0] == pytest.approx(0.0, abs=0.05)
        assert places[-1] == pytest.approx(1.0, abs=0.02)
        assert list(places) == sorted(places)


def test_a_cycle_in_which_somebody_cannot_be_believed_has_no_sample() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        sims["arm"].line = line = Doubtful()
        count = [0]

        def over() -> bool:
            count[0] += 1
            line.lying = {2: lambda raw: raw + 1500} if count[0] == 5 else {}
            return count[0] > 40

        found = robot.teach(until=over)
        assert len(found.times) == 40
        assert max(abs(place) for place in found.axes["a2"]) < 0.01


def test_a_cycle_in_which_somebody_was_silent_has_no_sample() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        count = [0]

        def over() -> bool:
            count[0] += 1
            (sims["arm"][2].unplug if count[0] == 5 else sims["arm"][2].plug)()
            return count[0] > 40

        found = robot.teach(until=over)
        assert len(found.times) < 41
        assert max(after - before for before, after in pairwise(found.times)) > 0.03  # where it was silent


def test_what_was_taught_until_an_axis_fell_silent_goes_along_with_the_error() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        count = [0]

        def over() -> bool:
            count[0] += 1
            if count[0] == 40:
                sims["arm"][2].unplug()
            return False

        with pytest.raises(NoReply, match="a2") as raised:
            robot.teach(until=over)
        found = raised.value.so_far
        assert isinstance(found, Trajectory)
        assert found.times == pytest.approx([number / 50 for number in range(40)], abs=LATE)
        assert set(found.axes) == {"a1", "a2"}


def test_a_port_that_dies_takes_nothing_along_of_what_was_taught(
    tmp_path: Path, unhurried: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Simulated("feetech", ids="1-2", link=tmp_path / "bus") as served:
        made = Machine.parse(described({"arm": served.bus}, "1-2", "", False, {}, {}))
        count = [0]

        def over() -> bool:
            count[0] += 1
            if count[0] == 30:
                served.process.kill()
                served.process.wait()
            return False

        lost = pytest.raises(LinkLost)
        with lost as raised, Robot.of(made) as robot:
            robot.teach(until=over)
        assert isinstance(raised.value.so_far, Trajectory)
        assert len(raised.value.so_far.times) in range(20, 31)  # a busy host may lose some of its own


def test_an_error_before_there_is_a_trajectory_has_none() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        sims["arm"][1].unplug()
        with pytest.raises(MotorbusError) as raised:
            robot.teach(seconds=1.0)
        assert raised.value.so_far is None


def test_a_reading_that_is_late_stands_where_it_was_taken() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        count = [0]

        def over() -> bool:
            count[0] += 1
            if count[0] == 3:
                robot.buses["arm"].link.advance(0.033)  # type: ignore[attr-defined]  # a busy host
            return count[0] == 5

        found = robot.teach(until=over)
        assert found.times == pytest.approx([0.0, 0.02, 0.04, 0.073, 0.08], abs=LATE)


def test_it_ends_with_as_many_samples_as_a_trajectory_can_have_and_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("motorbus.motion.teach.MOST", 20)
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        assert len(robot.teach().times) == 20
        assert "teaching ended after 0.38 s: a trajectory has 20 samples at most" in caplog.text
        caplog.clear()
        assert len(robot.teach(seconds=0.38).times) == 20
        assert not caplog.text


def test_what_the_loop_refuses_lets_nobody_go() -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        robot.enable_torque()
        with pytest.raises(RequestError, match="rate is 20000000"):
            robot.teach(rate=2e7, seconds=1.0)
        assert [sims["arm"][node].memory["torque_enable"] for node in (1, 2)] == [1, 1]


def test_too_few_samples_are_told() -> None:
    few = pytest.raises(MotionError, match="1 samples in 0 s are no trajectory")
    with machine(arm="1") as (made, _), Robot.of(made) as robot, few:
        robot.teach(until=lambda: True)


def test_what_cannot_be_taught_is_refused_by_name_and_left_out_otherwise() -> None:
    with machine(arm="1", can="0x21", lift=True) as (made, _), Robot.of(made) as robot:
        with pytest.raises(RequestError, match="lift cannot be taught"):
            robot.teach(["a1", "lift"], seconds=1.0)
        with pytest.raises(RequestError, match="c1 cannot be taught by hand"):
            robot.teach("c1", seconds=1.0)
        assert set(robot.teach(seconds=0.1).axes) == {"a1"}
        assert set(robot.teach(seconds=0.1, limp=False).axes) == {"a1", "c1"}
    nobody = pytest.raises(RequestError, match="none of these axes can be taught by hand")
    with machine(can="0x21") as (made, _), Robot.of(made) as robot, nobody:
        robot.teach(seconds=0.1)


def test_it_is_awaited_on_an_async_robot() -> None:
    async def main() -> Trajectory:
        with machine(arm="1-2") as (made, _):
            async with AsyncRobot.of(made) as robot:
                return await robot.teach(["a2"], seconds=0.2, rate=100)

    found = asyncio.run(main())
    assert len(found.times) == 21
    assert set(found.axes) == {"a2"}


def test_an_async_robot_keeps_what_was_taught_too() -> None:
    async def main() -> None:
        with machine(arm="1") as (made, sims):
            async with AsyncRobot.of(made) as robot:
                heard = iter(range(20))

                def over() -> bool:
                    if next(heard, None) is None:
                        sims["arm"][1].unplug()
                    return False

                with pytest.raises(NoReply) as raised:
                    await robot.teach(until=over)
                assert isinstance(raised.value.so_far, Trajectory)
                assert len(raised.value.so_far.times) == 21

    asyncio.run(main())


def test_what_was_taught_by_hand_is_what_a_hand_did() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        move(robot, "a1", 0.3)
        found = robot.teach(["a1"], seconds=0.2)
        assert found.axes["a1"][0] == pytest.approx(0.3, abs=0.02)
