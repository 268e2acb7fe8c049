"""Every test of links has a state folder of its own, so that locks of one never meet those of another."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from motorbus.link.pty import PtyMaster


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def master() -> Iterator[PtyMaster]:
    """A real pseudo-terminal."""
    terminal = PtyMaster()
    yield terminal
    terminal.close()
