"""What people are text when a port fails them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from motorbus.link.errors import (
    Owner,
    busy,
    full,
    lost,
    no_permission,
    not_a_port,
    not_found,
    unsupported_rate,
)
from motorbus.link.usb_adapters import PortInfo

ACM = PortInfo(
    "/dev/ttyACM0", "", 0x1A86, 0x55D3, "", "", "USB Single Serial", "CH343: usual on servo boards"
)
PLAIN = PortInfo("/dev/ttyS0", "", None, None, "", "", "", "")


def test_a_missing_port_lists_the_ports() -> None:
    text = str(not_found("/dev/ttyACM9", [ACM, PLAIN]))
    assert "/dev/ttyACM9: there is no such port" in text
    assert "one of /dev/ttyACM0 (CH343: usual on servo boards), /dev/ttyS0" in text


def test_a_machine_without_ports_says_so() -> None:
    assert "none at present" in str(not_found("/dev/ttyACM9", []))


@pytest.mark.parametrize(
    ("port", "device", "says"),
    [
        ("/dev/null", "", "/dev/null is not a serial port"),
        ("can://slcan/tmp", "/tmp", "can://slcan/tmp: /tmp is not a serial port"),
    ],
)
def test_another_file_lists_the_ports(port: str, device: str, says: str) -> None:
    error = not_a_port(port, [PLAIN], device)
    assert (error.summary, error.expected) == (says, "one of /dev/ttyS0")
    assert error.advice == "`motorbus ports` lists what there is"


def test_a_symbolic_link_that_leads_nowhere_is_recognised(tmp_path: Path) -> None:
    (tmp_path / "arm").symlink_to("/dev/pts/no-such-one")
    assert "leads to /dev/pts/no-such-one, which is gone" in str(not_found(str(tmp_path / "arm"), []))


def test_a_port_without_a_folder_says_relative_to_what_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = not_found("ttyACM9", [])
    assert text.cause.endswith(f"relative to the working directory: {tmp_path}/ttyACM9")
    assert f"{tmp_path}/there/bus" in not_found("./there/bus", []).cause
    assert not_found("tty", []).advice.startswith("did you mean /dev/tty? ")
    assert "did you mean" not in text.advice
    for port in ("/dev/ttyACM9", "rfc2217://host:4001", "can://slcan/dev/ttyACM9"):
        assert not not_found(port, []).cause


def test_the_owner_is_named() -> None:
    error = busy("/dev/ttyACM0", Owner(1, "init"))
    assert (error.owner, error.summary) == (1, "/dev/ttyACM0 is held by process 1 (init)")
    assert busy("/dev/ttyACM0", Owner(os.getpid(), "x")).owner == os.getpid()


@pytest.mark.parametrize("program", ["ModemManager", "brltty"])
def test_programs_that_grab_adapters_are_known(program: str) -> None:
    assert busy("/dev/ttyUSB0", Owner(1, program)).advice != busy("/dev/ttyUSB0", Owner(1, "x")).advice


@pytest.mark.parametrize("group", ["dialout", "uaccess"])
def test_no_permission_says_how_to_get_it(group: str) -> None:
    assert group in str(no_permission("/dev/ttyACM0", "/dev/null"))


def test_the_group_is_the_one_of_the_device(tmp_path: Path) -> None:
    (tmp_path / "device").touch()
    os.chown(tmp_path / "device", -1, os.getgid())
    text = str(no_permission("/dev/ttyACM0", str(tmp_path / "device")))
    assert "usermod -aG root" not in text
    assert "usermod -aG" in text


def test_the_reason_of_a_loss() -> None:
    assert (
        lost("/dev/ttyACM0", OSError(5, "Input/output error")).summary
        == "/dev/ttyACM0 is gone: Input/output error"
    )
    assert lost("/dev/ttyACM0", "it hung up").summary == "/dev/ttyACM0 is gone: it hung up"


def test_values_and_limits() -> None:
    assert "76800 bit/s" in str(unsupported_rate("/dev/ttyACM0", 76_800, "no"))
    assert "3 of 8" in str(full("/dev/ttyACM0", 3, 8))
