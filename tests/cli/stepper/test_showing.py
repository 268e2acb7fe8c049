"""The demonstration of this family: a real pseudo-terminal, a project written, run, and its end heard."""

from __future__ import annotations

import pytest

from motorbus.cli.stepper.showing import program
from tests.cli.conftest import Run

pytestmark = pytest.mark.usefixtures("state_folder")


def test_it_writes_runs(run: Run) -> None:
    ran = run("demo", "--family", "stepper", "--duration", "1", "--json")
    assert ran.code == 0, ran.err
    assert (ran.document["outcome"], ran.document["simulated"]) == ("completed", True)
    assert ran.document["seconds"] == pytest.approx(ran.document["predicted"]["seconds"], rel=0.1)


def test_it_takes_about_as_long_as_was_asked_for() -> None:
    once = program(1.0).estimate().seconds
    assert program(4 * once).estimate().seconds == pytest.approx(4 * once)
    assert not [finding for finding in program(10.0).lint() if finding.level == "error"]
