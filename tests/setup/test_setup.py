"""From new servos to calibrated joints, on simulated servos with a scripted user."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus import Robot, feetech
from motorbus.errors import LimitExceeded, NoReply
from motorbus.setup import machine, presets
from motorbus.setup.calibrate import TURN, calibrate, read_calibration
from motorbus.setup.engine import Note, Step, run
from motorbus.setup.number import number
from motorbus.setup.port import find_port
from motorbus.setup.replace import replace
from motorbus.setup.verify import verify
from motorbus.simulation import Simulation
from tests.setup.arm import COUNT, User, arm, new_servos, run_until_interrupted, turn_to

SO101 = presets.preset("so101")
SWEEP = {1: (-900, 900), 2: (-800, 1000), 3: (-1000, 700), 4: (-600, 600), 5: (-1500, 1500), 6: (-300, 900)}


def plugs(servos: list[Any], *, together: bool = False) -> dict[str, Any]:
    """Before the prompt for an id a servo is plugged in; the others are unplugged unless `together`."""

    def plug(servo: Any) -> None:
        for other in servos:
            if other is not servo and not together and other.plugged:
                other.unplug()
        servo.plug()

    return {f"for id {id}": lambda servo=servo: plug(servo) for id, servo in enumerate(servos, 1)}


def test_six_new_servos_are_numbered_one_at_a_time() -> None:
    with new_servos() as (bus, sim, servos):
        assert run(number(bus, SO101), User(sim, before=plugs(servos))) == (6, 5, 4, 3, 2, 1)
        assert [servo.id for servo in servos] == [1, 2, 3, 4, 5, 6]
        for servo in servos:
            servo.plug()
        found = bus.run(feetech.sync_read(("position_p", "max_torque"), range(1, 7))).values
        assert {values["position_p"] for values in found.values()} == {16}
        assert [found[id]["max_torque"] for id in (1, 6)] == [1.0, 0.5]
        assert run(number(bus, SO101), User(sim)) == ()


def test_numbered_servos_may_stay_connected() -> None:
    with new_servos() as (bus, sim, servos):
        run(number(bus, SO101), User(sim, before=plugs(servos, together=True)))
        assert [servo.id for servo in servos] == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("prompt", range(6))
def test_numbering_goes_on_after_an_interrupt(prompt: int) -> None:
    with new_servos() as (bus, sim, servos):
        assert not run_until_interrupted(number(bus, SO101), User(sim, before=plugs(servos), stop_at=prompt))
        run(number(bus, SO101), User(sim, before=plugs(servos)))
        assert [servo.id for servo in servos] == [1, 2, 3, 4, 5, 6]


def test_two_new_servos_at_once_are_refused() -> None:
    with arm("1+9") as (bus, sim):
        user = User(sim, answers={"gripper": ""})
        user.before = {"gripper": lambda: user.answers.update({"gripper": "skip"} if user.notes else {})}
        user.answers["shoulder"] = user.answers["elbow"] = user.answers["wrist"] = "skip"
        assert run(number(bus, SO101), user) == ()
        assert "2 servos answer, with the ids 1, 9" in user.notes[0]
        assert sim[1].id == 1
        assert sim[9].id == 9


# -- calibrate -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [2048, 100, 3900])
@pytest.mark.parametrize("stale", [0, 1000, -2047])
def test_a_sweep_puts_the_middle_of_the_travel_at_2048(start: int, stale: int) -> None:
    """The seam of the encoder inside of the travel, and an old offset, change nothing."""
    with arm() as (bus, sim):
        for node in range(1, 7):
            turn_to(sim, node, start)
            if stale:
                feetech.Servo(bus, node).write(homing_offset=stale * COUNT)
        found = run(calibrate(bus, SO101), User(sim, sweep=SWEEP))
        for joint in SO101.joints:
            one = found[joint.name]
            assert read_calibration(bus, joint) == one or one.range_max == TURN - 1
            if not joint.full_turn:
                low, high = SWEEP[joint.id]
                assert one.range_max - one.range_min == pytest.approx(high - low, abs=4)
                assert (one.range_min + one.range_max) / 2 == pytest.approx(2048, abs=2)
                position = feetech.Servo(bus, joint.id).read_raw("present_position")["present_position"]
                assert position - one.range_min == pytest.approx(-low, abs=4)


@pytest.mark.parametrize(
    ("sweep", "problem"),
    [
        ((-10, 10), "only"),
        ((-2100, 2100), "a whole turn or more"),
        ((-5, 900), "started at an end"),
    ],
)
def test_a_sweep_that_gives_no_calibration_is_refused(sweep: tuple[int, int], problem: str) -> None:
    with arm() as (bus, sim):
        user = User(sim, sweep={**SWEEP, 2: sweep})
        user.before = {"middle pose": lambda: user.sweep.update({2: (-800, 800)} if user.notes else {})}
        run(calibrate(bus, SO101), user)
        assert user.notes[0].startswith("shoulder_lift")
        assert problem in user.notes[0]


def test_a_silent_joint_ends_the_sweep_with_its_name() -> None:
    with arm() as (bus, sim):
        user = User(sim, sweep=SWEEP)
        user.before = {"middle pose": lambda: sim[4].unplug()}
        with pytest.raises(NoReply, match="wrist_flex|4"):
            run(calibrate(bus, SO101), user)
        offsets = [feetech.Servo(bus, id).read_raw("homing_offset")["homing_offset"] for id in (1, 2, 3)]
        assert offsets == [0, 0, 0]


# -- verify, machine file --------------------------------------------------------------------------------------


def test_verify_names_the_joint_that_moved_and_a_reversed_one() -> None:
    with arm() as (bus, sim):
        user = User(sim)
        wrong = [5]
        user.before = {
            "shoulder_pan": lambda: user.push(1, 300),
            "shoulder_lift": lambda: user.push(2, -300),
            "wrist_flex": lambda: user.push(wrong.pop() if wrong else 4, 300),
        }
        signs = run(verify(bus, SO101), user)
        assert signs == {"shoulder_pan": 1, "shoulder_lift": -1, "wrist_flex": 1}
        assert any("wrist_roll (id 5) moved, not wrist_flex" in note for note in user.notes)


def test_the_machine_file_moves_within_the_calibrated_limits(tmp_path: Any) -> None:
    path = tmp_path / "motorbus.toml"
    with arm() as (bus, sim):
        found = run(calibrate(bus, SO101), User(sim, sweep=SWEEP))
        bus.close()
        config = machine.update(path, SO101, found, address=sim.url, arm="arm")
        assert machine.update(path, SO101, found, address=sim.url, arm="arm") == config
        leader = machine.update(path, SO101, found, address="feetech:sim:leader", arm="leader")
        assert set(leader.axes) == {*config.axes, *(f"leader_{name}" for name in config.axes)}
        with Robot(config) as robot:
            robot.move({"shoulder_pan": 0.5, "gripper": -0.2})
            positions = robot.positions()
            assert positions["shoulder_pan"] == pytest.approx(0.5, abs=0.01)
            with pytest.raises(LimitExceeded):
                robot.move({"shoulder_pan": 1.4})


def test_a_fresh_servo_takes_the_place_of_a_dead_one() -> None:
    with arm("1+9") as (bus, sim):
        sim[1].unplug()
        user = User(sim, sweep={2: (-500, 700)})
        one = run(replace(bus, SO101, "shoulder_lift", {"position_p": 20, "homing_offset": 1.0}), user)
        assert one.range_max - one.range_min == pytest.approx(1200, abs=4)
        assert feetech.Servo(bus, 2).read("position_p")["position_p"] == 20


class Swinger:
    """A `Face` of a user who turns the first joint of one arm to these counts, one for each look."""

    def __init__(self, arm: Simulation, *counts: int) -> None:
        self.arm = arm
        self.counts = iter(counts)
        self.notes: list[str] = []

    def show(self, step: Step) -> str | None:
        if isinstance(step, Note):
            self.notes.append(step.text)
        else:
            turn_to(self.arm, 1, next(self.counts))
        return None


def test_the_port_is_that_of_the_arm_that_is_swung_to_both_sides() -> None:
    with (
        motorbus.simulate("feetech", ids="1-6") as other,
        motorbus.simulate("feetech", ids="1-6") as mine,
        motorbus.simulate("feetech", ids="9") as foreign,
    ):
        urls = [sim.url.removeprefix("feetech:") for sim in (other, mine, foreign)]
        before = dict(mine[1].memory.values)
        user = Swinger(mine, 2100, 2300, 2048, 1800)
        assert run(find_port([*urls, "/dev/none"], SO101), user) == urls[1]
        assert user.notes[0].startswith("/dev/none: ")
        assert dict(mine[1].memory.values) == before | {"present_position": 1800}
        assert run(find_port([urls[0], urls[2]], SO101), user) == urls[0]  # the only arm
        with pytest.raises(NoReply, match="no servo with id 1 answers"):
            run(find_port(urls[2:], SO101), user)
