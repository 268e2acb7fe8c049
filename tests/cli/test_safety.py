"""`motorbus safety`: what is guaranteed of a machine, from its file alone; nothing is opened and nothing is sent."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.core.request import Data
from tests.cli.conftest import Bench, Run
from tests.support.machines import listened, said

STRANGE = (
    'format = 1\n[bus.arm]\naddress = "feetech:/dev/not-there"\n[axis.one]\ndevice = "arm#1"\nunit = "deg"\n'
)
BOUNDS = 'max_velocity = "90 deg/s"\nmax_acceleration = "360 deg/s2"\n'


def test_a_person_reads_the_scope_the_bounds_the_devices_and_the_whole(bench: Bench, run: Run) -> None:
    ran = run("safety")
    assert ran.code == 0, ran.err
    assert "not a safety function" in " ".join(ran.out.split())
    lines = [line.split() for line in ran.out.splitlines()]
    assert ["a1", "-150", "to", "150", "deg", "90", "deg/s", "0.9", "deg", "hold", "torque", "off"] in lines
    for title in ("arm, feetech (a1, a2, a3)", "can, kst (c1)", "stage, stepper (lift)", ", as a whole"):
        assert title in ran.out
    assert "watchdog in it" in ran.out
    assert "max_step bounds it" in ran.err


def test_a_program_reads_the_same(bench: Bench, run: Run) -> None:
    told = run("safety", "motorbus.toml", "--json").document
    assert told["schema"] == "motorbus.safety/1"
    assert told["file"] == "./motorbus.toml"
    assert told["axes"]["lift"]["left"] == "its move"
    assert told["buses"]["arm"]["points"]["torque switch"]["given"] == "yes"
    assert told["buses"]["can"]["axes"] == ["c1"]
    assert told["machine"]["several hosts"]["given"] == "no"
    assert "IEC 61508" in told["scope"]


def test_nothing_is_sent_to_anybody(bench: Bench, run: Run) -> None:
    listened(bench.simulations)
    heard: list[Data] = []
    for sim in bench.simulations.values():
        sim.simulator.receive = lambda data, at: heard.append(data)  # type: ignore[method-assign]
    assert run("safety").code == 0
    assert (heard, said(bench.simulations)) == ([], [])


def test_a_port_that_is_not_there_is_not_needed(tmp_path: Path, run: Run) -> None:
    file = tmp_path / "strange.toml"
    file.write_text(STRANGE + BOUNDS, encoding="utf-8")
    ran = run("safety", str(file))
    assert ran.code == 0, ran.err
    assert "its device's" in ran.out


def test_largest_steps_have_a_column_once_somebody_has_one(bench: Bench, run: Run) -> None:
    assert "max step" not in run("safety").out
    text = bench.file.read_text(encoding="utf-8").replace("[axis.a2]", '[axis.a2]\nmax_step = "10 deg"', 1)
    bench.file.write_text(text, encoding="utf-8")
    ran = run("safety")
    assert "max step" in ran.out
    assert "a1, a3, c1, lift: one order" in ran.err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["not-there.toml"], "not-there.toml"),
        (["feetech:sim"], "is an address"),
        (["motorbus.toml", "more"], "more"),
        (["--machine", "not-there.toml"], "not-there.toml"),
    ],
)
def test_what_is_no_machine_file_is_one_error(bench: Bench, run: Run, words: list[str], told: str) -> None:
    ran = run("safety", *words)
    assert (ran.code, ran.out) == (2, "")
    assert told in ran.err
    assert ran.err.count("error:") == 1


def test_a_file_with_a_mistake_says_where(bench: Bench, run: Run) -> None:
    bench.describe('[axis.more]\ndevice = "nowhere#9"\n')
    ran = run("safety")
    assert (ran.code, ran.out) == (2, "")
    assert "axis.more" in ran.err


def test_without_any_file_it_says_where_it_looked(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = run("safety")
    assert ran.code == 2
    assert "there is no machine file" in ran.err


def test_what_cannot_be_opened_is_not_vouched_for(bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8").replace("[axis.c1]", '[axis.c1]\nestop = "torque_off"', 1)
    bench.file.write_text(text, encoding="utf-8")
    ran = run("safety")
    assert (ran.code, ran.out) == (2, "")
    assert "c1" in ran.err
