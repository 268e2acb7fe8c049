"""A port that is lost is opened anew, over real pseudo-terminals and sockets; a false system tells of adapters."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from motorbus.errors import LinkLost, PortBusy
from motorbus.link import reconnect, usb_adapters
from motorbus.link.lock import PortLock
from motorbus.link.reconnect import FIRST_RETRY, LAST_RETRY, Reconnecting, check_reachable, reconnecting
from motorbus.link.serial import NEGOTIATION_TIME
from motorbus.link.url import open_link
from motorbus.simulation.pty import PtyMaster
from tests.links.rfc2217 import Server
from tests.links.usb import usb_port

RATE = 1_000_000
SOON = 30.0
"""s in which a port that was pulled is told to be gone."""


class Usb:
    """Adapters as the system tells of them: device and serial number."""

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
    with pytest.raises(LinkLost, match="leads nowhere") as told:
        link.renew(1)
    assert "looked for again" in told.value.advice
    with pytest.raises(LinkLost, match="leads nowhere"):
        link.write(b"never")
    master.plug()
    link.rest(link.now() + 30)
    link.renew(1)
    passes(link, master)
    link.close()


def test_l12_a_link_that_was_left_behind_leads_to_somebody_elses_terminal(
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


def test_l12_another_adapter_is_refused_and_nothing_is_said_to_it(
    usb: Usb, master: PtyMaster, other: PtyMaster
) -> None:
    link = adapter(other, usb)
    names: list[str] = []
    link.on_rename = names.append
    usb.ports = {other.slave_name: "B"}  # B is plugged in where A was
    with pytest.raises(LinkLost, match="another in its place") as told:
        link.renew(1)
    assert "with the serial number A" in told.value.expected
    assert "open the bus again" in told.value.advice
    for attempt in (lambda: link.write(b"for A"), lambda: link.read(0.0), lambda: link.renew(1)):
        with pytest.raises(LinkLost, match="another in its place"):
            attempt()
    assert other.read() == b""
    assert names == [""]
    with PortLock(other.slave_name):  # B may be opened by whoever wants it
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


def test_it_is_looked_for_at_first_soon_and_then_more_seldom(
    usb: Usb, master: PtyMaster, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_a_loss_that_another_thread_has_mended_needs_nothing(usb: Usb, master: PtyMaster) -> None:
    link = adapter(master, usb)
    usb.asked = 0
    link.renew(1)
    assert usb.asked > 0
    usb.asked = 0
    link.renew(1)
    assert usb.asked == 0
    link.close()


def test_what_keeps_it_from_being_opened_is_told(usb: Usb, master: PtyMaster) -> None:
    usb.ports[master.slave_name] = "A"

    def held(rate: int, listen_only: bool, lock: PortLock) -> Any:
        raise PortBusy("held by process 17", cause="it was quicker", advice="close it there")

    link = Reconnecting(open_link(master.slave_name, rate=RATE), held)
    with pytest.raises(LinkLost, match="is gone: held by process 17") as told:
        link.renew(1)
    assert told.value.cause == "it was quicker"
    assert told.value.advice.startswith("close it there; it is looked for again")
    assert link.lock_name == master.slave_name, "the lock is ours still"
    link.close()


def test_what_is_closed_is_not_looked_for(usb: Usb, master: PtyMaster) -> None:
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


def test_a_server_that_is_mute_when_it_is_back_holds_nobody_up_for_long() -> None:
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


def test_a_server_that_ends_is_known_before_a_library_waits_for_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        for url in (f"rfc2217://127.0.0.1:{port}", f"can://socketcand/127.0.0.1:{port}/can0"):
            check_reachable(url)
        check_reachable(f"can://slcan/socket://127.0.0.1:{port}")
    for url in (f"rfc2217://127.0.0.1:{port}", f"can://slcan/socket://127.0.0.1:{port}"):
        with pytest.raises(OSError, match="cannot be reached"):
            check_reachable(url)
    check_reachable("can://socketcan/can0")
    check_reachable(f"socket://127.0.0.1:{port}")


# -- who has the port ----------------------------------------------------------------------------------------------


def test_l13_while_it_is_away_a_second_program_is_told_who_has_it(tmp_path: Path, master: PtyMaster) -> None:
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
    told = subprocess.run(
        [sys.executable, "-c", code, name], capture_output=True, text=True, timeout=60, check=True
    )
    assert told.stdout.strip() == str(os.getpid())
    link.close()
    with PortLock(name):
        pass
