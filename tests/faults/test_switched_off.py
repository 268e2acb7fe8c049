"""No test of a fault passes while its fault is switched off: each asserts that it has happened.

All of them are run once more, in a process of its own, where no line, no plug, no supply and no interruption does any
harm; whatever passes there proves nothing and has to say why it may, by the mark `faultless`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.conftest import Figures, Rounds

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
OTHERS = ("tests/families/stepper/test_faults.py", "tests/families/stepper/test_single_faults.py")
"""Tests of faults that stand with their family."""


@pytest.mark.faultless("this is where it is judged")
@pytest.mark.timeout(600)
def test_no_test_of_a_fault_passes_without_its_fault(
    tmp_path: Path, rounds: Rounds, figures: Figures
) -> None:
    report = tmp_path / "report.xml"
    flags = ("--faults-off", "-q", "-m", "not faultless", "-p", "no:cacheprovider", f"--junit-xml={report}")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *flags, str(HERE), *OTHERS],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stdout[-2000:]
    cases = list(ElementTree.parse(report).iter("testcase"))
    passed = [
        f"{case.get('classname')}::{case.get('name')}" for case in cases if case.find("failure") is None
    ]
    assert passed == []
    assert len(cases) > 50
    assert rounds(len(cases)) <= len(cases)  # asks how often, and so is among the long runs too
    figures(
        "tests of faults that pass with their fault switched off",
        promise=7,
        tests=len(cases),
        passed=len(passed),
    )
