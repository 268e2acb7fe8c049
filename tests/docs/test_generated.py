"""The generated reference pages are the ones that the tables in the code give today."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

from motorbus.families.kst import Servo
from scripts import api_reference, feetech_registers, kst_reference, machine_file, stepper_reference


@pytest.mark.parametrize(
    "script",
    [api_reference, machine_file, feetech_registers, kst_reference, stepper_reference],
    ids=lambda one: one.__name__,
)
def test_page_is_current(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", [script.__name__, "--check"])
    assert script.main() == 0, f"run python -m {script.__name__}"


def test_kst_page_names_methods_and_tests_that_exist() -> None:
    methods = {word for row in kst_reference.COMMANDS for word in re.findall(r"`([a-z_]+)`", row[3])}
    assert len(methods) == 8
    assert all(hasattr(Servo, name) for name in methods)
    files = (kst_reference.MANUAL_TESTS, kst_reference.ERRATA_TESTS, kst_reference.DECODE_TESTS)
    defined = {
        name for file in files for name in re.findall(r"def (test_\w+)", Path(file).read_text("utf-8"))
    }
    named = set(re.findall(r"\btest_\w+(?=`)", kst_reference.page()))
    assert len(named) > 30
    assert named - defined == set()
