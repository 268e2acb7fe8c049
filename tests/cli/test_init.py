"""The first machine file: what is asked, what is written, and that nothing is written where it should not be."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from motorbus.core.request import Data
from motorbus.motion.machine import Machine
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_each_device_becomes_an_axis(arm: Simulation, run: Run, here: Path) -> None:
    ran = run("init", f"arm={arm.url}#1-4", "kst:sim,ids=0x25", "stepper:sim", "--json")
    assert ran.code == 0, ran.err
    made = Machine.load(here / "motorbus.toml")
    assert list(made.buses) == ["arm", "kst", "stepper"]
    assert list(made.axes) == ["arm_1", "arm_2", "arm_3", "kst_37", "stepper_1"]
    told = ran.document
    assert (told["schema"], told["simulated"], told["file"]) == ("motorbus.init/1", True, "motorbus.toml")
    assert [one["device"] for one in told["axes"]] == [spec.device for spec in made.axes.values()]
    assert made.axes["kst_37"].device == "kst#0x25"


def test_the_file_says_what_each_device_is_and_what_is_missing(run: Run, here: Path) -> None:
    assert run("init", "stepper:sim", "feetech:sim#1", "--name", "bench").code == 0
    text = (here / "motorbus.toml").read_text(encoding="utf-8")
    assert 'name = "bench"' in text
    assert "# STS3215, firmware 3.10\n[axis.feetech_1]" in text
    assert re.search(
        r"# stepper controller.*\n# It has no limits.*\n# It does not know.*\n.*\n\[axis.stepper_1\]", text
    )
    assert text.startswith("# Simulated devices were asked.")
    assert "# it is never led faster" in text


def test_a_file_that_is_there_is_kept_unless_somebody_insists(run: Run, here: Path) -> None:
    (here / "motorbus.toml").write_text("mine", encoding="utf-8")
    ran = run("init", "feetech:sim", "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert "is there already" in ran.err
    assert " tx " not in ran.err
    assert (here / "motorbus.toml").read_text(encoding="utf-8") == "mine"
    ran = run("init", "feetech:sim#1", "--force")
    assert (ran.code, "nothing of it is kept" in ran.err) == (0, True)
    assert list(Machine.load(here / "motorbus.toml").axes) == ["feetech_1"]


def test_nothing_is_written_to_any_device(arm: Simulation, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[int] = []
    receive = arm.simulator.receive

    def overheard(data: Data, at: float) -> None:
        assert isinstance(data, bytes)
        heard.append(data[4])
        receive(data, at)

    monkeypatch.setattr(arm.simulator, "receive", overheard)
    assert run("init", f"{arm.url}#1-3").code == 0
    ping, read = 1, 2
    assert set(heard) == {ping, read}


def test_where_nobody_answers_there_is_no_file(run: Run, here: Path) -> None:
    ran = run("init", "feetech:sim,ids=1#1", "feetech:sim,ids=2#7")
    assert (ran.code, ran.out) == (5, "")
    assert list(here.iterdir()) == []


def test_without_a_bus_it_shows_what_to_type(run: Run, monkeypatch: pytest.MonkeyPatch, here: Path) -> None:
    monkeypatch.setattr("motorbus.link.serial.ports", list)
    ran = run("init")
    assert ran.code == 2
    assert "no serial port found" in ran.err
    assert "motorbus init feetech:/dev/ttyACM0" in ran.err
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("arm", 2),
        ("nobody:/dev/ttyACM0", 2),
        ("Arm=feetech:sim", 2),
        ("1arm=feetech:sim", 2),
        ("=feetech:sim", 2),
        (f"{'a' * 26}=feetech:sim", 2),
        ("arm=feetech:sim arm=kst:sim", 2),
        ("arm=feetech:sim arm_1=kst:sim", 2),
        ("feetech:sim feetech:sim", 2),
        ("feetech:sim,colour=red", 2),
        ("feetech:sim#254", 2),
        ("feetech:sim --baud fast", 2),
        ("feetech:sim --output nowhere/bench.toml", 2),
        ("feetech:sim --output .", 2),
        ("feetech:/dev/no-such-port", 3),
        ("feetech:/dev/null", 3),
        ("kst:can://slcan/dev/null", 3),
        ("feetech:sim#1 feetech:/dev/no-such-port", 3),
        ("feetech:sim --dry-run", 2),
    ],
)
def test_what_cannot_be_is_refused_and_no_file_is_written(
    words: str, code: int, run: Run, here: Path
) -> None:
    ran = run("init", *words.split())
    assert (ran.code, ran.out) == (code, ""), ran.err
    assert ran.err.count("error: ") == 1
    assert list(here.iterdir()) == []
