"""A new rate from the shell, for one device, for some, for all; how they are addressed then; and refusals."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus.cli import identity
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def rates(arm: Simulation) -> list[int]:
    return [servo.baud_rate for servo in arm.simulator.servos]  # type: ignore[attr-defined]


def test_one_servo(run: Run, arm: Simulation) -> None:
    ran = run("set-baud", f"{arm.url}#3", "500k", "--yes")
    assert (ran.code, ran.err) == (0, "")
    assert f"#3 speaks at 500000 bit/s now: {arm.url},baud=500000#3" in ran.out
    assert rates(arm) == [1_000_000, 1_000_000, 500_000]
    assert run("ping", f"{arm.url},baud=500000#3").code == 0


def test_the_whole_bus(run: Run, arm: Simulation) -> None:
    document = run("set-baud", arm.url, "115200", "--yes", "--json").document
    assert document["ids"] == [1, 2, 3]
    assert document["address"] == f"{arm.url},baud=115200"
    assert rates(arm) == [115_200] * 3
    assert run("set-baud", f"{arm.url},baud=115200", "1M", "--yes").out.endswith(f"now: {arm.url}#1+2+3\n")


def test_some_are_changed_and_the_rest_is_named(run: Run) -> None:
    with motorbus.simulate("feetech", ids="1+2", model="scs0009+sts3215") as simulation:
        ran = run("set-baud", f"{simulation.url}#1+2", "19200", "--yes", "--json")
        assert ran.code == 6
        assert "no code for 19200" in ran.err
        assert ran.document["ids"] == [1]


def test_when_none_is_changed_the_first_reason_is_told(run: Run, arm: Simulation) -> None:
    ran = run("set-baud", f"{arm.url}#1+2", "19200", "--yes")
    assert (ran.code, ran.out) == (2, "")
    assert "node 1 has the map sts, which has no code for 19200" in ran.err


def test_it_is_asked_before_and_a_dry_run_asks_nobody(run: Run, arm: Simulation) -> None:
    ran = run("set-baud", f"{arm.url}#1+2", "500000")
    assert ran.code == 8
    assert "let #1, #2 speak at 500000 bit/s for good" in ran.err
    shown = run("set-baud", f"{arm.url}#1+2", "500000", "--dry-run", "--json")
    assert len(shown.document["withheld"]) == 6
    assert rates(arm) == [1_000_000] * 3


@pytest.mark.parametrize("words", ["BUS#3 fast", "BUS#3 28800", "BUS#254 1M", "BUS#3 500k --timeout 1s"])
def test_what_is_no_request(words: str, run: Run, arm: Simulation) -> None:
    ran = run("set-baud", *words.replace("BUS", arm.url).split(), "--yes")
    assert (ran.code, ran.out) == (2, "")
    assert rates(arm) == [1_000_000] * 3


def test_nobody_is_5(run: Run, arm: Simulation) -> None:
    assert run("set-baud", f"{arm.url},baud=500000", "1M", "--yes").code == 5


def test_a_kst_servo_is_provisioned(run: Run) -> None:
    with motorbus.simulate("kst", ids="37") as simulation:
        words = ["set-baud", simulation.url, "1M", "--yes", "--timeout", "1s"]
        assert run(*words).code == 1
        simulation[37].power_cycle()
        ran = run(*words[:1], f"{simulation.url}#37", *words[2:])
        assert ran.code == 0, ran.err
        assert f"{simulation.url},bitrate=1000000#37" in ran.out


def test_a_dry_run_of_a_kst_servo_shows_what_is_written_and_sees_who_else_is_there(run: Run) -> None:
    with motorbus.simulate("kst", ids="37") as simulation:
        ran = run("set-baud", f"{simulation.url}#37", "1M", "--dry-run")
    assert ran.code == 0
    assert "write bit_rate_code = 7" in ran.out
    with motorbus.simulate("kst", ids="37-38") as simulation:
        ran = run("set-baud", f"{simulation.url}#37", "1M", "--dry-run")
    assert ran.code == 2
    assert "is not alone" in ran.err


def test_ctrl_c_in_the_middle_of_several_says_who_is_done(
    run: Run, arm: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    carried_out, begun = identity.carried_out, list[int]()

    def interrupted(bus: Any, node: int, *args: Any, **more: Any) -> Any:
        begun.append(node)
        if len(begun) == 3:
            raise KeyboardInterrupt
        return carried_out(bus, node, *args, **more)

    monkeypatch.setattr("motorbus.cli.set_baud.carried_out", interrupted)
    ran = run("set-baud", arm.url, "500000", "--yes")
    assert ran.code == 10
    assert f"done before that: {arm.url},baud=500000#1+2" in ran.err
    assert sorted(rates(arm)) == [500_000, 500_000, 1_000_000]
