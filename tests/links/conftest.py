"""Every test of links has its own state folder, and so its own locks."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from motorbus.link import slcan
from motorbus.simulation.pty import PtyMaster


@pytest.fixture(autouse=True)
def state_home(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Short, because a local socket must fit into it."""
    with tempfile.TemporaryDirectory(prefix="mb-", dir="/tmp") as folder:
        monkeypatch.setenv("XDG_STATE_HOME", folder)
        yield Path(folder)


@pytest.fixture(autouse=True)
def no_can_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    """The user's own configuration of python-can does not apply."""
    monkeypatch.setattr(can.util, "CONFIG_FILES", [])
    for name in [name for name in os.environ if name.startswith("CAN_")]:
        monkeypatch.delenv(name)


@pytest.fixture
def long_timeouts(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine an adapter that replies late must not look silent."""
    monkeypatch.setattr(slcan, "FIRST_REPLY", 10.0)
    monkeypatch.setattr(slcan, "REPLY_TIME", 10.0)


@pytest.fixture
def master() -> Iterator[PtyMaster]:
    """A real pseudo-terminal."""
    terminal = PtyMaster()
    yield terminal
    terminal.close()
