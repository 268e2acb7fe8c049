"""A simulated bus as a child: ready when it says so, gone when it is left, and loud when it cannot start."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.cli.simulated import Simulated
from motorbus.errors import MotorbusError


def test_it_is_ready_inside_and_gone_afterwards(tmp_path: Path) -> None:
    link = tmp_path / "bus"
    with Simulated("feetech", ids="1-2", link=link) as simulated:
        assert simulated.bus == f"feetech:{link}"
        assert simulated.buses == [simulated.bus]
        assert simulated.ready["ids"] == [1, 2]
        assert link.is_symlink()
        assert simulated.process.poll() is None
    assert simulated.process.returncode == 0
    assert not link.is_symlink()


def test_what_it_complained_about_is_told(tmp_path: Path) -> None:
    with (
        pytest.raises(MotorbusError, match="no simulated FEETECH model 'abacus'"),
        Simulated("feetech", link=tmp_path / "bus", model="abacus"),
    ):
        pass
    assert list(tmp_path.iterdir()) == []
