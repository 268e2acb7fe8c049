"""Two spellings of one port are one line, and two ports are two."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from motorbus.cli.line import same_line
from motorbus.errors import RequestError


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A device node, `ttyUSB0`, in the present folder, with a link to it in another."""
    node = tmp_path / "ttyUSB0"
    node.touch()
    (tmp_path / "by-id").mkdir()
    (tmp_path / "by-id" / "usb-FTDI").symlink_to("../ttyUSB0")
    monkeypatch.chdir(tmp_path)
    return node


@pytest.mark.parametrize(
    "spelling", ["ttyUSB0", "./ttyUSB0", "by-id/../ttyUSB0", "by-id/usb-FTDI", ".//by-id/./usb-FTDI"]
)
def test_a_device_is_the_same_by_every_path(spelling: str, port: Path) -> None:
    assert same_line(f"feetech:{spelling}", f"feetech:{port},baud=500000")
    assert not same_line(f"stepper:{spelling}", f"feetech:{port}")
    assert not same_line(f"feetech:{spelling}", f"feetech:{port}1")


def test_an_adapter_for_can_is_the_device_behind_it(port: Path) -> None:
    assert same_line(f"kst:can://slcan{port}", f"kst:can://slcan{port.parent}/by-id/usb-FTDI")
    assert same_line("kst:can://socketcan/can0", "kst:can://socketcan/can0,bitrate=250000")
    assert not same_line("kst:can://socketcan/can0", "kst:can://socketcan/can1")


@pytest.mark.parametrize(
    "spelling",
    [
        "socket://LOCALHOST:4000",
        "SOCKET://127.0.0.1:4000/",
        "socket://127.1:4000",
        "rfc2217://127.0.0.1:4000",
    ],
)
def test_a_server_is_the_same_by_every_name(spelling: str) -> None:
    assert same_line(f"feetech:{spelling}", "feetech:socket://127.0.0.1:4000")
    assert not same_line(f"feetech:{spelling}", "feetech:socket://127.0.0.1:4001")
    assert not same_line(f"feetech:{spelling}", "feetech:socket://127.0.0.2:4000")


def test_a_host_that_nobody_knows_is_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object) -> object:
        raise socket.gaierror("unknown")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    assert not same_line("feetech:socket://arm:4000", "feetech:socket://127.0.0.1:4000")
    assert same_line("feetech:socket://arm:4000", "feetech:socket://ARM:4000")
    assert not same_line("feetech:socket://arm:x", "feetech:socket://127.0.0.1:4000")


def test_letters_count_only_where_the_system_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not same_line("feetech:COM3", "feetech:com3")
    monkeypatch.setattr(os, "name", "nt")
    assert same_line("feetech:COM3", "feetech:com3")


def test_a_simulation_is_itself_alone() -> None:
    assert same_line("feetech:sim:1", "feetech:sim:1")
    assert not same_line("feetech:sim:1", "feetech:sim:2")


def test_what_is_no_address_is_refused() -> None:
    with pytest.raises(RequestError, match="not a bus address"):
        same_line("arm", "feetech:sim")
