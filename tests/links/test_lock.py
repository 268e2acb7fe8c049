"""Port locks: one owner, named; the dead own nothing; sockets beside them have short names."""

from __future__ import annotations

import os
import signal
import stat
import sys
from pathlib import Path

import pytest

from motorbus.errors import LinkError, PortBusy
from motorbus.link import lock
from motorbus.link.lock import PortLock, holders, is_alive, program_name, real_name, socket_path, state_folder
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


# -- the folder -------------------------------------------------------------------------------------------------


def test_the_state_folder_is_private(state_home: Path) -> None:
    assert state_folder() == state_home / "motorbus"
    assert mode(state_folder()) == 0o700


def test_a_folder_that_others_could_read_is_closed(state_home: Path) -> None:
    (state_home / "motorbus").mkdir(parents=True)
    (state_home / "motorbus").chmod(0o755)
    assert mode(state_folder()) == 0o700


@pytest.mark.parametrize("value", [None, "", "relative/folder"])
def test_without_a_usable_setting_it_lies_in_the_home_folder(
    value: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_STATE_HOME")
    if value is not None:
        monkeypatch.setenv("XDG_STATE_HOME", value)
    assert state_folder() == tmp_path / ".local" / "state" / "motorbus"


def test_a_folder_that_cannot_be_is_an_error_that_helps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    with pytest.raises(LinkError, match="XDG_STATE_HOME"):
        state_folder()


# -- names ------------------------------------------------------------------------------------------------------


def test_one_device_has_one_name_whatever_leads_to_it(tmp_path: Path) -> None:
    (tmp_path / "device").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "device")
    assert PortLock(str(tmp_path / "by-id")).path == PortLock(str(tmp_path / "device")).path


def test_hosts_are_compared_without_case() -> None:
    assert real_name("socket://Bridge:4000/") == real_name("socket://bridge:4000")
    assert real_name("socket://localhost:4000") == real_name("socket://127.0.0.1:4000")
    assert real_name("can://socketcand/localhost:4/can0") == real_name("can://socketcand/127.0.0.1:4/can0")
    assert real_name("socket://localhost.lan:4000") == "socket://localhost.lan:4000"


def test_different_ports_have_different_files() -> None:
    names = [PORT, "/dev/ttyACM8", "socket://bridge:4000", "socket://bridge:4001", "/dev/tty-ACM7"]
    assert len({PortLock(name).path for name in names}) == len(names)


def test_a_fork_leaves_the_lock_to_its_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    with PortLock(PORT) as held:
        child = PortLock(PORT)
        child._descriptor, child._pid = os.dup(held._descriptor or 0), os.getpid()
        monkeypatch.setattr(os, "getpid", lambda: 1)
        child.release()
        monkeypatch.undo()
        owner = held.owner()
        assert owner is not None
        assert owner.pid == os.getpid()


def test_the_socket_lies_beside_the_lock() -> None:
    assert socket_path(PORT).parent == PortLock(PORT).path.parent
    assert socket_path(PORT) != PortLock(PORT).path


def test_a_long_state_folder_does_not_make_the_socket_unusable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / ("x" * 100)))
    monkeypatch.setattr("tempfile.tempdir", "/tmp")
    path = socket_path(PORT)
    assert len(os.fsencode(path)) <= lock.SOCKET_LIMIT
    assert mode(path.parent) == 0o700
    assert path == socket_path(PORT) != socket_path("/dev/ttyACM8")


def test_a_short_folder_that_others_can_enter_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / ("x" * 100)))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / f"motorbus-{os.getuid()}").mkdir()
    (tmp_path / f"motorbus-{os.getuid()}").chmod(0o777)
    with pytest.raises(LinkError, match="others may enter it"):
        socket_path(PORT)


# -- the lock ---------------------------------------------------------------------------------------------------


def test_the_file_is_private_and_tells_its_owner() -> None:
    with PortLock(PORT) as held:
        assert mode(held.path) == 0o600
        owner = held.owner()
        assert owner == (os.getpid(), program_name(), PORT)
        assert PortLock(PORT).owner() == owner


def test_a_second_one_in_this_process_is_refused() -> None:
    with PortLock(PORT), pytest.raises(PortBusy, match="this very program") as caught:
        PortLock(PORT).acquire()
    assert caught.value.owner == os.getpid()


def test_l13_the_error_names_the_process_of_the_owner() -> None:
    with other_process(HOLD, PORT) as process:
        with pytest.raises(PortBusy, match=rf"process {process.pid} \(python") as caught:
            PortLock(PORT).acquire()
        assert caught.value.owner == process.pid
        assert [owner.port for owner in holders()] == [PORT]


def test_released_it_is_free_and_leaves_nothing() -> None:
    held = PortLock(PORT).acquire()
    held.release()
    held.release()
    assert not held.path.exists()
    assert held.owner() is None
    with PortLock(PORT):
        pass


def test_l13_the_lock_of_a_killed_process_is_reclaimed() -> None:
    with other_process(HOLD, PORT) as process:
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=30)
        assert PortLock(PORT).path.exists()
        assert PortLock(PORT).owner() is None
        with PortLock(PORT) as mine:
            assert mine.owner() == (os.getpid(), program_name(), PORT)


def test_a_file_of_a_living_process_that_holds_nothing_is_no_lock() -> None:
    held = PortLock(PORT)
    held.path.write_text(f'{{"pid": {os.getpid()}, "program": "x", "port": "{PORT}"}}')
    assert held.owner() is None
    with held:
        pass


def test_an_unreadable_file_is_no_lock() -> None:
    PortLock(PORT).path.write_bytes(b"\xff not json")
    assert PortLock(PORT).owner() is None
    with PortLock(PORT) as held:
        assert held.owner() is not None


def test_an_owner_that_never_signs_still_keeps_others_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lock, "TRIES", 2)
    with PortLock(PORT) as held:
        held.path.write_bytes(b"")
        with pytest.raises(PortBusy, match="another program") as caught:
            PortLock(PORT).acquire()
        assert caught.value.owner is None


def test_holders_lists_the_living_only() -> None:
    with PortLock(PORT), PortLock("socket://bridge:4000"):
        PortLock("/dev/ttyACM8").path.write_text('{"pid": 999999999, "program": "x", "port": "y"}')
        assert sorted(owner.port for owner in holders()) == [PORT, "socket://bridge:4000"]
    assert holders() == []


# -- where there is no flock ------------------------------------------------------------------------------------

WITHOUT_FLOCK = """
import os, sys
sys.modules["fcntl"] = None
from motorbus.errors import PortBusy
from motorbus.link.lock import PortLock
dead = PortLock("dead")
dead.path.write_text('{"pid": 999999999, "program": "x", "port": "dead"}')
with dead, PortLock("port") as held:
    try:
        PortLock("port").acquire()
    except PortBusy as error:
        print(error.owner == os.getpid() == held.owner().pid)
print(held.owner() is None, held.path.exists())
PortLock("port").acquire()
"""


def test_without_flock_the_file_is_the_lock() -> None:
    assert run(WITHOUT_FLOCK).split() == ["True", "True", "False"]


# -- small things -----------------------------------------------------------------------------------------------


def test_who_is_alive() -> None:
    assert is_alive(os.getpid())
    assert is_alive(1)
    assert not is_alive(999_999_999)


@pytest.mark.parametrize(
    ("first", "name"),
    [
        ("/usr/bin/motorbus", "motorbus"),
        ("/x/motorbus/__main__.py", "motorbus"),
        ("-c", Path(sys.executable).name),
    ],
)
def test_what_a_program_calls_itself(first: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [first])
    assert program_name() == name
