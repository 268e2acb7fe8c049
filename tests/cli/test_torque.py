"""The power stage: on without a jump, off for everyone whatever happens."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run
from tests.support.processes import Simulated


def limp(run: Run, arm: Simulation, node: int) -> bool:
    return bool(
        run("read", f"{arm.url}#{node}", "torque_enable", "--json").document["registers"][0]["raw"] == 0
    )


def test_on_and_off(run: Run, arm: Simulation) -> None:
    assert run("torque", "on", f"{arm.url}#1+2").code == 0
    assert [limp(run, arm, node) for node in (1, 2, 3)] == [False, False, True]
    assert run("torque", "off", f"{arm.url}#1").code == 0
    assert [limp(run, arm, node) for node in (1, 2, 3)] == [True, False, True]


def test_on_does_not_jump_to_the_old_goal(run: Run, arm: Simulation) -> None:
    assert run("read", f"{arm.url}#1", "goal_position", "--json").document["registers"][0]["raw"] == 0
    assert run("torque", "on", f"{arm.url}#1").code == 0
    assert run("read", f"{arm.url}#1", "goal_position", "--json").document["registers"][0]["raw"] == 2048


EVERYONE_OFF = "FF FF FE 04 03 28 00 D2"


def sent(err: str) -> list[str]:
    """The frames of a command that was run with -vv."""
    return [line.partition(" tx ")[2] for line in err.splitlines() if " tx " in line]


def test_a_whole_bus_is_switched_off_by_one_broadcast_and_nothing_else(run: Run, arm: Simulation) -> None:
    assert run("torque", "on", f"{arm.url}#1-3").code == 0
    ran = run("torque", "off", arm.url, "--json", "-vv")
    (row,) = ran.document["devices"]
    assert (ran.code, row["id"], row["done"]) == (0, None, True)
    assert "no device acknowledges a broadcast" in row["promise"]
    assert sent(ran.err) == [EVERYONE_OFF]
    assert all(limp(run, arm, node) for node in (1, 2, 3))


def test_a_bus_of_the_file_is_broadcast_first_then_its_axes_answer_or_have_their_row(
    run: Run, bench: Bench
) -> None:
    arm = bench.simulations["arm"]
    assert run("torque", "on", "a1", "a2", "a3").code == 0
    arm[2].unplug()
    for bus, first in (("arm", []), (bench.machine.buses["arm"].address, [(None, None, True)])):
        ran = run("torque", "off", bus, "--json", "-vv")
        told = [(one.get("axis"), one["id"], one["done"]) for one in ran.document["devices"]]
        assert told == [*first, ("a1", 1, True), ("a2", 2, False), ("a3", 3, True)]
        assert ran.code == 6
        frames = sent(ran.err)
        assert frames[0] == EVERYONE_OFF
        assert {frame.split()[2] for frame in frames[1:]} == {"01", "02", "03"}


def test_axes_of_a_port_by_another_path_are_told_as_well(
    run: Run, served: Simulated, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = f'format = 1\n[bus.arm]\naddress = "{served.bus}"\n[axis.a2]\ndevice = "arm#2"\n'
    Path("motorbus.toml").write_text(text, encoding="utf-8")
    family, _, port = served.bus.partition(":")
    Path("other").symlink_to(port)
    ran = run("torque", "off", f"{family}:{tmp_path / 'other'}", "--json")
    assert [(one.get("axis"), one["id"]) for one in ran.document["devices"]] == [(None, None), ("a2", 2)]


def test_a_dry_run_of_a_whole_bus_shows_the_broadcast(run: Run, arm: Simulation) -> None:
    (one,) = run("torque", "off", arm.url, "--dry-run", "--json").document["withheld"]
    assert one["data"] == EVERYONE_OFF


def test_kst_servos_have_no_torque_switch_to_broadcast_to(run: Run) -> None:
    ran = run("torque", "off", "kst:sim,ids=0x25")
    assert ran.code == 2
    assert "have no torque switch" in ran.err


def test_one_that_is_gone_does_not_keep_the_others_stiff(run: Run, arm: Simulation) -> None:
    assert run("torque", "on", f"{arm.url}#1-3").code == 0
    arm[2].unplug()
    ran = run("torque", "off", f"{arm.url}#1-3")
    assert ran.code == 6
    assert limp(run, arm, 1)
    assert limp(run, arm, 3)


@pytest.mark.parametrize("words", [["on"], ["up", "feetech:sim#1"], []], ids=" ".join)
def test_what_is_no_order_ends_with_2(words: list[str], run: Run) -> None:
    assert run("torque", *words).code == 2


def test_an_axis_gets_the_cap_of_its_file(run: Run, bench: Bench) -> None:
    text = bench.file.read_text(encoding="utf-8")
    capped = text.replace("[axis.a2]", "torque = 0.25\n[axis.a2]", 1)
    bench.file.write_text(capped, encoding="utf-8")
    ran = run("torque", "on", "a1", "--json")
    assert (ran.code, ran.document["axes"]) == (0, [{"name": "a1"}])
    registers = run("read", "a1", "torque_enable", "torque_limit", "--json").document["registers"]
    assert registers[0]["raw"] == 1
    assert registers[1]["value"] == pytest.approx(0.25)


def test_a_group_is_switched_as_far_as_it_can_be(run: Run, bench: Bench) -> None:
    assert [one["name"] for one in run("torque", "on", "all", "--json").document["axes"]] == [
        "a1",
        "a2",
        "a3",
    ]
    told = run("torque", "off", "all", "--json").document["devices"]
    assert [(one["axis"], one["done"]) for one in told] == [("a1", True), ("a2", True), ("a3", True)]
    assert run("read", "a2", "torque_enable", "--json").document["registers"][0]["raw"] == 0


def test_a_dry_run_of_an_axis_shows_its_frames(run: Run, bench: Bench) -> None:
    assert "torque_enable 1 (on)" in run("torque", "on", "a1", "--dry-run").out
    assert run("read", "a1", "torque_enable", "--json").document["registers"][0]["raw"] == 0


@pytest.mark.parametrize("words", ["on c1", "off c1", "off lift", "on a1 arm#2", "on a9"])
def test_an_axis_without_a_switch_is_refused(words: str, run: Run, bench: Bench) -> None:
    ran = run("torque", *words.split())
    assert (ran.code, ran.out, ran.err.count("error: ")) == (2, "", 1)
