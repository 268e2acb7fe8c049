"""A profile from a file, or what is assumed of all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from motorbus.cli.stepper.profiles import how_of
from motorbus.errors import RequestError
from motorbus.families.stepper import Behaviour
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE


def test_without_one_it_is_as_assumed() -> None:
    assert how_of(None) == Behaviour()


def test_what_is_settled_holds(tmp_path: Path) -> None:
    path = tmp_path / "ours.toml"
    path.write_text('format = 1\n[settled]\nramp_tick_ms = 10.0\nseg_loop = "extra"\n', encoding="utf-8")
    assert how_of(path) == Behaviour(ramp_tick_ms=10.0, seg_loop="extra")


@pytest.mark.parametrize("text", ["format = 9", "format = 1\n[settled]\nramp = 'fast'\n", "=", None])
def test_what_is_none_is_refused_with_its_name(text: str | None, tmp_path: Path) -> None:
    path = tmp_path / "ours.toml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(RequestError) as caught:
        how_of(path)
    assert "ours.toml" in caught.value.summary


def seconds(document: Any) -> float:
    """What an estimate says it takes."""
    estimate = document["estimate"] if "estimate" in document else document["estimates"][0]
    return float(estimate["seconds"])


@pytest.mark.parametrize("command", ["estimate", "show"])
@pytest.mark.parametrize(
    ("text", "more", "band"),
    [
        ('ramp = "pulse"', [], False),
        ('ramp = "time"\nramp_tick_ms = 1.0', [], False),
        ('ramp = "time"', [], True),
        ('seg_loop = "total"', [], True),
        ('ramp = "pulse"', ["--ramp", "time"], True),
    ],
)
def test_a_settled_acceleration_leaves_no_band(
    text: str, more: list[str], band: bool, command: str, tmp_path: Path, run: Run
) -> None:
    path = tmp_path / "ours.toml"
    path.write_text(f"format = 1\n[settled]\n{text}\n", encoding="utf-8")
    ran = run("stepper", command, EXAMPLE, "--profile", str(path), *more)
    assert ran.code == 0, ran.err
    assert ("if the acceleration is meant otherwise" in ran.out) == band
    assert ("the acceleration is meant as ours.toml says" in ran.out) != band


def test_estimates_take_it_and_a_switch_goes_before_it(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "ours.toml"
    path.write_text('format = 1\n[settled]\nseg_loop = "extra"\nramp = "pulse"\n', encoding="utf-8")

    def said(command: str, *flags: str) -> Any:
        return run("stepper", command, EXAMPLE, *flags, "--json").document

    profile = ("--profile", str(path))
    flags = ("--ramp", "pulse", "--seg-loop", "extra")
    assert said("order", *profile) == said("order", *flags) != said("order")
    for command in ("estimate", "show"):
        assert seconds(said(command, *profile)) == seconds(said(command, *flags)) != seconds(said(command))
    assert said("order", *profile, "--seg-loop", "total") == said("order")
    assert run("stepper", "check", EXAMPLE, *profile).code == 0
    assert run("stepper", "check", EXAMPLE, "--profile", "not-there.toml").code == 2
