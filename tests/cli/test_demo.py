"""The demo: nine axes on three buses in processes of their own move as one, and are drawn with goal and present."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from motorbus.cli.nine import AXES, PARTS, REACH
from tests.cli.conftest import Run

pytestmark = pytest.mark.usefixtures("state_folder")


def test_nine_axes_in_three_processes_move_as_one_and_are_drawn(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import matplotlib as mpl

    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    picture = tmp_path / "demo.svg"
    ran = run("demo", "--output", str(picture), "--duration", "4", "--json")
    assert ran.code == 0, ran.err
    told = ran.document
    assert told["simulated"] is True
    _judge_the_machine(told)
    for movement, goals in zip(told["movements"], (REACH, dict.fromkeys(AXES, 0.0)), strict=True):
        _judge_a_movement(movement, goals)
    _judge_the_picture(picture.read_text(encoding="utf-8"))


def _judge_the_machine(told: Any) -> None:
    assert {one["device"] for one in told["axes"].values()} == {
        *(f"arm#{node}" for node in range(1, 7)),
        "gimbal#0x25",
        "gimbal#0x26",
        "stage#1",
    }
    addresses = {name: one["address"] for name, one in told["buses"].items()}
    assert addresses["arm"].startswith("feetech:/")
    assert addresses["gimbal"].startswith("kst:can://slcan/")
    assert addresses["stage"].startswith("stepper:/")
    assert len({one["pid"] for one in told["buses"].values()}) == 3


def _judge_a_movement(movement: Any, goals: dict[str, float]) -> None:
    axes = movement["axes"]
    assert list(axes) == [name for name in goals if name in axes]
    assert set(axes) == set(AXES)
    for name, one in axes.items():
        assert one["goal"] == pytest.approx(goals[name])
        assert one["present"] == pytest.approx(goals[name], abs=0.02 if name != "slide" else 1e-4)
        assert one["estimated"] is (name == "slide")
        assert one["samples"] > 20
        assert one["worst_error"] > 0
    assert movement["duration"] == pytest.approx(2.0, rel=0.02)


def _judge_the_picture(text: str) -> None:
    """Nine panels, each with its unit, the key to goal and present, and the words simulated and estimated."""
    said = re.findall(r">([^<>]+)</text>", text)
    assert [one for one in said if one.endswith("(deg)")] == [
        f"{name} (deg)" for name in AXES if name != "slide"
    ]
    for word in (
        "slide (mm), estimated",
        "goal",
        "present",
        "simulated",
        "estimated: reckoned, not measured",
    ):
        assert word in said
    assert any(one.startswith("9 axes on 3 buses move as one") for one in said)


@pytest.mark.parametrize(
    "words",
    [
        ["--duration", "0"],
        ["--duration", "nan"],
        ["--duration", "3"],
        ["--duration", "61"],
        ["--family", "kst", "--duration", "0.5"],
        ["--output", "no/such/folder.png"],
        ["--output", "picture.txt"],
        ["--output", "."],
        ["--ids", "1-3"],
        ["--family", "nobody"],
    ],
    ids=" ".join,
)
def test_what_is_no_order_ends_with_2_and_nothing_is_started(words: list[str], run: Run) -> None:
    ran = run("demo", *words)
    assert (ran.code, ran.out) == (2, "")
    assert "in process" not in ran.err


def test_a_family_has_its_own_demo(run: Run, tmp_path: Path) -> None:
    ran = run(
        "demo", "--family", "kst", "--ids", "1-2", "--duration", "1", "--output", str(tmp_path / "k.png")
    )
    assert ran.code == 0, ran.err
    assert "the wire allows" in ran.out
    assert (tmp_path / "k.png").read_bytes().startswith(b"\x89PNG")


def test_the_machine_has_six_two_and_one() -> None:
    assert [part.ids for part in PARTS.values()] == ["1-6", "0x25-0x26", "1"]
    assert len(AXES) == 9
