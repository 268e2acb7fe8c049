"""Which other process has a port open, from the real /proc."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from motorbus.link.port_users import find_user
from motorbus.simulation.pty import PtyMaster
from tests.links.other import other_process

HOLD = """
import os, sys
held = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
print("ready", flush=True)
sys.stdin.read()
"""
SERVE = """
import os, sys
from motorbus.simulation.pty import PtyMaster
terminal = PtyMaster()
terminal.symlink(sys.argv[1])
print("ready", flush=True)
sys.stdin.read()
"""


def test_an_unused_port(master: PtyMaster) -> None:
    assert find_user(master.slave_name) is None


def test_a_program_without_any_lock_is_found(master: PtyMaster) -> None:
    with other_process(HOLD, master.slave_name) as process:
        owner = find_user(master.slave_name)
        assert owner is not None
        assert (owner.pid, owner.port) == (process.pid, master.slave_name)
        assert owner.program.startswith("python")
    assert find_user(master.slave_name) is None


def test_a_script_is_named_by_its_file(master: PtyMaster, tmp_path: Path) -> None:
    proc = tmp_path / "proc"
    (proc / "77" / "fd").mkdir(parents=True)
    (proc / "77" / "fd" / "3").symlink_to(master.slave_name)
    (proc / "77" / "cmdline").write_bytes(b"/usr/bin/python3\0/opt/arm/teleop.py\0--fast\0")
    assert find_user(master.slave_name, proc) == (77, "teleop.py", master.slave_name)


def test_the_simulator_behind_a_pseudo_terminal_is_not_its_user(tmp_path: Path) -> None:
    with other_process(SERVE, str(tmp_path / "arm")):
        device = os.path.realpath(tmp_path / "arm")
        assert device.startswith("/dev/pts/")
        assert find_user(device) is None
        with other_process(HOLD, device) as user:
            owner = find_user(device)
            assert owner is not None
            assert owner.pid == user.pid


@pytest.mark.parametrize(("theirs", "is_found"), [("/dev/zero", False), ("/dev/null", True)])
def test_the_same_name_in_a_container_is_another_device(
    theirs: str, is_found: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    descriptors = tmp_path / "proc" / "77" / "fd"
    descriptors.mkdir(parents=True)
    (tmp_path / "tty").symlink_to("/dev/null")
    (descriptors / "tty").symlink_to(theirs)
    (descriptors / "3").symlink_to("tty")
    assert (find_user("tty", tmp_path / "proc") is not None) is is_found


@pytest.mark.parametrize("gone", ["no such folder", "."])
def test_without_proc_no_program_is_found(gone: str, master: PtyMaster, tmp_path: Path) -> None:
    (tmp_path / "78").mkdir()
    assert find_user(master.slave_name, tmp_path / gone) is None
