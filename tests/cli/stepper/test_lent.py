"""While project 1 is lent to a motion that was cut off, nothing is set and nothing kept that giving it back undoes."""

from __future__ import annotations

from pathlib import Path

import pytest

import motorbus
from motorbus.core.steps import INTENT, JournalEntry
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line


@pytest.fixture
def lent(line: Line) -> Line:
    """A controller whose project 1 somebody has borrowed, and not given back."""
    facts = {
        "node": 1,
        "what": "the borrow of project 1 (for jog)",
        "image": line.simulation[1].store.image(1).hex(),
        "order": "little",
        "wanted": {"step_1_speed": 60},
    }
    with motorbus.open(line.url) as bus:
        assert bus.journal is not None
        bus.journal(JournalEntry("jog", INTENT, facts))
    return line


@pytest.mark.parametrize(
    "words",
    [
        "set-step-delay BUS --step 1 --delay 1s",
        "set-step-delay BUS --step 1 --delay 1s --project 1",
        "set-power-on-home BUS --power-on-home on --yes",
        "select-project BUS --project 1",
        "select-project BUS --project 1 --total-steps 1",
        "save-project BUS --project 1 --yes",
        "clear-project BUS --project 2 --yes",
    ],
)
def test_nothing_is_set_and_recover_is_named(words: str, run: Run, lent: Line) -> None:
    ran = run("stepper", *words.replace("BUS", lent.url).split())
    assert ran.code == 2, ran.out
    assert "motorbus recover" in ran.err
    assert lent.orders() == []


def test_what_is_lent_is_not_kept_as_a_backup(run: Run, lent: Line, tmp_path: Path) -> None:
    file = tmp_path / "controller.toml"
    ran = run("stepper", "backup", lent.url, str(file))
    assert ran.code == 2, ran.out
    assert "motorbus recover" in ran.err
    assert not file.exists()


def test_a_stop_is_never_refused(run: Run, lent: Line) -> None:
    assert run("stepper", "stop-motor", lent.url).code == 0
