"""Serial links over real pseudo-terminals."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import serialx

from motorbus.errors import PortBusy, PortNotFound
from motorbus.link.lock import holders
from motorbus.link.serial import SerialLink, ports
from motorbus.simulation.pty import PtyMaster
from tests.links.other import HOLD_OPEN, other_process, run
from tests.links.usb import usb_port

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


def test_bytes_from_before_the_open_are_not_read(master: PtyMaster) -> None:
    master.write(b"stale")
    link = SerialLink(master.slave_name, rate=1_000_000)
    assert link.read(0.0) == []
    link.close()


@pytest.mark.parametrize("code", [HOLD_LINK, HOLD_OPEN], ids=["motorbus", "another program"])
def test_the_process_that_holds_the_port_is_named(code: str, master: PtyMaster, tmp_path: Path) -> None:
    (tmp_path / "arm").symlink_to(master.slave_name)
    with other_process(code, master.slave_name) as process:
        with pytest.raises(PortBusy, match=rf"process {process.pid} \(python") as caught:
            SerialLink(str(tmp_path / "arm"), rate=1_000_000)
        assert caught.value.owner == process.pid
        assert [owner.pid for owner in holders()] == ([process.pid] if code is HOLD_LINK else [])
    SerialLink(master.slave_name, rate=1_000_000).close()


def test_the_error_for_a_missing_port_lists_the_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serialx, "list_serial_ports", lambda: [usb_port()])
    with pytest.raises(PortNotFound, match=r"one of /dev/ttyACM0 \(CH343"):
        SerialLink("/dev/no-such-port", rate=1_000_000)


@pytest.mark.parametrize("path", ["/dev/null", "/tmp", "file"])
def test_other_files_are_no_serial_ports(path: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(PortNotFound, match="is not a serial port") as caught:
        SerialLink(str(tmp_path / path), rate=1_000_000)
    assert "`motorbus scan`" in caught.value.advice


FORBIDDEN = """
import os, sys, tempfile
from motorbus.errors import LinkError
from motorbus.link import serial, stream, usb_adapters
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


def test_the_rate_can_be_changed_and_bytes_on_their_way_keep_theirs(
    link: SerialLink, master: PtyMaster
) -> None:
    for rate in (76_800, 128_000, 9600):
        link.tune(rate)
        assert (link.rate, master.rate()) == (rate, rate)
    begin = link.now()
    link.write(bytes(48))
    link.tune(1_000_000)
    assert link.now() - begin >= 480 / 9600
    assert master.read() == bytes(48)


def test_importing_it_loads_no_serial_library() -> None:
    code = "import sys, motorbus.link.serial as s; print({'serialx', 'termios', 'fcntl', 'tty'} & set(sys.modules))"
    assert run(code) == "set()\n"


PLAIN = usb_port(device="/dev/ttyS0", resolved_device="/dev/ttyS0", vid=None, pid=None, product=None)


def test_ports_are_listed_with_what_they_probably_are() -> None:
    usb, plain = ports(lambda: [PLAIN, usb_port()])
    assert usb.device == "/dev/ttyACM0"
    assert usb.stable == "/dev/serial/by-id/usb-1a86_USB_Single_Serial_585A-if00"
    assert (usb.vid, usb.pid, usb.serial_number) == (0x1A86, 0x55D3, "585A0076891")
    assert usb.guess == "CH343: usual on FEETECH and Waveshare servo boards"
    assert (plain.device, plain.stable, plain.vid, plain.guess) == ("/dev/ttyS0", "", None, "")


def test_a_slow_latency_timer_is_counted_in_and_warned_about(master: PtyMaster, tmp_path: Path) -> None:
    folder = tmp_path / "class" / "tty" / Path(master.slave_name).name / "device"
    folder.mkdir(parents=True)
    (folder / "latency_timer").write_text("16\n")
    link = SerialLink(master.slave_name, rate=1_000_000, sysfs=tmp_path)
    assert link.latency == pytest.approx(0.019)
    (warning,) = link.warnings
    assert "16 ms" in warning
    assert 'ATTR{latency_timer}="1"' in warning
    link.close()
