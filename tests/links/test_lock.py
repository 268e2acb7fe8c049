"""A port has one owner, which others can name; the lock of a dead process is free."""

from __future__ import annotations

import fcntl
import os
import signal
import stat
from pathlib import Path

import pytest

from motorbus.errors import LinkError, PortBusy
from motorbus.link.lock import PortLock, holders, is_simulated, program_name, state_folder
from tests.links.other import other_process, run

PORT = "/dev/ttyACM7"
HOLD = """
import sys
from motorbus.link.lock import PortLock
held = PortLock(sys.argv[1]).acquire()
print("ready", flush=True)
sys.stdin.read()
"""


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_one_device_has_one_name_whatever_leads_to_it(tmp_path: Path) -> None:
    (tmp_path / "device").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "device")
    assert PortLock(str(tmp_path / "by-id")).path == PortLock(str(tmp_path / "device")).path


def test_the_file_is_private_and_tells_its_owner() -> None:
    with PortLock(PORT) as held:
        assert mode(held.path) == 0o600
        owner = held.owner()
        assert owner == (os.getpid(), program_name(), PORT)
        assert PortLock(PORT).owner() == owner
    held.release()
    assert not held.path.exists()
    assert held.owner() is None
    with PortLock(PORT):
        pass


def test_l13_the_error_names_the_process_of_the_owner() -> None:
    with other_process(HOLD, PORT) as process:
        with pytest.raises(PortBusy, match=rf"process {process.pid} \(python") as caught:
            PortLock(PORT).acquire()
        assert caught.value.owner == process.pid
        assert [owner.port for owner in holders()] == [PORT]


def test_l13_the_lock_of_a_killed_process_is_reclaimed() -> None:
    with other_process(HOLD, PORT) as process:
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=30)
        assert PortLock(PORT).path.exists()
        assert PortLock(PORT).owner() is None
        with PortLock(PORT) as mine:
            assert mine.owner() == (os.getpid(), program_name(), PORT)


def test_a_file_that_is_left_over_is_no_owner() -> None:
    port = PortLock("/dev/ttyACM8")
    port.path.write_text('{"pid": 999999999, "program": "x", "port": "y"}')
    with PortLock(PORT), PortLock("socket://bridge:4000"):
        assert sorted(owner.port for owner in holders()) == [PORT, "socket://bridge:4000"]
    assert holders() == []
    with port.path.open("rb") as looked_at:  # two that look at a lock do not see each other
        fcntl.flock(looked_at, fcntl.LOCK_SH)
        assert port.owner() is None
        assert not is_simulated("/dev/ttyACM8")


FORK = """
import os
from motorbus.link.lock import PortLock
held = PortLock("port").acquire()
child = os.fork()
if not child:
    held.release()
    os._exit(0)
os.waitpid(child, 0)
print(held.owner().pid == os.getpid())
"""


def test_a_forked_child_leaves_the_lock_to_its_parent() -> None:
    assert run(FORK).strip() == "True"


def test_d9_the_state_folder_is_private_and_a_link_of_another_user_changes_no_mode(
    state_home: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (state_home / "motorbus").mkdir(mode=0o755)
    assert mode(state_folder()) == 0o700
    mine = tmp_path / "mine"
    mine.mkdir(mode=0o755)
    (tmp_path / "motorbus").symlink_to(mine)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(os, "getuid", lambda: (tmp_path / "motorbus").lstat().st_uid + 1)
    with pytest.raises(LinkError, match="belongs to another user"):
        state_folder()
    assert mode(mine) == 0o755
