"""The demo: it finds, moves and draws six simulated devices, and never forgets to say that they are."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import pytest

from motorbus.cli import demo
from tests.cli.conftest import Run

pytestmark = pytest.mark.usefixtures("state_folder")


def test_it_finds_moves_reads_back_and_draws(run: Run, tmp_path: Path) -> None:
    picture = tmp_path / "demo.png"
    ran = run("demo", "--output", str(picture), "--duration", "1.5", "--json")
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
    ran = run("demo", "--output", str(tmp_path / "demo.svg"), "--duration", "1", "--ids", "1-2")
    assert ran.code == 0
    assert ran.out.count("STS3215") == 2
    assert "the wire allows" in ran.out
    assert "simulated" in ran.out
    assert "simulated" in ran.err
    assert (tmp_path / "demo.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_without_matplotlib_it_goes_on(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    ran = run("demo", "--output", str(tmp_path / "demo.png"), "--duration", "1", "--ids", "1-2")
    assert ran.code == 0
    assert "pip install 'motorbus[plot]'" in ran.err
    assert list(tmp_path.glob("*.png")) == []


@pytest.mark.parametrize("words", [["--duration", "0"], ["--duration", "nan"], ["--ids", "x"]], ids=" ".join)
def test_what_is_no_order_ends_with_2(words: list[str], run: Run) -> None:
    assert run("demo", *words).code == 2


def test_a_family_with_nothing_to_show_is_refused(run: Run) -> None:
    ran = run("demo", "--family", "kst")
    assert (ran.code, ran.out) == (2, "")
    assert "feetech, stepper" in ran.err


def test_the_wave_starts_and_ends_at_rest_and_is_smooth() -> None:
    step = 0.001
    wave = [demo.wave(number * step, 6.0, 0.3) for number in range(6001)]
    assert wave[0] == wave[-1] == 0
    assert max(map(abs, wave)) <= demo.AMPLITUDE
    speeds = [abs(after - before) / step for before, after in pairwise(wave)]
    assert speeds[0] < 0.01
    assert speeds[-1] < 0.01
    assert max(speeds) < 4.0
