"""Serial links over real pseudo-terminals."""

from __future__ import annotations

import fcntl
import os
import signal
import struct
import termios
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from types import SimpleNamespace

import pytest
import serialx

from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound, RequestError
from motorbus.link import serial, usb_adapters, wait
from motorbus.link.base import Link
from motorbus.link.lock import holders
from motorbus.link.serial import SerialLink, has_fine_clock
from motorbus.link.wait import wait_readable
from motorbus.simulation.pty import PtyMaster
from tests.links.other import other_process, run
from tests.links.usb import usb_port

PING = bytes.fromhex("ff ff 01 02 01 fb")
ALL_BYTES = bytes(range(256))
TIOCGEXCL = 0x80045440
HOLD_OPEN = """
import os, sys
held = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
print("ready", flush=True)
sys.stdin.read()
"""
HOLD_LINK = """
import sys
from motorbus.link.serial import SerialLink
held = SerialLink(sys.argv[1], rate=1_000_000)
print("ready", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def link(master: PtyMaster) -> Iterator[SerialLink]:
    opened = SerialLink(master.slave_name, rate=1_000_000)
    yield opened
    opened.close()


@pytest.fixture
def like_a_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have pseudo-terminals treated as real devices."""
    monkeypatch.setattr(usb_adapters, "PSEUDO_TERMINALS", ("no such prefix",))


def soon(link: Link) -> float:
    return link.now() + 30


def heard(master: PtyMaster, count: int) -> bytes:
    """That many bytes at the simulator's end."""
    told = b""
    while len(told) < count:
        assert wait_readable(master.fileno(), 30)
        told += master.read()
    return told


# -- bytes ------------------------------------------------------------------------------------------------------


def test_every_byte_passes_both_ways(link: SerialLink, master: PtyMaster) -> None:
    link.write(ALL_BYTES)
    assert heard(master, 256) == ALL_BYTES
    master.write(ALL_BYTES)
    assert b"".join(part for part in link.read(soon(link)) if isinstance(part, bytes)) == ALL_BYTES


def test_what_it_says_of_itself(link: SerialLink, master: PtyMaster) -> None:
    face: Link = link
    assert (face.name, face.rate, face.warnings) == (master.slave_name, 1_000_000, ())
    assert (face.paced, face.virtual, face.simulated, face.latency) == (False, False, False, 0.002)
    assert face.fileno() == link._descriptor >= 0


def test_nothing_by_the_deadline_is_nothing(link: SerialLink) -> None:
    until = link.now() + 0.002
    assert link.read(until) == []
    assert link.now() >= until


@pytest.mark.parametrize("until", [0.0, float("-inf")])
def test_a_deadline_in_the_past_never_waits(
    until: float, link: SerialLink, master: PtyMaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wait, "wait_readable", None)  # calling it would raise
    assert link.read(until) == []
    master.write(PING)
    while not (arrived := link.read(until)):
        pass
    assert arrived == [PING]


def test_a_look_where_nothing_has_come_tries_to_read_nothing(
    link: SerialLink, master: PtyMaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []
    with monkeypatch.context() as patch:
        patch.setattr(os, "read", lambda descriptor, count: tried.append(descriptor))
        assert link.read(float("-inf")) == link.read(link.now()) == []
    assert not tried
    master.write(PING)
    assert wait_readable(link.fileno() or 0, 30)
    assert link.read(float("-inf")) == [PING]


def test_a_port_that_takes_no_more_blocks_nobody(link: SerialLink) -> None:
    with pytest.raises(LinkError, match=r"takes no more bytes: \d+ of 1000000"):
        link.write(bytes(1_000_000))


def test_what_lay_in_the_port_before_it_was_opened_is_not_read(master: PtyMaster) -> None:
    master.write(b"stale")
    link = SerialLink(master.slave_name, rate=1_000_000)
    assert link.read(0.0) == []
    link.close()


# -- gone -------------------------------------------------------------------------------------------------------


def test_a_port_that_vanished_is_a_lost_link(link: SerialLink, master: PtyMaster) -> None:
    master.close()
    with pytest.raises(LinkLost, match="is gone"):
        link.read(soon(link))
    with pytest.raises(LinkLost, match="is gone"):
        link.write(PING)


def test_a_port_that_vanishes_while_one_waits_is_a_lost_link(link: SerialLink, master: PtyMaster) -> None:
    errors: list[Exception] = []

    def wait() -> None:
        try:
            link.read(soon(link))
        except LinkError as error:
            errors.append(error)

    reader = Thread(target=wait)
    reader.start()
    master.close()
    reader.join(30)
    assert [type(error) for error in errors] == [LinkLost]


def test_what_came_before_the_end_is_read_first(link: SerialLink, master: PtyMaster) -> None:
    master.write(b"last words")
    assert wait_readable(link._descriptor, 30)
    assert link.read(soon(link)) == [b"last words"]
    master.close()
    with pytest.raises(LinkLost):
        link.read(soon(link))


def test_used_after_close_it_is_lost(link: SerialLink) -> None:
    link.close()
    link.close()
    with pytest.raises(LinkLost):
        link.write(PING)
    with pytest.raises(LinkLost):
        link.read(soon(link))
    with pytest.raises(LinkLost):
        link.tune(9600)


def test_no_descriptor_is_left_behind(master: PtyMaster) -> None:
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        SerialLink(master.slave_name, rate=1_000_000).close()
        with pytest.raises(LinkError):
            SerialLink("/dev/null", rate=1_000_000)
    assert len(os.listdir("/proc/self/fd")) == before


# -- held by somebody -------------------------------------------------------------------------------------------


def test_a_second_link_in_this_process_is_refused(link: SerialLink, master: PtyMaster) -> None:
    with pytest.raises(PortBusy, match="this very program") as refused:
        SerialLink(master.slave_name, rate=1_000_000)
    assert refused.value.owner == os.getpid()


def test_another_motorbus_process_is_named_by_any_name_of_the_port(master: PtyMaster, tmp_path: Path) -> None:
    (tmp_path / "arm").symlink_to(master.slave_name)
    with other_process(HOLD_LINK, master.slave_name) as process:
        with pytest.raises(PortBusy, match=f"process {process.pid}") as refused:
            SerialLink(str(tmp_path / "arm"), rate=1_000_000)
        assert refused.value.owner == process.pid
        assert [owner.pid for owner in holders()] == [process.pid]


def test_a_foreign_program_is_named(master: PtyMaster) -> None:
    with other_process(HOLD_OPEN, master.slave_name) as process:
        with pytest.raises(PortBusy, match=rf"process {process.pid} \(python") as refused:
            SerialLink(master.slave_name, rate=1_000_000)
        assert refused.value.owner == process.pid
    SerialLink(master.slave_name, rate=1_000_000).close()


def test_a_program_that_locks_the_device_is_seen_even_where_nobody_can_look(
    master: PtyMaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial, "find_user", lambda _: None)
    held = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(held, fcntl.LOCK_EX)
    with pytest.raises(PortBusy, match="another program") as refused:
        SerialLink(master.slave_name, rate=1_000_000)
    assert refused.value.owner is None
    os.close(held)


def test_a_killed_owner_leaves_the_port_free(master: PtyMaster) -> None:
    with other_process(HOLD_LINK, master.slave_name) as process:
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=30)
        link = SerialLink(master.slave_name, rate=1_000_000)
        link.write(PING)
        assert heard(master, 6) == PING
        link.close()


@pytest.mark.usefixtures("like_a_device")
def test_the_kernel_keeps_others_out_of_a_device(master: PtyMaster) -> None:
    def is_exclusive() -> int:
        return int(struct.unpack("i", fcntl.ioctl(master._slave, TIOCGEXCL, bytes(4)))[0])

    link = SerialLink(master.slave_name, rate=1_000_000)
    assert is_exclusive() == 1
    link.close()
    assert is_exclusive() == 0


# -- refused ----------------------------------------------------------------------------------------------------


def test_a_port_that_does_not_exist_comes_with_those_that_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serialx, "list_serial_ports", lambda: [usb_port()])
    with pytest.raises(PortNotFound, match=r"one of /dev/ttyACM0 \(CH343"):
        SerialLink("/dev/no-such-port", rate=1_000_000)


@pytest.mark.parametrize("path", ["/dev/null", "/tmp", "file"])
def test_what_is_no_serial_port(path: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(PortNotFound, match="is not a serial port") as refused:
        SerialLink(str(tmp_path / path), rate=1_000_000)
    assert "`motorbus ports`" in refused.value.advice


FORBIDDEN = """
import os, sys, tempfile
from motorbus.errors import LinkError
from motorbus.link import serial, usb_adapters, wait
import serialx
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
with tempfile.TemporaryDirectory(dir="/tmp") as folder:
    os.environ["XDG_STATE_HOME"] = folder
    try:
        serial.SerialLink(sys.argv[1], rate=1_000_000)
    except LinkError as error:
        print(error)
"""


def test_no_permission_says_how_to_get_it(master: PtyMaster) -> None:
    Path(master.slave_name).chmod(0)
    told = run(FORBIDDEN, master.slave_name)
    assert "no permission to open it" in told
    assert "dialout" in told
    assert "uaccess" in told


# -- latency ----------------------------------------------------------------------------------------------------


def sysfs_with_timer(folder: Path, device: str, timer: int) -> Path:
    place = folder / "class" / "tty" / Path(device).name / "device"
    place.mkdir(parents=True)
    (place / "latency_timer").write_text(f"{timer}\n")
    return folder


@pytest.mark.parametrize(("timer", "latency", "warnings"), [(16, 0.019, 1), (1, 0.004, 0)])
def test_a_slow_latency_timer_is_counted_in_and_warned_about(
    timer: int, latency: float, warnings: int, master: PtyMaster, tmp_path: Path
) -> None:
    link = SerialLink(
        master.slave_name, rate=1_000_000, sysfs=sysfs_with_timer(tmp_path, master.slave_name, timer)
    )
    assert link.latency == pytest.approx(latency)
    assert len(link.warnings) == warnings
    assert all("latency_timer" in warning for warning in link.warnings)
    link.close()


@pytest.mark.usefixtures("like_a_device")
def test_a_device_without_a_timer_has_the_usual_latency_and_is_paced(master: PtyMaster) -> None:
    link = SerialLink(master.slave_name, rate=1_000_000)
    assert (link.latency, link.paced) == (0.004, True)
    link.close()


# -- rates ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [1_000_000, 128_000, 76_800, 4_800])
def test_the_rate_arrives_at_the_other_end(rate: int, master: PtyMaster) -> None:
    link = SerialLink(master.slave_name, rate=rate)
    assert master.rate() == rate
    link.close()


def test_the_rate_can_be_changed_and_bytes_still_pass(link: SerialLink, master: PtyMaster) -> None:
    for rate in (76_800, 128_000, 1_000_000):
        link.tune(rate)
        assert (link.rate, master.rate()) == (rate, rate)
        link.write(PING)
        assert heard(master, 6) == PING


def test_what_is_going_out_keeps_its_rate(link: SerialLink) -> None:
    link.tune(9600)
    begin = link.now()
    link.write(bytes(48))
    link.tune(1_000_000)
    assert link.now() - begin >= 480 / 9600


def test_an_adapter_that_rounds_too_far_is_refused(
    master: PtyMaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial, "line_speed", lambda _: 115_200)
    with pytest.raises(LinkError, match=r"cannot do 128000 bit/s: the adapter makes 115200"):
        SerialLink(master.slave_name, rate=128_000)
    SerialLink(master.slave_name, rate=115_000).close()


def test_what_is_no_rate(link: SerialLink) -> None:
    with pytest.raises(RequestError, match="0 is not a rate"):
        link.tune(0)


# -- what is loaded ---------------------------------------------------------------------------------------------


def test_importing_it_loads_no_serial_library() -> None:
    code = "import sys, motorbus.link.serial as s; print({'serialx', 'termios', 'fcntl', 'tty'} & set(sys.modules))"
    assert run(code) == "set()\n"


def test_terminal_settings_are_not_left_cooked(link: SerialLink, master: PtyMaster) -> None:
    local = termios.tcgetattr(master.fileno())[3]
    assert local & (termios.ECHO | termios.ICANON | termios.ISIG) == 0


@pytest.mark.parametrize(("resolution", "sharp"), [(1e-9, True), (1e-7, True), (0.0156, False)])
def test_a_clock_of_coarse_ticks_cannot_tell_how_long_a_frame_took(
    monkeypatch: pytest.MonkeyPatch, resolution: float, sharp: bool
) -> None:
    found = SimpleNamespace(resolution=resolution)
    monkeypatch.setattr(time, "get_clock_info", lambda name: found)
    assert has_fine_clock() is sharp
