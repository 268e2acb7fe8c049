"""Ports of this machine, in words and as data."""

from __future__ import annotations

import pytest

from motorbus.link import serial
from motorbus.link.usb_adapters import PortInfo
from tests.cli.conftest import Run

ADAPTER = PortInfo(
    device="/dev/ttyACM0",
    stable="/dev/serial/by-id/usb-1a86_USB_Single_Serial_1234-if00",
    vid=0x1A86,
    pid=0x55D3,
    serial_number="1234",
    manufacturer="1a86",
    product="USB Single Serial",
    guess="an adapter",
)
BOARD = PortInfo("/dev/ttyS0", "", None, None, "", "", "", "")


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "ports", lambda: [ADAPTER, BOARD])


@pytest.mark.usefixtures("machine")
def test_a_table_for_eyes(run: Run) -> None:
    ran = run("ports")
    assert (ran.code, ran.err) == (0, "")
    _, head, adapter, board = ran.out.splitlines()
    assert head.split()[0] == "device"
    for word in ("/dev/ttyACM0", "1a86:55d3", "USB Single Serial", "an adapter", ADAPTER.stable):
        assert word in adapter
    assert board.strip() == "/dev/ttyS0"


@pytest.mark.usefixtures("machine")
def test_the_same_as_data(run: Run) -> None:
    document = run("ports", "--json").document
    assert document["schema"] == "motorbus.ports/1"
    assert document["ports"][0]["stable"] == ADAPTER.stable
    assert document["ports"][0]["description"] == "1a86 USB Single Serial"
    assert document["ports"][1]["vid"] is None


def test_no_port_is_no_error(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "ports", list)
    ran = run("ports")
    assert (ran.code, ran.out) == (0, "")
    assert "motorbus demo" in ran.err
    assert run("ports", "--json").document["ports"] == []


def test_this_machine_has_been_looked_at(run: Run) -> None:
    assert isinstance(run("ports", "--json").document["ports"], list)
