"""The list of ports, from serialx and from a kernel's tree."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.link.serial import ports
from tests.links.usb import fake_usb, usb_port

PLAIN = usb_port(device="/dev/ttyS0", resolved_device="/dev/ttyS0", vid=None, pid=None, product=None)


def test_ports_are_listed_with_what_they_probably_are() -> None:
    usb, plain = ports(lambda: [PLAIN, usb_port()])
    assert usb.device == "/dev/ttyACM0"
    assert usb.stable == "/dev/serial/by-id/usb-1a86_USB_Single_Serial_585A-if00"
    assert (usb.vid, usb.pid, usb.serial_number) == (0x1A86, 0x55D3, "585A0076891")
    assert usb.guess == "CH343: usual on FEETECH and Waveshare servo boards"
    assert (plain.device, plain.stable, plain.vid, plain.guess) == ("/dev/ttyS0", "", None, "")


def test_the_kernels_tree_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sysfs, devices = fake_usb(tmp_path)
    monkeypatch.setattr("serialx.platforms.serial_linux.SYS_ROOT", sysfs)
    monkeypatch.setattr("serialx.platforms.serial_linux.DEV_ROOT", devices)
    [port] = ports()
    assert port.device == str(devices / "ttyACM3")
    assert port.stable == str(devices / "serial" / "by-id" / "usb-STM_3669-if00")
    assert (port.vid, port.pid, port.serial_number) == (0x0483, 0x5740, "3669")
    assert port.description == "STM Virtual ComPort"
    assert port.guess.startswith("STM32")


def test_this_machine_can_be_asked() -> None:
    assert all(port.device for port in ports())
