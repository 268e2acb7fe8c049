"""A program over a real pseudo-terminal to a simulator in a process of its own, its bytes taking the time of 9600 baud.

What is asserted are bytes and counts. How long it takes on a real clock is measured by `make bench`; in virtual time
it is asserted by `tests/families/stepper/test_round_trip.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from motorbus.families.stepper import Program
from motorbus.families.stepper.program.backups import Backup
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.support.processes import Simulated


@pytest.fixture
def bus(tmp_path: Path, state_folder: Path) -> Iterator[str]:
    """A controller whose line is paced; its address."""
    with Simulated("stepper", link=tmp_path / "bus", pace=True) as simulated:
        yield simulated.bus


def test_file_write_save_backup_diff(bus: str, tmp_path: Path, run: Run) -> None:
    kept = tmp_path / "kept.toml"
    assert run("stepper", "diff", EXAMPLE, bus).code == 1
    written = run("stepper", "write", EXAMPLE, bus, "--yes", "--json")
    assert written.code == 0, written.err
    assert written.document["saved"] is True
    assert run("stepper", "backup", bus, str(kept)).code == 0
    same = run("stepper", "diff", EXAMPLE, bus, "--json")
    assert same.code == 0, same.out
    assert same.document["changes"] == []
    assert Backup.parse(kept.read_text(encoding="utf-8")).program(2).project == Program.load(EXAMPLE).project


def test_one_number_is_three_commands_and_four_dumps(bus: str, tmp_path: Path, run: Run) -> None:
    assert run("stepper", "write", EXAMPLE, bus, "--yes").code == 0
    edited = tmp_path / "edited.toml"
    text = Path(EXAMPLE).read_text(encoding="utf-8")
    assert text.count('delay = "300 ms"') == 1
    edited.write_text(text.replace('delay = "300 ms"', 'delay = "350 ms"'), encoding="utf-8")
    shown = run("stepper", "diff", str(edited), bus, "--json").document
    written = run("stepper", "write", str(edited), bus, "--yes", "--json").document
    assert (shown["cost"]["writes"], shown["cost"]["reads"]) == (3, 4)
    assert (written["commands"], written["dumps"]) == (3, 4)
    assert [change["name"] for change in shown["changes"]] == ["step_5_delay"]
