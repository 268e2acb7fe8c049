"""Tests use folders of their own for state, configuration and cache, also in child processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from motorbus.link import lock


def test_state_configuration_and_cache_are_temporary(user_folders: Path, tmp_path: Path) -> None:
    base = tmp_path.parent  # the folder that pytest made for this run
    assert user_folders.is_relative_to(base)
    for name in ("XDG_STATE_HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        assert Path(os.environ[name]).is_relative_to(user_folders)
    assert lock.state_folder().is_relative_to(user_folders)


def test_a_child_process_uses_the_same_state_folder(user_folders: Path) -> None:
    code = "from motorbus.link import lock; print(lock.state_folder())"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert Path(printed.strip()).is_relative_to(user_folders)
