"""What was found out about a controller, printed and kept; and what would be tried, without trying it."""

from __future__ import annotations

from pathlib import Path

import pytest

import motorbus
from motorbus.families.stepper.program.profile import Profile
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line, line_of

pytestmark = pytest.mark.usefixtures("state_folder")


def test_what_is_found_is_a_file_that_run_takes(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "ours.toml"
    with motorbus.simulate("stepper", ramp="pulse", seg_loop="extra") as simulation:
        line = line_of(simulation, monkeypatch)
        before = dict(simulation[1].store.stored)
        ran = run("stepper", "characterise", line.url, str(path), "--yes", "--json")
        assert ran.code == 0, ran.err
        assert simulation[1].store.stored == before, "nothing is saved"
        assert "save_project" not in line.orders()
        again = run("stepper", "run", line.url, "--project", "1", "--yes", "--profile", str(path))
        assert again.code == 0
    found = Profile.load(str(path))
    assert dict(found.settled) == ran.document["settled"]
    assert (found.settled["ramp"], found.settled["seg_loop"]) == ("pulse", "extra")
    assert "ramp: " in ran.err, "each experiment is told before it begins"


def test_it_asks_before_the_motor_turns_and_before_a_file_is_replaced(
    run: Run, line: Line, tmp_path: Path
) -> None:
    path = tmp_path / "ours.toml"
    ran = run("stepper", "characterise", line.url, str(path))
    assert ran.code == 8
    assert "by up to 1 turns each way" in ran.err
    assert not path.exists()
    path.write_text("mine", encoding="utf-8")
    assert run("stepper", "characterise", line.url, str(path)).code == 8
    assert path.read_text(encoding="utf-8") == "mine"
    assert line.orders() == []


def test_a_plan_sends_nothing(run: Run) -> None:
    ran = run("stepper", "characterise", "stepper:/dev/not-there", "--plan", "--json")
    names = [one["name"] for one in ran.document["experiments"]]
    assert (ran.code, names[-1]) == (0, "ramp")


@pytest.mark.parametrize(
    "words", ["BUS --scratch 5", "BUS --scratch 0", "BUS --travel 0.1", "BUS --travel nan", "kst:sim", ""]
)
def test_bad_input_sends_nothing(words: str, run: Run, line: Line) -> None:
    ran = run("stepper", "characterise", *words.replace("BUS", line.url).split(), "--yes")
    assert (ran.code, ran.out) == (2, "")
    assert line.heard == []
