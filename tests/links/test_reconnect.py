"""Reopen a lost port, over real pseudo-terminals and sockets, and a simulated list of USB adapters."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from motorbus.errors import LinkLost, PortBusy, PortNotFound
from motorbus.link import usb_adapters
from motorbus.link.lock import PortLock
from motorbus.link.reconnect import Reconnecting, find_adapter, reconnecting
from motorbus.link.serial import ports
from motorbus.link.url import open_link
from motorbus.link.usb_adapters import PortInfo
from motorbus.simulation.pty import PtyMaster
from tests.links.other import HOLD_OPEN, other_process, run
from tests.links.usb import usb_port

RATE = 1_000_000
SOON = 30.0
"""s within which the loss of a pulled port is reported."""


class Usb:
    """The adapters that the system lists: device and serial number."""

    def __init__(self) -> None:
        self.ports: dict[str, str] = {}

    def __call__(self) -> list[PortInfo]:
        found = [
            usb_port(device=one, resolved_device=one, serial_number=number)
            for one, number in self.ports.items()
        ]
        return ports(lambda: found)


@pytest.fixture
def usb(monkeypatch: pytest.MonkeyPatch) -> Usb:
    """Pseudo-terminals pass for adapters."""
    monkeypatch.setattr(usb_adapters, "PSEUDO_TERMINALS", ("no such prefix",))
    return Usb()


@pytest.fixture
def other() -> Iterator[PtyMaster]:
    terminal = PtyMaster()
    yield terminal
    terminal.close()


def opened(port: str, **more: Any) -> Reconnecting:
    said: dict[str, Any] = {"rate": RATE, "default_rate": RATE, "kind": "bytes", "options": {}}
    link = reconnecting(open_link(port, **said), **said, **more)
    assert isinstance(link, Reconnecting)
    return link


def adapter(master: PtyMaster, usb: Usb) -> Reconnecting:
    """An adapter with the serial number A."""
    usb.ports[master.slave_name] = "A"
    return opened(master.slave_name, lister=usb)


def passes(link: Reconnecting, master: PtyMaster) -> None:
    """Bytes go both ways."""
    link.write(b"question")
    assert master.read() == b"question"
    master.write(b"answer")
    assert link.read(link.now() + 30) == [b"answer"]


def pulled(link: Reconnecting, master: PtyMaster) -> None:
    master.close()
    with pytest.raises(LinkLost):
        link.read(link.now() + SOON)


def test_l12_a_terminal_that_another_program_uses_is_not_taken(tmp_path: Path, master: PtyMaster) -> None:
    """A link of a killed simulator leads to a terminal whose number a shell has now."""
    path = tmp_path / "bus"
    path.symlink_to(master.slave_name)
    link = opened(str(path))
    with other_process(HOLD_OPEN, master.slave_name) as shell:
        with pytest.raises(LinkLost, match=f"is held by process {shell.pid}"):
            link.renew(1)
        assert master.read() == b""
    link.close()


def test_l12_an_adapter_is_found_under_another_name(usb: Usb, master: PtyMaster, other: PtyMaster) -> None:
    link = adapter(master, usb)
    names: list[str] = []
    link.on_rename = names.append
    old = master.slave_name
    pulled(link, master)
    usb.ports = {other.slave_name: "A", "/dev/ttyACM7": "B"}
    link.renew(1)
    passes(link, other)
    assert (link.name, link.lock_name, names) == (old, other.slave_name, [other.slave_name])
    with PortLock(old), pytest.raises(PortBusy):  # the old name is free, the new one is ours
        PortLock(other.slave_name).acquire()
    link.close()


def test_l12_another_adapter_is_refused_and_receives_no_bytes(
    usb: Usb, master: PtyMaster, other: PtyMaster
) -> None:
    link = adapter(other, usb)
    names: list[str] = []
    link.on_rename = names.append
    usb.ports = {other.slave_name: "B"}  # B is plugged in where A was
    with pytest.raises(LinkLost, match="another in its place") as caught:
        link.renew(1)
    assert "with the serial number A" in caught.value.expected
    assert "open the bus again" in caught.value.advice
    for attempt in (lambda: link.write(b"for A"), lambda: link.read(0.0), lambda: link.renew(1)):
        with pytest.raises(LinkLost):
            attempt()
    assert other.read() == b""
    assert names == [""]
    with PortLock(other.slave_name):  # any program may open B
        pass
    usb.ports = {master.slave_name: "A"}
    link.rest(link.now() + 30)
    link.renew(1)
    passes(link, master)
    link.close()


def test_the_present_rate_is_kept(usb: Usb, master: PtyMaster) -> None:
    link = adapter(master, usb)
    for loss, rate in enumerate((500_000, RATE), start=1):
        link.tune(rate)
        link.rest(link.now() + 30)
        link.renew(loss)
        assert (link.rate, master.rate()) == (rate, rate)
    link.close()


def test_l12_a_server_is_found_at_its_address() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        link = opened(f"socket://127.0.0.1:{port}")
        far, _ = server.accept()
        far.close()
        with pytest.raises(LinkLost):
            link.read(link.now() + SOON)
    with pytest.raises(LinkLost, match="cannot be reached") as caught:
        link.renew(1)
    assert "looked for again" in caught.value.advice
    with socket.create_server(("127.0.0.1", port)) as server:
        link.rest(link.now() + 30)
        link.renew(1)
        far, _ = server.accept()
        link.write(b"question")
        assert far.recv(100) == b"question"
        far.close()
        link.close()


TRY_LOCK = """
import sys
from motorbus.errors import PortBusy
from motorbus.link.lock import PortLock
try:
    PortLock(sys.argv[1]).acquire()
except PortBusy as busy:
    print(busy.owner)
"""


def test_l13_the_lock_is_kept_while_the_port_is_gone(tmp_path: Path, master: PtyMaster) -> None:
    (tmp_path / "bus").symlink_to(master.slave_name)
    link = opened(str(tmp_path / "bus"))
    name = master.slave_name
    pulled(link, master)
    with pytest.raises(LinkLost):
        link.renew(1)
    assert run(TRY_LOCK, name).strip() == str(os.getpid())
    link.close()
    with PortLock(name):
        pass


def test_adapter_without_a_serial_number_has_the_same_name_and_kind(tmp_path: Path) -> None:
    path = tmp_path / "ttyUSB0"
    path.touch()

    def present(vid: int) -> list[PortInfo]:
        port = usb_port(device=str(path), resolved_device=str(path), vid=vid, pid=0x7523, serial_number=None)
        return ports(lambda: [port])

    (mine,) = present(0x1A86)
    assert find_adapter("bus", str(path), mine, [mine]) == str(path)
    with pytest.raises(LinkLost, match="the adapter 0403:7523"):
        find_adapter("bus", str(path), mine, present(0x0403))
    with pytest.raises(PortNotFound):
        find_adapter("bus", str(path), mine, [])
    assert find_adapter("bus", str(path), None, []) == str(path)


def test_the_ports_of_one_adapter_are_told_apart() -> None:
    def present(first: int) -> list[PortInfo]:
        names = [f"/dev/ttyUSB{first + number}" for number in (0, 1)]
        found = [
            usb_port(device=name, resolved_device=name, interface_num=number)
            for number, name in enumerate(names)
        ]
        return ports(lambda: found)

    _, second = present(0)
    assert find_adapter("bus", "/dev/ttyUSB1", second, present(1)) == "/dev/ttyUSB2"
