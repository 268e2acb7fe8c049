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
    assert "torque_limit is 0: `motorbus write BUS#ID torque_limit=1.0`" in said


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


def test_only_servos_of_this_family(run: Run) -> None:
    assert run("feetech", "mode", "kst:sim,ids=3#3").code == 2
