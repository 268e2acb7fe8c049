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
from types import SimpleNamespace

import pytest
import serialx

from motorbus.errors import LinkError, PortBusy, PortNotFound, RequestError
from motorbus.link import serial, usb_adapters
from motorbus.link.base import Link
from motorbus.link.lock import holders
from motorbus.link.serial import SerialLink, has_fine_clock, line_speed, ports
from motorbus.link.wait import wait_readable
from motorbus.simulation.pty import PtyMaster
from tests.links.other import other_process, run
from tests.links.usb import fake_usb, usb_port

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


def received(master: PtyMaster, count: int) -> bytes:
    """That many bytes at the simulator's end."""
    text = b""
    while len(text) < count:
        assert wait_readable(master.fileno(), 30)
        text += master.read()
    return text


# -- bytes ------------------------------------------------------------------------------------------------------


def test_its_attributes(link: SerialLink, master: PtyMaster) -> None:
    face: Link = link
    assert (face.name, face.rate, face.warnings) == (master.slave_name, 1_000_000, ())
    assert (face.paced, face.virtual, face.simulated, face.latency) == (False, False, False, 0.002)
    assert face.fileno() is not None


def test_bytes_from_before_the_open_are_not_read(master: PtyMaster) -> None:
    master.write(b"stale")
    link = SerialLink(master.slave_name, rate=1_000_000)
    assert link.read(0.0) == []
    link.close()


# -- gone -------------------------------------------------------------------------------------------------------


def test_no_descriptor_is_left_behind(master: PtyMaster) -> None:
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        SerialLink(master.slave_name, rate=1_000_000).close()
        with pytest.raises(LinkError):
            SerialLink("/dev/null", rate=1_000_000)
    assert len(os.listdir("/proc/self/fd")) == before


# -- in use -----------------------------------------------------------------------------------------------------


def test_another_motorbus_process_is_named_under_any_name_of_the_port(
    master: PtyMaster, tmp_path: Path
) -> None:
    (tmp_path / "arm").symlink_to(master.slave_name)
    with other_process(HOLD_LINK, master.slave_name) as process:
        with pytest.raises(PortBusy, match=f"process {process.pid}") as caught:
            SerialLink(str(tmp_path / "arm"), rate=1_000_000)
        assert caught.value.owner == process.pid
        assert [owner.pid for owner in holders()] == [process.pid]


def test_another_program_is_named(master: PtyMaster) -> None:
    with other_process(HOLD_OPEN, master.slave_name) as process:
        with pytest.raises(PortBusy, match=rf"process {process.pid} \(python") as caught:
            SerialLink(master.slave_name, rate=1_000_000)
        assert caught.value.owner == process.pid
    SerialLink(master.slave_name, rate=1_000_000).close()


def test_a_locked_device_is_busy_without_proc(master: PtyMaster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "find_user", lambda _: None)
    held = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(held, fcntl.LOCK_EX)
    with pytest.raises(PortBusy, match="another program") as caught:
        SerialLink(master.slave_name, rate=1_000_000)
    assert caught.value.owner is None
    os.close(held)


def test_a_killed_owner_leaves_the_port_free(master: PtyMaster) -> None:
    with other_process(HOLD_LINK, master.slave_name) as process:
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=30)
        link = SerialLink(master.slave_name, rate=1_000_000)
        link.write(PING)
        assert received(master, 6) == PING
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


def test_the_error_for_a_missing_port_lists_the_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serialx, "list_serial_ports", lambda: [usb_port()])
    with pytest.raises(PortNotFound, match=r"one of /dev/ttyACM0 \(CH343"):
        SerialLink("/dev/no-such-port", rate=1_000_000)


@pytest.mark.parametrize("path", ["/dev/null", "/tmp", "file"])
def test_other_files_are_no_serial_ports(path: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(PortNotFound, match="is not a serial port") as caught:
        SerialLink(str(tmp_path / path), rate=1_000_000)
    assert "`motorbus ports`" in caught.value.advice


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
    text = run(FORBIDDEN, master.slave_name)
    assert "no permission to open it" in text
    assert "dialout" in text
    assert "uaccess" in text


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
        assert received(master, 6) == PING


def test_bytes_on_their_way_keep_their_rate(link: SerialLink) -> None:
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


def test_a_rate_must_be_positive(link: SerialLink) -> None:
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
def test_a_coarse_clock_is_recognised(
    monkeypatch: pytest.MonkeyPatch, resolution: float, sharp: bool
) -> None:
    found = SimpleNamespace(resolution=resolution)
    monkeypatch.setattr(time, "get_clock_info", lambda name: found)
    assert has_fine_clock() is sharp


# -- line speed ------------------------------------------------------------------------------------------------


FEETECH_RATES = (
    1_000_000,
    500_000,
    250_000,
    128_000,
    115_200,
    76_800,
    57_600,
    38_400,
    19_200,
    14_400,
    9_600,
    4_800,
)


@pytest.mark.parametrize("rate", FEETECH_RATES)
def test_every_rate_of_the_servos_is_read_at_both_ends(rate: int, master: PtyMaster) -> None:
    port = serialx.serial_for_url(master.slave_name, baudrate=rate)
    port.open()
    assert (line_speed(port.fileno()), line_speed(master.fileno())) == (rate, rate)
    port.close()


def test_the_standard_rates_are_read_without_termios2(
    master: PtyMaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial, "_termios2_speed", lambda _: 0)
    settings = termios.tcgetattr(master.fileno())
    settings[4] = settings[5] = termios.B57600
    termios.tcsetattr(master.fileno(), termios.TCSANOW, settings)
    assert line_speed(master.fileno()) == 57_600


def test_a_file_has_no_rate() -> None:
    with open(os.devnull) as nothing:
        assert line_speed(nothing.fileno()) is None


# -- the list of ports -----------------------------------------------------------------------------------------


PLAIN = usb_port(device="/dev/ttyS0", resolved_device="/dev/ttyS0", vid=None, pid=None, product=None)


def test_ports_are_listed_with_what_they_probably_are() -> None:
    usb, plain = ports(lambda: [PLAIN, usb_port()])
    assert usb.device == "/dev/ttyACM0"
    assert usb.stable == "/dev/serial/by-id/usb-1a86_USB_Single_Serial_585A-if00"
    assert (usb.vid, usb.pid, usb.serial_number) == (0x1A86, 0x55D3, "585A0076891")
    assert usb.guess == "CH343: usual on FEETECH and Waveshare servo boards"
    assert (plain.device, plain.stable, plain.vid, plain.guess) == ("/dev/ttyS0", "", None, "")


def test_ports_from_the_tree_of_the_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sysfs, devices = fake_usb(tmp_path)
    monkeypatch.setattr("serialx.platforms.serial_linux.SYS_ROOT", sysfs)
    monkeypatch.setattr("serialx.platforms.serial_linux.DEV_ROOT", devices)
    [port] = ports()
    assert port.device == str(devices / "ttyACM3")
    assert port.stable == str(devices / "serial" / "by-id" / "usb-STM_3669-if00")
    assert (port.vid, port.pid, port.serial_number) == (0x0483, 0x5740, "3669")
    assert port.description == "STM Virtual ComPort"
    assert port.guess.startswith("STM32")


def test_the_ports_of_this_machine() -> None:
    assert all(port.device for port in ports())
