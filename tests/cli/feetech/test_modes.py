"""The mode of a servo, what keeps it from obeying, and orders beyond a position; with consent where it moves far."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Ran, Run
from tests.families.feetech.maps import MODELS


@pytest.fixture
def servo() -> Iterator[Simulation]:
    """One simulated STS3215, 3."""
    with motorbus.simulate("feetech", ids="3") as simulation:
        yield simulation


def put(run: Run, servo: Simulation, mode: str) -> Ran:
    ran = run("feetech", "mode", f"{servo.url}#3", mode, "--yes", "--json")
    assert ran.code == 0, ran.err
    return ran


def test_what_it_heeds_and_what_is_in_the_way(run: Run, servo: Simulation) -> None:
    document = run("feetech", "mode", f"{servo.url}#3", "--json").document
    assert document["schema"] == "motorbus.feetech.mode/1"
    assert (document["id"], document["mode"], document["code"], document["lock"]) == (
        *(3, "position", 0),
        "closed",
    )
    assert document["blockers"] == ["its torque is off (torque_enable 0): `motorbus torque on`"]
    assert run("torque", "on", f"{servo.url}#3").code == 0
    assert run("feetech", "mode", f"{servo.url}#3", "--json").document["blockers"] == []
    servo[3].memory["torque_limit"] = 0
    said = run("feetech", "mode", f"{servo.url}#3").out
    assert "torque_limit is 0: `motorbus feetech torque-limit BUS#ID 1.0`" in said


def test_another_mode_needs_consent_and_is_kept(run: Run, servo: Simulation) -> None:
    ran = run("feetech", "mode", f"{servo.url}#3", "velocity")
    assert ran.code == 8
    assert "put #3 into velocity mode" in ran.err
    assert servo[3].memory["operating_mode"] == 0
    assert put(run, servo, "velocity").document["mode"] == "velocity"
    servo[3].power_cycle()
    assert servo[3].memory["operating_mode"] == 1


@pytest.mark.parametrize(
    ("name", "words", "code"),
    [
        ("hls", "step", 2),
        ("hls", "pwm", 2),
        ("sts", "current", 2),
        ("sts", "position --low 1", 2),
        ("sts", "--low 1 --high 2", 2),
        ("sts", "--dry-run", 2),
        ("scs", "velocity", 2),
        ("sts", "sideways", 2),
    ],
)
def test_what_a_servo_has_not_is_refused(name: str, words: str, code: int, run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model=MODELS[name]) as servo:
        before = bytes(servo[3].memory.live)
        ran = run("feetech", "mode", f"{servo.url}#3", *words.split(), "--yes")
        assert ran.code == code, ran.err
        assert bytes(servo[3].memory.live)[:56] == before[:56]


def test_an_scs_becomes_a_motor_and_a_servo_again(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model="scs0009") as servo:
        assert put(run, servo, "pwm").document["mode"] == "pwm"
        ran = run("feetech", "mode", f"{servo.url}#3", "position", "--yes")
        assert ran.code == 2
        assert "expected: --low and --high, in rad; shipped are 0.1023 to 5.129" in ran.err
        assert "limits=" not in ran.err
        words = ["position", "--low", "20deg", "--high", "280deg", "--yes", "--json"]
        assert run("feetech", "mode", f"{servo.url}#3", *words).document["mode"] == "position"
        assert servo[3].memory["min_position_limit"] == 68


def test_what_turns_without_end_needs_consent(run: Run, servo: Simulation) -> None:
    put(run, servo, "velocity")
    assert run("torque", "on", f"{servo.url}#3").code == 0
    ran = run("feetech", "drive", f"{servo.url}#3", "velocity=30rpm")
    assert ran.code == 8
    assert "turn without end" in ran.err
    assert servo[3].memory["goal_velocity"] == 0
    document = run("feetech", "drive", f"{servo.url}#3", "velocity=30rpm", "--yes", "--json").document
    assert (document["schema"], document["order"]) == ("motorbus.feetech.drive/1", "velocity")
    assert (document["value"], document["blockers"]) == (pytest.approx(3.1416, abs=1e-4), [])
    assert servo[3].memory["goal_velocity"] == 2048
    assert run("feetech", "drive", f"{servo.url}#3", "velocity=0").code == 0
    assert servo[3].memory["goal_velocity"] == 0


def test_an_order_that_cannot_work_says_which_setting_blocks_it(run: Run, servo: Simulation) -> None:
    put(run, servo, "velocity")
    ran = run("feetech", "drive", f"{servo.url}#3", "velocity=-1", "--yes")
    assert ran.code == 1
    assert "took the order velocity=-1, and will not obey it: its torque is off" in ran.err
    assert "give the order again, for torque comes on at rest" in ran.err
    assert servo[3].memory["goal_velocity"] != 0
    assert run("torque", "on", f"{servo.url}#3").code == 0
    assert servo[3].memory["goal_velocity"] == 0


@pytest.mark.parametrize(
    ("mode", "order", "row", "raw"),
    [("pwm", "duty=20%", "goal_time", 200), ("velocity", "velocity=-30rpm", "goal_velocity", -2048)],
)
def test_orders_go_to_their_register(
    mode: str, order: str, row: str, raw: int, run: Run, servo: Simulation
) -> None:
    put(run, servo, mode)
    assert run("torque", "on", f"{servo.url}#3").code == 0
    assert run("feetech", "drive", f"{servo.url}#3", order, "--yes").code == 0
    assert servo[3].memory[row] == raw


def test_a_current_of_an_hls(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model="hls3925") as servo:
        put(run, servo, "current")
        assert run("torque", "on", f"{servo.url}#3").code == 0
        assert run("feetech", "drive", f"{servo.url}#3", "current=0.65", "--yes").code == 0
        assert servo[3].memory["goal_torque"] == 100


def test_a_step_goes_as_far_as_was_agreed(run: Run, servo: Simulation) -> None:
    put(run, servo, "step")
    stood = servo[3].raw_position
    assert run("feetech", "drive", f"{servo.url}#3", "step=400deg").code == 8
    ran = run("feetech", "drive", f"{servo.url}#3", "step=45deg", "--velocity", "2")
    assert (ran.code, ran.err) == (0, "")
    assert servo[3].raw_position == pytest.approx(stood + 512, abs=2)
    ran = run("feetech", "drive", f"{servo.url}#3", "step=-45deg", "--dry-run", "--json")
    (frame,) = ran.document["withheld"]
    assert "goal_position -512" in frame["meaning"]
    assert servo[3].raw_position == pytest.approx(stood + 512, abs=2)


@pytest.mark.parametrize(
    ("order", "code"),
    [
        ("velocity=1", 2),  # not in position mode
        ("step=1", 2),
        ("duty=2 --yes", 8),
        ("duty=nan", 2),
        ("speed=1", 2),
        ("velocity", 2),
        ("velocity=", 2),
        ("velocity=1kg", 2),
        ("duty=1% --acceleration 1", 2),
    ],
)
def test_an_order_that_is_impossible_changes_nothing(
    order: str, code: int, run: Run, servo: Simulation
) -> None:
    before = bytes(servo[3].memory.live)
    ran = run("feetech", "drive", f"{servo.url}#3", *order.split())
    assert (ran.code, ran.out) == (code, ""), ran.err
    assert bytes(servo[3].memory.live)[:56] == before[:56]


def test_only_servos_of_this_family(run: Run) -> None:
    assert run("feetech", "mode", "kst:sim,ids=3#3").code == 2
