"""Row D13: a CAN controller that leaves the bus, an adapter that is down, a bus on which nobody acknowledges."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import families
from motorbus.core.operation import ERROR_FLAG, CanFrame, Data, Operation, Pause, Together, outcome
from motorbus.errors import LinkLost, MotorbusError
from motorbus.link.can import BUS_OFF
from motorbus.simulation.clients import Door
from motorbus.simulation.listener import TcpPort
from motorbus.simulation.mount import Mount
from motorbus.simulation.socketcand import SocketcandAdapter
from tests.faults.scenes import Scene
from tests.faults.test_reconnect import again, free_port
from tests.support.mounts import served
from tests.support.world import is_queued, said

IDS = (0x21, 0x22, 0x23)
SOON = 1.0
"""s in which it is told."""


class Failing:
    """A simulated bus whose controller at the host's end leaves it: it says so, and sends nothing while it is off."""

    def __init__(self) -> None:
        self.simulator: Any = families.load("kst").simulator(IDS, "", profile="kst-ext")
        self.off = False
        self.refused = 0
        self.heard: list[CanFrame] = []
        self._says: list[tuple[float, Data]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.simulator, name)

    def receive(self, data: Data, at: float) -> None:
        assert isinstance(data, CanFrame)
        if self.off:
            self.refused += 1
            self._says.append((at, CanFrame(ERROR_FLAG | BUS_OFF, bytes(8))))
        else:
            self.heard.append(data)
            self.simulator.receive(data, at)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        said, self._says = self._says, []
        return [*said, *self.simulator.advance(to)]

    def due(self) -> float | None:
        due: float | None = self.simulator.due()
        return self._says[0][0] if self._says else due


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def pause(seconds: float) -> Operation[None]:
    yield from Pause(seconds)


def moves(devices: list[Any]) -> Operation[list[Any]]:
    """Order each of them to go somewhere, all at once, and take what comes of it."""
    told: list[Any] = yield from Together(
        [outcome(said(device, "move", 0.5, wait=False)) for device in devices]
    )
    return told


def on_its_way(bus: Any, failing: Failing) -> None:
    """What had left before is heard: on a busy machine it may lie between the two programs for a while."""
    heard = -1
    while heard != len(failing.heard):
        heard = len(failing.heard)
        bus.run(pause(0.2))


def test_d13_bus_off_is_told_its_queue_is_dropped_and_nothing_is_sent_again() -> None:
    port = free_port()
    failing = Failing()
    door = Door(TcpPort("127.0.0.1", port), SocketcandAdapter)
    mount = Mount(failing, door, rate=500_000)
    address = f"kst:can://socketcand/127.0.0.1:{port}/can0,profile=kst-ext"
    with closing(door), served(mount), motorbus.open(address) as bus:
        devices = [bus.family.devices.blocking(bus, node) for node in IDS]
        assert isinstance(again(bus), float)
        failing.off = True
        told = bus.run(moves(devices))
        assert failing.refused
        assert all(isinstance(one, LinkLost) for one in told), told
        assert "off the bus" in str(told[0])
        assert not is_queued(bus)
        failing.off = False
        on_its_way(bus, failing)
        failing.heard.clear()
        bus.run(pause(0.3))
        assert failing.heard == [], "nothing is sent by itself"
        assert isinstance(again(bus), float)
        assert _orders(failing) == []


def _orders(failing: Failing) -> list[CanFrame]:
    """Writes that have reached the devices since: their first byte says so (expedited download)."""
    return [frame for frame in failing.heard if frame.data[:1] and frame.data[0] & 0xE0 == 0x20]


def test_d13_where_nobody_acknowledges_it_is_told_soon_and_nothing_is_sent_later() -> None:
    there = Scene("kst", pace=True)
    devices = [there.family.devices.blocking(there.bus, node) for node in IDS]
    for device in devices:
        device.position()
    for node in there.simulator.nodes.values():
        node.unplug()
    now = there.link.now()
    told = there.bus.run(moves(devices))
    assert there.link.now() - now <= SOON
    assert all(isinstance(one, MotorbusError) for one in told)
    assert not is_queued(there.bus)
    for node in there.simulator.nodes.values():
        node.plug()
    sent = len(there.wire.sent)
    there.bus.run(pause(2.0))
    assert len(there.wire.sent) == sent
    assert not there.moving()
