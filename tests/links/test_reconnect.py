"""Reopening a lost port, over real pseudo-terminals and sockets, and a simulated list of adapters."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from motorbus.errors import LinkLost, PortBusy, PortNotFound
from motorbus.link import reconnect, usb_adapters
from motorbus.link.lock import PortLock
from motorbus.link.reconnect import (
    FIRST_RETRY,
    LAST_RETRY,
    Identity,
    Reconnecting,
    find_adapter,
    identify,
    reconnecting,
    usb_socket,
)
from motorbus.link.serial import NEGOTIATION_TIME
from motorbus.link.url import open_link
from motorbus.simulation.pty import PtyMaster
from tests.links.rfc2217 import Server
from tests.links.usb import usb_port

RATE = 1_000_000
SOON = 30.0
"""s in which a port that was pulled is text to be gone."""


class Usb:
    """The adapters that the system lists: device and serial number."""

    def __init__(self) -> None:
        self.ports: dict[str, str] = {}
        self.to_come: list[dict[str, str]] = []
        self.asked = 0

    def __call__(self) -> list[Any]:
        self.asked += 1
        if self.to_come:
            self.ports = self.to_come.pop(0)
        return [
            usb_port(device=device, resolved_device=device, serial_number=number)
            for device, number in self.ports.items()
        ]


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


# -- pseudo-terminals ----------------------------------------------------------------------------------------------


def test_l12_a_terminal_is_found_behind_its_link(tmp_path: Path, master: PtyMaster) -> None:
    master.symlink(tmp_path / "bus")
    link = opened(str(tmp_path / "bus"))
    passes(link, master)
    master.unplug()
    with pytest.raises(LinkLost):
        link.read(link.now() + SOON)
    with pytest.raises(LinkLost, match="leads nowhere") as caught:
        link.renew(1)
    assert "looked for again" in caught.value.advice
    with pytest.raises(LinkLost, match="leads nowhere"):
        link.write(b"never")
    master.plug()
    link.rest(link.now() + 30)
    link.renew(1)
    passes(link, master)
    link.close()


def test_l12_a_stale_symbolic_link_is_not_followed(
    tmp_path: Path, master: PtyMaster, other: PtyMaster
) -> None:
    path = tmp_path / "bus"
    path.symlink_to(master.slave_name)
    link = opened(str(path))
    with pytest.raises(LinkLost, match="has not been made again"):
        link.renew(1)
    path.unlink()
    path.symlink_to(other.slave_name)
    link.rest(link.now() + 30)
    link.renew(1)
    passes(link, other)
    link.close()


def test_a_terminal_without_a_name_of_its_own_is_not_looked_for(master: PtyMaster) -> None:
    link = open_link(master.slave_name, rate=RATE)
    assert reconnecting(link, rate=RATE, default_rate=RATE) is link
    link.close()


def test_a_link_that_leads_elsewhere_by_now_is_not_followed(tmp_path: Path, master: PtyMaster) -> None:
    path = tmp_path / "bus"
    master.symlink(path)
    link = opened(str(path))
    pulled(link, master)
    path.symlink_to("/dev/null")
    with pytest.raises(LinkLost, match="another in its place: /dev/null"):
        link.renew(1)
    link.close()


# -- adapters ------------------------------------------------------------------------------------------------------


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
        with pytest.raises(LinkLost, match="another in its place"):
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


def test_an_adapter_that_changes_places_while_it_is_opened_is_not_used(
    usb: Usb, master: PtyMaster, other: PtyMaster
) -> None:
    link = adapter(master, usb)
    usb.to_come = [{other.slave_name: "A"}, {other.slave_name: "B"}]
    with pytest.raises(LinkLost, match="another in its place"):
        link.renew(1)
    assert usb.to_come == []
    with PortLock(other.slave_name):
        pass
    link.close()


def test_retries_become_less_frequent(usb: Usb, master: PtyMaster, monkeypatch: pytest.MonkeyPatch) -> None:
    link = adapter(master, usb)
    pulled(link, master)
    clock = SimpleNamespace(now=1000.0, looks=[])

    def slept(seconds: float) -> None:
        clock.now += seconds

    monkeypatch.setattr(reconnect, "time", SimpleNamespace(monotonic=lambda: clock.now, sleep=slept))
    usb.ports, usb.asked = {}, 0
    for _ in range(2_000):
        before = usb.asked
        with pytest.raises(LinkLost):
            link.renew(1)
        clock.looks += [clock.now] if usb.asked > before else []
        clock.now += 0.001
    gaps = [later - sooner for sooner, later in zip(clock.looks, clock.looks[1:], strict=False)]
    assert gaps[:4] == pytest.approx(
        [FIRST_RETRY, 2 * FIRST_RETRY, 4 * FIRST_RETRY, 8 * FIRST_RETRY], abs=0.002
    )
    assert gaps[4:] == pytest.approx([LAST_RETRY] * len(gaps[4:]), abs=0.002)
    assert len(gaps) > 5
    link.rest(clock.now + 10)
    assert clock.now == pytest.approx(clock.looks[-1] + LAST_RETRY, abs=0.01), (
        "rest ends when it is to be looked for"
    )
    link.close()


def test_a_loss_that_another_thread_has_repaired(usb: Usb, master: PtyMaster) -> None:
    link = adapter(master, usb)
    usb.asked = 0
    link.renew(1)
    assert usb.asked > 0
    usb.asked = 0
    link.renew(1)
    assert usb.asked == 0
    link.close()


def test_the_error_names_why_it_cannot_be_opened(usb: Usb, master: PtyMaster) -> None:
    usb.ports[master.slave_name] = "A"

    def held(rate: int, listen_only: bool, lock: PortLock) -> Any:
        raise PortBusy("held by process 17", cause="it was quicker", advice="close it there")

    link = Reconnecting(open_link(master.slave_name, rate=RATE), held)
    with pytest.raises(LinkLost, match="is gone: held by process 17") as caught:
        link.renew(1)
    assert caught.value.cause == "it was quicker"
    assert caught.value.advice.startswith("close it there; it is looked for again")
    assert link.lock_name == master.slave_name, "the lock is ours still"
    link.close()


def test_a_closed_link_is_not_reopened(usb: Usb, master: PtyMaster) -> None:
    link = adapter(master, usb)
    link.close()
    with pytest.raises(LinkLost, match="closed"):
        link.renew(1)
    assert link.lock_name == ""


def test_the_rate_is_kept(usb: Usb, master: PtyMaster) -> None:
    link = adapter(master, usb)
    link.tune(500_000)
    link.renew(1)
    assert (link.rate, master.rate()) == (500_000, 500_000)
    link.close()


# -- servers -------------------------------------------------------------------------------------------------------


def test_l12_a_server_is_found_at_its_address() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        link = opened(f"socket://127.0.0.1:{port}")
        far, _ = server.accept()
        far.close()
        with pytest.raises(LinkLost):
            link.read(link.now() + SOON)
    with pytest.raises(LinkLost, match="cannot be reached"):
        link.renew(1)
    with socket.create_server(("127.0.0.1", port)) as server:
        link.rest(link.now() + 30)
        link.renew(1)
        far, _ = server.accept()
        link.write(b"question")
        assert far.recv(100) == b"question"
        far.close()
        link.close()


def test_a_silent_server_costs_little_time() -> None:
    server = Server()
    link, (_, port) = opened(server.url), server.listener.getsockname()
    server.close()
    with pytest.raises(LinkLost):
        link.read(link.now() + 30)
    with (
        socket.create_server(("127.0.0.1", port)),
        pytest.raises(LinkLost, match=f"within {NEGOTIATION_TIME:g} s"),
    ):
        link.renew(1)
    link.close()


# -- who has the port ----------------------------------------------------------------------------------------------


def test_l13_the_lock_is_kept_while_the_port_is_gone(tmp_path: Path, master: PtyMaster) -> None:
    master.symlink(tmp_path / "bus")
    link = opened(str(tmp_path / "bus"))
    name = master.slave_name
    pulled(link, master)
    with pytest.raises(LinkLost):
        link.renew(1)
    code = (
        "import sys\nfrom motorbus.link.lock import PortLock\nfrom motorbus.errors import PortBusy\n"
        "try: PortLock(sys.argv[1]).acquire()\nexcept PortBusy as busy: print(busy.owner)\n"
    )
    text = subprocess.run(
        [sys.executable, "-c", code, name], capture_output=True, text=True, timeout=60, check=True
    )
    assert text.stdout.strip() == str(os.getpid())
    link.close()
    with PortLock(name):
        pass


# -- identity of an adapter ------------------------------------------------------------------------------------


NUMBERED = {"device": "/dev/ttyACM0", "resolved_device": "/dev/ttyACM0"}


def lister(*ports: dict[str, Any]) -> Callable[[], list[Any]]:
    return lambda: [usb_port(**{"device": port["resolved_device"], **port}) for port in ports]


def plugged(root: Path, name: str, where: str) -> Path:
    """The kernel's tree, with this device at this place of the USB."""
    interface = root / "devices" / "usb1" / where.partition(":")[0] / where
    interface.mkdir(parents=True, exist_ok=True)
    terminal = root / "class" / "tty" / name
    terminal.mkdir(parents=True, exist_ok=True)
    (terminal / "device").unlink(missing_ok=True)
    (terminal / "device").symlink_to(interface)
    return root


def known(**about: Any) -> Identity:
    return identify("/dev/ttyACM0", lister({**NUMBERED, **about}))


def test_l12_the_same_serial_number_is_found_under_another_name() -> None:
    there = lister(
        {"resolved_device": "/dev/ttyACM1"}, {"resolved_device": "/dev/ttyACM0", "serial_number": "B"}
    )
    assert find_adapter("bus", known(), there) == "/dev/ttyACM1"


def test_l12_another_adapter_at_its_place_is_refused() -> None:
    with pytest.raises(
        LinkLost, match="another in its place: the adapter 1a86:55d3 with the serial number B"
    ) as caught:
        find_adapter("bus", known(), lister({**NUMBERED, "serial_number": "B"}))
    assert caught.value.expected == "the adapter 1a86:55d3 with the serial number 585A0076891"


@pytest.mark.parametrize(
    "about",
    [{"vid": 0x0403}, {"pid": 0x55D2}, {"serial_number": None}, {"interface_num": 2}, {"port_number": 1}],
)
def test_any_difference_makes_another_adapter(about: dict[str, Any]) -> None:
    with pytest.raises(LinkLost, match="another in its place"):
        find_adapter("bus", known(), lister({**NUMBERED, **about}))
    with pytest.raises(PortNotFound):
        find_adapter("bus", known(), lister({"resolved_device": "/dev/ttyACM1", **about}))


def test_while_it_is_away_there_is_no_such_port() -> None:
    with pytest.raises(PortNotFound, match="with the serial number 585A0076891 is not there"):
        find_adapter("bus", known(), lister())


def test_l12_without_a_serial_number_its_place_on_the_usb_counts(tmp_path: Path) -> None:
    plugged(tmp_path, "ttyUSB0", "1-1.2:1.0")
    nameless = {"vid": 0x1A86, "pid": 0x7523, "serial_number": None}
    mine = identify("/dev/ttyUSB0", lister({"resolved_device": "/dev/ttyUSB0", **nameless}), tmp_path)
    assert mine.place == "1-1.2:1.0"
    plugged(tmp_path, "ttyUSB0", "1-1.3:1.0")
    plugged(tmp_path, "ttyUSB1", "1-1.2:1.0")
    both = lister(
        {"resolved_device": "/dev/ttyUSB0", **nameless}, {"resolved_device": "/dev/ttyUSB1", **nameless}
    )
    assert find_adapter("bus", mine, both, tmp_path) == "/dev/ttyUSB1"
    with pytest.raises(LinkLost, match="at the USB place 1-1.3:1.0"):
        find_adapter("bus", mine, lister({"resolved_device": "/dev/ttyUSB0", **nameless}), tmp_path)


def test_of_several_with_one_serial_number_the_usb_socket_decides(tmp_path: Path) -> None:
    plugged(tmp_path, "ttyACM0", "1-1:1.0")
    mine = identify("/dev/ttyACM0", lister(NUMBERED), tmp_path)
    plugged(tmp_path, "ttyACM1", "1-1:1.0")
    plugged(tmp_path, "ttyACM0", "1-2:1.0")
    both = lister(NUMBERED, {"resolved_device": "/dev/ttyACM1"})
    assert find_adapter("bus", mine, both, tmp_path) == "/dev/ttyACM1"
    plugged(tmp_path, "ttyACM1", "1-3:1.0")
    with pytest.raises(LinkLost, match="several adapters could be it"):
        find_adapter("bus", mine, both, tmp_path)


def test_a_port_on_no_usb_is_known_by_its_name(tmp_path: Path) -> None:
    plain = {"vid": None, "pid": None, "serial_number": None}
    mine = identify("/dev/ttyS0", lister({"resolved_device": "/dev/ttyS0", **plain}))
    assert mine.text == "the port /dev/ttyS0"
    assert find_adapter("bus", mine, lister({"resolved_device": "/dev/ttyS0", **plain})) == "/dev/ttyS0"
    unlisted = tmp_path / "tty"
    unlisted.touch()
    assert find_adapter("bus", identify(str(unlisted), lister()), lister()) == str(unlisted)


def test_without_a_place_the_name_must_be_the_same(tmp_path: Path) -> None:
    nameless = {"vid": 0x1A86, "pid": 0x7523, "serial_number": None}
    here = lister({"resolved_device": "/dev/ttyUSB0", **nameless})
    mine = identify("/dev/ttyUSB0", here, tmp_path)
    assert mine.text == "the adapter 1a86:7523 at /dev/ttyUSB0"
    assert find_adapter("bus", mine, here, tmp_path) == "/dev/ttyUSB0"
    with pytest.raises(PortNotFound):
        find_adapter("bus", mine, lister({"resolved_device": "/dev/ttyUSB1", **nameless}), tmp_path)


def test_where_the_system_says_nothing_there_is_no_place(tmp_path: Path) -> None:
    assert usb_socket("/dev/ttyACM0", tmp_path) == ""
