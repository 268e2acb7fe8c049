"""No test of a fault passes while its fault is switched off: each asserts that it has happened.

All of them are run once more, in a process of its own, where no line, no plug, no supply and no interruption does any
harm; whatever passes there proves nothing and has to say why it may, by the mark `faultless`. Those that are named by
a row and stand with what they try are among them. What is left out stands with its reason in
`scripts/tests_told.py`, and so on the page docs/reliability.md.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

from scripts import tests_told
from tests.conftest import Figures

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
OTHERS = ("tests/families/stepper/test_faults.py", "tests/families/stepper/test_single_faults.py")
"""Tests of faults that stand with their family, and have no row in their names."""
USUAL = 3
"""Every so many-th file is judged with every commit, and all of them in the long runs."""


def judged() -> list[str]:
    """All tests of faults: whole files, and those of others that are named by a row."""
    whole = [f"tests/faults/{file.name}" for file in HERE.glob("test_*.py") if file != Path(__file__)]
    return sorted([*whole, *OTHERS]) + sorted(set(elsewhere()))


def elsewhere() -> Iterator[str]:
    """Those outside this folder that are named by a row."""
    for row, tests in tests_told.of_rows().items():
        for test in tests:
            file = test.partition("::")[0]
            if (
                not file.startswith("tests/faults/")
                and row not in tests_told.NO_FAULTS
                and file not in tests_told.PROCESSES
            ):
                yield test


@pytest.mark.faultless("this is where it is judged")
@pytest.mark.timeout(900)
@pytest.mark.parametrize("every", [USUAL, pytest.param(1, marks=pytest.mark.soak)], ids=["a third", "all"])
def test_no_test_of_a_fault_passes_without_its_fault(every: int, tmp_path: Path, figures: Figures) -> None:
    report = tmp_path / "report.xml"
    flags = ("--faults-off", "-q", "--tb=no", "-m", "not faultless", "-p", "no:cacheprovider")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *flags, f"--junit-xml={report}", *judged()[::every]],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stdout[-2000:]
    cases = list(ElementTree.parse(report).iter("testcase"))
    names = {case: f"{case.get('classname')}::{case.get('name')}" for case in cases}
    failed = {
        name
        for case, name in names.items()
        if any(case.find(how) is not None for how in ("failure", "error"))
    }
    passed = {*names.values()} - failed
    figures(
        "tests of faults that pass with their fault switched off",
        promise=7,
        tests=len({*names.values()}),
        passed=len(passed),
    )
    assert passed == set()
    assert len(cases) > 50


@pytest.mark.faultless("it is about which are judged")
def test_what_is_left_out_is_there() -> None:
    """A file that has gone, or a row that has no test, is no reason."""
    rows = tests_told.of_rows()
    files = {test.partition("::")[0] for tests in rows.values() for test in tests}
    assert files >= set(tests_told.PROCESSES)
    assert rows.keys() >= tests_told.NO_FAULTS.keys()
