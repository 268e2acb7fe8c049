"""A new id from the shell: for servos that take it at once, and for those that want a power cycle; and refusals."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def wear(arm: Simulation) -> int:
    return sum(servo.memory.wear.total() for servo in arm.simulator.servos)  # type: ignore[attr-defined]


def test_it_says_how_the_servo_is_addressed_now(run: Run, arm: Simulation) -> None:
    ran = run("set-id", f"{arm.url}#3", "7", "--yes")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == f"simulated\n#3 is #7 now: {arm.url}#7\n"
    assert run("ping", f"{arm.url}#7").code == 0


def test_for_programs(run: Run, arm: Simulation) -> None:
    assert run("set-id", f"{arm.url}#3", "0x10", "--yes", "--json").document == {
        "schema": "motorbus.set-id/1",
        "simulated": True,
        "id": 3,
        "new": 16,
        "address": f"{arm.url}#16",
    }


def test_it_is_asked_before_and_nobody_there_to_agree_is_8(run: Run, arm: Simulation) -> None:
    ran = run("set-id", f"{arm.url}#3", "7")
    assert ran.code == 8
    assert "give #3 the id 7 for good" in ran.err
    assert wear(arm) == 0


def test_what_is_refused_is_refused_before_anybody_is_asked(run: Run, arm: Simulation) -> None:
    ran = run("set-id", f"{arm.url}#3", "2")
    assert ran.code == 2
    assert "the id 2 is taken" in ran.err


def test_a_dry_run_shows_the_whole_sequence(run: Run, arm: Simulation) -> None:
    ran = run("set-id", f"{arm.url}#3", "7", "--dry-run", "--json")
    meanings = [one["meaning"] for one in ran.document["withheld"]]
    assert [meaning.split("; ")[0] for meaning in meanings] == ["WRITE to servo 3"] * 3
    words = ("lock 0", "torque_enable 0", "id 7")
    assert [word for word, meaning in zip(words, meanings, strict=True) if word not in meaning] == []
    assert "as far as it can be foreseen" in ran.err  # the servo has another id from here on
    assert wear(arm) == 0


def test_two_on_one_id_are_refused(run: Run) -> None:
    with motorbus.simulate("feetech", ids=(3,), duplicate="3") as simulation:
        ran = run("set-id", f"{simulation.url}#3", "7", "--yes")
        assert ran.code == 2
        assert "two servos seem to have the id 3" in ran.err
        assert wear(simulation) == 0


@pytest.mark.parametrize("words", ["BUS#3 254", "BUS#3 seven", "BUS#3 -1", "BUS 7", "BUS#1-3 7", "BUS#3"])
def test_what_is_no_request(words: str, run: Run, arm: Simulation) -> None:
    ran = run("set-id", *words.replace("BUS", arm.url).split(), "--yes", "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert " tx " not in ran.err


def test_an_option_that_a_family_lacks_is_no_request(run: Run, arm: Simulation) -> None:
    assert run("set-id", f"{arm.url}#3", "7", "--yes", "--timeout", "1s").code == 2


def test_a_family_whose_devices_have_no_such_verb(run: Run) -> None:
    assert run("set-id", "nobody:sim#1", "2").code == 2


def test_a_kst_servo_is_provisioned(run: Run) -> None:
    with motorbus.simulate("kst", ids="37") as simulation:
        words = ["set-id", f"{simulation.url}#37", "39", "--yes", "--timeout", "1s"]
        ran = run(*words)
        assert ran.code == 1
        assert "switch the supply of this servo off and on again now" in ran.err
        simulation[37].power_cycle()
        ran = run(*words)
        assert ran.code == 0, ran.err
        assert f"#37 (0x25) is #39 (0x27) now: {simulation.url}#39" in ran.out


def test_a_dry_run_of_a_kst_servo_goes_as_far_as_it_can_be_foreseen(run: Run) -> None:
    with motorbus.simulate("kst", ids="37") as simulation:
        ran = run("set-id", f"{simulation.url}#37", "39", "--dry-run")
    assert ran.code == 0
    assert "write node_id = 39" in ran.out
    assert "as far as it can be foreseen" in ran.err
