"""The generated reference pages are the ones that the tables in the code give today."""

from __future__ import annotations

from types import ModuleType

import pytest

from scripts import feetech_registers, machine_file


@pytest.mark.parametrize("script", [machine_file, feetech_registers], ids=lambda one: one.__name__)
def test_page_is_current(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", [script.__name__, "--check"])
    assert script.main() == 0, f"run python -m {script.__name__}"
