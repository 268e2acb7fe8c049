"""Every test of links has a state folder of its own, so that locks of one never meet those of another."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from motorbus.link import can_slcan
from motorbus.simulation.pty import PtyMaster


@pytest.fixture(autouse=True)
def state_home(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Short, because a local socket must fit into it."""
    with tempfile.TemporaryDirectory(prefix="mb-", dir="/tmp") as folder:
        monkeypatch.setenv("XDG_STATE_HOME", folder)
        yield Path(folder)


@pytest.fixture(autouse=True)
def no_can_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    """What whoever runs the tests has configured for python-can is none of their business."""
    monkeypatch.setattr(can.util, "CONFIG_FILES", [])
    for name in [name for name in os.environ if name.startswith("CAN_")]:
        monkeypatch.delenv(name)


@pytest.fixture
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine under load must not pass for a mute adapter."""
    monkeypatch.setattr(can_slcan, "LISTENING", 10.0)
    monkeypatch.setattr(can_slcan, "PATIENCE", 10.0)


@pytest.fixture
def master() -> Iterator[PtyMaster]:
    """A real pseudo-terminal."""
    terminal = PtyMaster()
    yield terminal
    terminal.close()
