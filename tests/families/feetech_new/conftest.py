"""The family under its future name, until the switch."""

from __future__ import annotations

import sys

import pytest

import motorbus
import motorbus.families.feetech_new as new


@pytest.fixture(autouse=True)
def _named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "motorbus.families.feetech", new)
    monkeypatch.setattr(motorbus, "feetech", new, raising=False)
