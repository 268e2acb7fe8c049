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


def test_estimates_take_it_and_a_switch_goes_before_it(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "ours.toml"
    path.write_text('format = 1\n[settled]\nseg_loop = "extra"\nramp = "pulse"\n', encoding="utf-8")

    def said(command: str, *flags: str) -> Any:
        return run("stepper", command, EXAMPLE, *flags, "--json").document

    profile = ("--profile", str(path))
    flags = ("--ramp", "pulse", "--seg-loop", "extra")
    for command in ("order", "estimate", "show"):
        assert said(command, *profile) == said(command, *flags) != said(command)
    assert said("order", *profile, "--seg-loop", "total") == said("order")
    assert run("stepper", "check", EXAMPLE, *profile).code == 0
    assert run("stepper", "check", EXAMPLE, "--profile", "not-there.toml").code == 2
