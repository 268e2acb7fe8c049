"""Every test of links has a state folder of its own, so that locks of one never meet those of another."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from motorbus.link.pty import PtyMaster


@pytest.fixture(autouse=True)
def state_home(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Short, because a local socket must fit into it."""
    with tempfile.TemporaryDirectory(prefix="mb-", dir="/tmp") as folder:
        monkeypatch.setenv("XDG_STATE_HOME", folder)
        yield Path(folder)


@pytest.fixture
def master() -> Iterator[PtyMaster]:
    """A real pseudo-terminal."""
    terminal = PtyMaster()
    yield terminal
    terminal.close()
