"""`motorbus feetech mode`, `recover-overload` and `reset`, and what events of this family print."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import motorbus
from motorbus.core.steps import Progress
from motorbus.families.feetech import ReadsAlone, ScanWarning, Skipped
from motorbus.families.feetech.cli import say
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Ran, Run
from tests.cli.feetech.models import MODELS


@pytest.fixture
def servo() -> Iterator[Simulation]:
    """One simulated STS3215, 3."""
    with motorbus.simulate("feetech", ids="3") as simulation:
        yield simulation


def set_mode(run: Run, servo: Simulation, *words: str) -> Ran:
    ran = run("feetech", "mode", f"{servo.url}#3", *words, "--yes", "--json")
    assert ran.code == 0, ran.err
    return ran


# -- mode ------------------------------------------------------------------------------------------------------


def test_mode_shows_what_keeps_it_from_moving(run: Run, servo: Simulation) -> None:
    document = run("feetech", "mode", f"{servo.url}#3", "--json").document
    assert (document["schema"], document["id"]) == ("motorbus.feetech.mode/1", 3)
    assert document["mode"] == "position"
    assert any("torque" in one for one in document["blocked"])
    assert run("torque", "on", f"{servo.url}#3").code == 0
    assert run("feetech", "mode", f"{servo.url}#3", "--json").document["blocked"] == []
    servo[3].memory["torque_limit"] = 0
    assert "blocked: " in run("feetech", "mode", f"{servo.url}#3").out


def test_another_mode_needs_consent_and_is_kept(run: Run, servo: Simulation) -> None:
    ran = run("feetech", "mode", f"{servo.url}#3", "velocity")
    assert ran.code == 8
    assert "set velocity mode" in ran.err
    assert servo[3].memory["operating_mode"] == 0
    assert set_mode(run, servo, "velocity").document["mode"] == "velocity"
    servo[3].power_cycle()
    assert servo[3].memory["operating_mode"] == 1


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("hls", "step"),
        ("hls", "pwm"),
        ("sts", "current"),
        ("sts", "position --low 1"),
        ("sts", "--low 1 --high 2"),
        ("sts", "--dry-run"),
        ("scs", "velocity"),
        ("sts", "sideways"),
    ],
)
def test_an_impossible_mode_is_refused(name: str, words: str, run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model=MODELS[name]) as servo:
        before = bytes(servo[3].memory.live)
        ran = run("feetech", "mode", f"{servo.url}#3", *words.split(), "--yes")
        assert ran.code == 2, ran.err
        assert bytes(servo[3].memory.live)[:56] == before[:56]


def test_an_scs_becomes_a_motor_and_a_servo_again(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model="scs0009") as servo:
        assert set_mode(run, servo, "pwm").document["mode"] == "pwm"
        ran = run("feetech", "mode", f"{servo.url}#3", "position", "--yes")
        assert ran.code == 2
        assert "--low and --high" in ran.err
        assert "limits=" not in ran.err
        words = ["position", "--low", "20deg", "--high", "280deg"]
        assert set_mode(run, servo, *words).document["mode"] == "position"
        assert servo[3].memory["min_position_limit"] == 68


def test_only_servos_of_this_family(run: Run) -> None:
    assert run("feetech", "mode", "kst:sim,ids=3#3").code == 2


# -- recover-overload, reset -----------------------------------------------------------------------------------


def test_nothing_to_recover_from(run: Run, servo: Simulation) -> None:
    bus = f"{servo.url}#3"
    assert "no overload" in run("feetech", "recover-overload", bus).out
    document = run("feetech", "recover-overload", bus, "--json").document
    assert (document["tripped"], document["remaining"]) == ([], [])
    servo[3].voltage = 12.1
    assert "warning: voltage: supply 12.1 V above limit 8.0 V" in run("feetech", "recover-overload", bus).out


def test_an_overload_is_recovered_or_needs_a_power_cycle(run: Run) -> None:
    for clears, code in (("torque_off", 0), ("power_cycle", 7)):
        with motorbus.simulate("feetech", ids="3", overload_clears=clears) as servo:
            bus, real = f"{servo.url}#3", servo[3]
            assert run("torque", "on", bus).code == 0
            real.block_shaft((3.13, 3.15))
            assert run("move", f"{bus}=200deg").code == 1
            assert run("monitor", bus, "--count", "20").code == 0  # four seconds more
            assert "`motorbus feetech recover-overload`" in run("feetech", "mode", bus).out
            ran = run("feetech", "recover-overload", bus, "--dry-run")
            assert "torque_enable 0 (off)" in ran.out
            ran = run("feetech", "recover-overload", bus)
            assert ran.code == code
            if code:
                assert "switch its supply off and on" in ran.err
            else:
                assert "the alarm overload is gone" in ran.out
            assert real.memory["torque_enable"] == (0 if code else 1)


def test_reset_needs_consent_and_says_where_the_servo_is(run: Run, arm: Simulation) -> None:
    assert run("write", f"{arm.url}#3", "max_temperature=60", "--yes").code == 0
    assert run("feetech", "reset", f"{arm.url}#3").code == 8
    assert arm[3].memory["max_temperature"] == 60
    document = run("feetech", "reset", f"{arm.url}#3", "--yes", "--json").document
    assert (document["id"], document["found"], document["baud"]) == (3, 3, 1_000_000)
    assert arm[3].memory["max_temperature"] == 70
    assert arm[1].memory["max_temperature"] == 70


# -- events ----------------------------------------------------------------------------------------------------


def test_events_in_words() -> None:
    assert say(ScanWarning(3, 1_000_000, "two")) == "#3 at 1000000 bit/s: two"
    assert say(Skipped(76_800, "no such rate")) == "nothing was sent at 76800 bit/s: no such rate"
    assert say(ReadsAlone(3)).startswith("#3 answers READ and not SYNC READ")
    assert say(Progress(1, 2)) == ""


def test_a_scan_reports_two_servos_with_one_id(run: Run) -> None:
    with motorbus.simulate("feetech", ids=(3, 4), duplicate="3") as simulation:
        document = run("scan", simulation.url, "--ids", "1-5", "--json").document
    assert [one["id"] for one in document["devices"]] == [3, 4]
    assert "#3 at 1000000 bit/s" in document["notes"][0]
