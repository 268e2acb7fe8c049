"""The parameters of a project by their names: each written by the common command, kept, and read again."""

from __future__ import annotations

import pytest

from motorbus.families.stepper.table import TABLE
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line

WRITTEN = [name for name, row in TABLE.items() if row.writable and not row.protected]
REFUSED = [name for name, row in TABLE.items() if not row.writable or row.protected]
LOOP = {"loop_first": 1, "loop_last": 1, "loop_count": 3}
"""Three numbers of one command, of which the first two make a range only together."""


def other(name: str) -> dict[str, int]:
    """Raw values that are possible and not those of a controller as shipped."""
    if name in LOOP:
        return LOOP
    if name.endswith(("_direction", "stop_mode")):
        return {name: 0 if name == "step_1_direction" else 1}
    return {name: 2 if name.endswith(("_input", "_output")) else 7}


@pytest.mark.parametrize("name", WRITTEN)
def test_every_parameter_is_written_by_its_name_and_kept(name: str, run: Run, line: Line) -> None:
    wanted = other(name)
    words = [f"{one}={raw}raw" for one, raw in wanted.items()]
    ran = run("write", f"{line.url}#1", *words, "--yes")
    assert (ran.code, ran.err) == (0, "")
    line.simulation[1].power_cycle()
    read = run("read", f"{line.url}#1", *wanted, "--json").document["registers"]
    assert {one["name"]: one["raw"] for one in read} == wanted


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_set_otherwise_is_refused_by_name(name: str, run: Run, line: Line) -> None:
    ran = run("write", f"{line.url}#1", f"{name}=1raw", "--yes")
    assert (ran.code, line.orders()) == (2, [])


def test_it_asks_before_it_is_for_good(run: Run, line: Line) -> None:
    assert run("write", f"{line.url}#1", "step_1_delay=2s").code == 8
    assert line.orders() == []
