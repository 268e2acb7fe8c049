"""The simulator's end of a pseudo-terminal, against plain descriptors of a client."""

from __future__ import annotations

import os
import termios
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from motorbus.errors import LinkError, RequestError
from motorbus.link.stream import wait_any
from motorbus.simulation.pty import PtyMaster
from tests.links.other import run

ALL_BYTES = bytes(range(256))


@pytest.fixture
def master() -> Iterator[PtyMaster]:
    """A real pseudo-terminal."""
    terminal = PtyMaster()
    yield terminal
    terminal.close()


def client(name: str) -> int:
    descriptor = os.open(name, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(descriptor)
    return descriptor


def test_every_byte_passes_both_ways(master: PtyMaster) -> None:
    descriptor = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
    assert master.write(ALL_BYTES) == 256
    assert os.read(descriptor, 1000) == ALL_BYTES
    os.write(descriptor, ALL_BYTES)
    assert wait_any((master.fileno(),), 10)
    assert master.read() == ALL_BYTES
    os.close(descriptor)


def test_nothing_to_read_is_no_wait(master: PtyMaster) -> None:
    assert master.read() == b""


def test_a_client_may_come_and_go(master: PtyMaster) -> None:
    for number in range(3):
        descriptor = client(master.slave_name)
        os.write(descriptor, bytes([number]))
        os.close(descriptor)
        assert wait_any((master.fileno(),), 10)
        assert master.read() == bytes([number])
    assert master.read() == b""


def test_what_nobody_reads_is_dropped_without_blocking(master: PtyMaster) -> None:
    taken = [master.write(bytes(4096)) for _ in range(100)]
    assert taken[0] > 0
    assert 0 in taken


@pytest.mark.parametrize("name", ["B9600", "B115200", "B1000000"])
def test_the_rate_of_the_client_is_seen(name: str, master: PtyMaster) -> None:
    descriptor = client(master.slave_name)
    settings = termios.tcgetattr(descriptor)
    settings[4] = settings[5] = getattr(termios, name)
    termios.tcsetattr(descriptor, termios.TCSANOW, settings)
    assert master.rate() == int(name[1:])
    os.close(descriptor)


# -- the symbolic link ------------------------------------------------------------------------------------------


def test_a_symbolic_link_leads_to_it_until_it_is_closed(master: PtyMaster, tmp_path: Path) -> None:
    master.symlink(tmp_path / "arm")
    assert os.path.realpath(tmp_path / "arm") == master.slave_name
    assert os.listdir(tmp_path) == ["arm"]
    master.close()
    master.close()
    assert os.listdir(tmp_path) == []


def test_what_a_killed_simulator_left_is_replaced(master: PtyMaster, tmp_path: Path) -> None:
    (tmp_path / "arm").symlink_to("/dev/pts/no-such-one")
    master.symlink(tmp_path / "arm")
    assert os.path.realpath(tmp_path / "arm") == master.slave_name


def test_the_same_name_twice_is_no_clash_with_itself(master: PtyMaster, tmp_path: Path) -> None:
    master.symlink(tmp_path / "arm")
    master.symlink(tmp_path / "arm")
    assert os.path.realpath(tmp_path / "arm") == master.slave_name


def test_a_living_link_is_left_alone(master: PtyMaster, tmp_path: Path) -> None:
    other = PtyMaster()
    other.symlink(tmp_path / "arm")
    with pytest.raises(RequestError, match="exists already"):
        master.symlink(tmp_path / "arm")
    other.close()
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("kind", ["file", "folder", "foreign link"])
def test_anything_else_is_left_alone(kind: str, master: PtyMaster, tmp_path: Path) -> None:
    there = tmp_path / "arm"
    if kind == "file":
        there.write_text("precious")
    elif kind == "folder":
        there.mkdir()
    else:
        there.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RequestError, match="exists already"):
        master.symlink(there)
    assert os.path.lexists(there)


def test_a_link_that_was_replaced_meanwhile_is_not_removed(master: PtyMaster, tmp_path: Path) -> None:
    master.symlink(tmp_path / "arm")
    (tmp_path / "arm").unlink()
    (tmp_path / "arm").write_text("somebody else's")
    master.close()
    assert (tmp_path / "arm").read_text() == "somebody else's"


def test_a_folder_that_does_not_exist_is_told(master: PtyMaster, tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="cannot make the symbolic link"):
        master.symlink(tmp_path / "no" / "arm")


def test_where_there_are_none_it_says_so() -> None:
    code = """
import sys
sys.modules.update(dict.fromkeys(["termios", "tty", "pty", "fcntl"]))
from motorbus.errors import LinkError
from motorbus.simulation.pty import PtyMaster
try:
    PtyMaster()
except LinkError as error:
    print(error.summary)
"""
    assert "no pseudo-terminal here" in run(code)


def test_pulled_it_hangs_up_and_comes_back_behind_the_same_name(master: PtyMaster, tmp_path: Path) -> None:
    assert "nobody would find" in master.fixed
    link = tmp_path / "arm"
    master.symlink(link)
    assert master.fixed == ""
    descriptor = client(str(link))
    master.unplug()
    assert not link.is_symlink()
    assert master.fixed == ""
    assert gone(descriptor)
    os.close(descriptor)
    master.plug()
    descriptor = client(str(link))
    assert master.write(b"xyz") == 3
    assert os.read(descriptor, 10) == b"xyz"
    os.close(descriptor)


def gone(descriptor: int) -> bool:
    try:
        return os.read(descriptor, 10) == b""
    except OSError:
        return True
