"""The wave of one bus: its devices are found, moved in a loop and drawn, and never without the word simulated."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import pytest

from motorbus.cli import wave
from motorbus.cli.output import Output
from motorbus.errors import RequestError
from tests.cli.conftest import Run

pytestmark = pytest.mark.usefixtures("state_folder")

WAVE = ("demo", "--family", "feetech")


def test_it_finds_moves_reads_back_and_draws(run: Run, tmp_path: Path) -> None:
    picture = tmp_path / "demo.png"
    ran = run(*WAVE, "--output", str(picture), "--duration", "1.5", "--json")
    assert ran.code == 0, ran.err
    told = ran.document
    assert told["simulated"] is True
    assert [one["id"] for one in told["devices"]] == [1, 2, 3, 4, 5, 6]
    assert told["cycles"] > 1
    assert told["wire_limit"] == pytest.approx(1136, rel=0.01)
    assert told["cycles_per_second"] < told["wire_limit"]
    assert told["picture"] == str(picture)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_it_tells_a_person_what_it_did(run: Run, tmp_path: Path) -> None:
    ran = run(*WAVE, "--output", str(tmp_path / "demo.svg"), "--duration", "1", "--ids", "1-2")
    assert ran.code == 0
    assert ran.out.count("STS3215") == 2
    assert "the wire allows" in ran.out
    assert "simulated" in ran.out
    assert "simulated" in ran.err
    assert (tmp_path / "demo.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_without_matplotlib_it_goes_on(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    ran = run(*WAVE, "--output", str(tmp_path / "demo.png"), "--duration", "1", "--ids", "1-2")
    assert ran.code == 0
    assert "pip install 'motorbus[plot]'" in ran.err
    assert list(tmp_path.glob("*.png")) == []


def test_ids_that_are_none_end_with_2(run: Run) -> None:
    assert run(*WAVE, "--ids", "x").code == 2


def test_there_is_no_wave_of_what_cannot_be_led(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="no loop to show"):
        wave.waved("stepper", "1", 1.0, tmp_path / "x.png", Output())
    assert list(tmp_path.glob("*.png")) == []


def test_the_wave_starts_and_ends_at_rest_and_is_smooth() -> None:
    step = 0.001
    heights = [wave.wave(number * step, 6.0, 0.3) for number in range(6001)]
    assert heights[0] == heights[-1] == 0
    assert max(map(abs, heights)) <= wave.AMPLITUDE
    speeds = [abs(after - before) / step for before, after in pairwise(heights)]
    assert speeds[0] < 0.01
    assert speeds[-1] < 0.01
    assert max(speeds) < 4.0
