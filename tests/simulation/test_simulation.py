"""Simulated buses by name: who may open them, their clock, their line, and a CAN channel of python-can."""

from __future__ import annotations

import gc
import queue
import time
import weakref
from importlib import import_module
from typing import Any

import pytest

from motorbus import families
from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkLost, PortBusy, PortNotFound, RequestError
from motorbus.link.memory import MemoryLink
from motorbus.session import open as open_bus
from motorbus.simulation import Simulation, find

PING_1 = bytes.fromhex("FF FF 01 02 01 FB")
PONG_1 = bytes.fromhex("FF FF 01 02 00 FC")
READ_37 = CanFrame(0x625, bytes.fromhex("40 02 60 00 00 00 00 00"))
POSITION_37 = CanFrame(0x5A5, bytes.fromhex("4B 02 60 00 00 00 00 00"))


def servos(*ids: int, **options: Any) -> Simulation:
    return Simulation(families.load("feetech"), ids or (1,), **options)


def can_servos(*ids: int, **options: Any) -> Simulation:
    return Simulation(families.load("kst"), ids or (37,), **options)


def ask(link: MemoryLink, request: bytes = PING_1) -> list[object]:
    link.write(request)
    return list(link.read(link.now() + 1.0))


def test_a_url_leads_to_its_simulation_until_it_is_closed() -> None:
    with servos(name="arm") as sim, servos(name="leg") as other:
        assert (sim.url, repr(sim)) == ("feetech:sim:arm", "<Simulation feetech:sim:arm, ids 1>")
        assert find("arm", "feetech") is sim
        assert find("leg", "feetech") is other
        with pytest.raises(PortNotFound) as caught:
            find("tail", "feetech")
        assert "feetech:sim:arm, feetech:sim:leg" in caught.value.expected
        with pytest.raises(PortNotFound):
            find("arm", "kst")
        with pytest.raises(RequestError, match="exists already"):
            servos(name="arm")
    with pytest.raises(PortNotFound):
        find("arm", "feetech")
    with servos() as one, servos() as other:
        assert one.url != other.url


@pytest.mark.parametrize(
    "options",
    [
        {"clock": "wall"},
        {"model": "sts9999"},
        {"no_such": "1"},
        {"name": "a,b"},
        {"name": " "},
        {"faults": "x"},
    ],
)
def test_what_cannot_be_simulated_leaves_no_name(options: dict[str, str]) -> None:
    with pytest.raises(RequestError):
        servos(**{"name": "odd", **options})
    with pytest.raises(PortNotFound):
        find("odd", "feetech")


def test_one_host_at_a_time_and_the_next_one_finds_time_and_motors() -> None:
    with servos() as sim:
        first = sim.link()
        with pytest.raises(PortBusy):
            sim.link()
        ask(first, bytes.fromhex("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5"))
        first.read(first.now() + 5.0)
        left = first.now()
        first.close()
        first.close()
        second = sim.link()
        assert second.now() == left >= 5.0
        assert ask(second, bytes.fromhex("FF FF 01 04 02 28 01 CF")) == [
            bytes.fromhex("FF FF 01 03 00 01 FA")
        ]
    with pytest.raises(LinkLost):
        second.read(second.now())
    with pytest.raises(PortNotFound):
        sim.link()


def test_a_line_of_a_program_may_be_set_at_any_time() -> None:
    class Lost:
        def carry(self, *_: object) -> list[Any]:
            return []

    with servos() as sim:
        link = sim.link()
        assert ask(link) == [PONG_1]
        sim.line = Lost()
        assert ask(link) == []
        sim.faults = "exchange 1: duplicate"
        assert ask(link) == [PONG_1, PONG_1]
        sim.faults = ""
        assert ask(link) == [PONG_1]


def test_rate_pace_and_clock() -> None:
    with servos() as sim:
        link = sim.link(115_200)
        assert ask(link) == []
        link.close()
        sim.pace = True
        link = sim.link(1_000_000)
        start = link.now()
        assert ask(link) == [PONG_1]
        assert link.now() - start == pytest.approx(120e-6)
    with servos(clock="real") as sim:
        link = sim.link()
        assert not link.virtual
        assert ask(link) == [PONG_1]
        start = time.monotonic()
        sim.wait(sim.now + 0.05)
        assert time.monotonic() - start >= 0.05


def test_simulations_that_wait_for_the_same_moments_have_one_clock() -> None:
    with servos() as one, servos() as other:
        link = one.link()
        one.wait(2.0)
        other.wait(2.0)
        assert (one.now, other.now, link.now()) == (2.0, 2.0, 2.0)
        other.wait(1.0)
        assert other.now == 2.0


def test_a_closed_simulation_is_freed() -> None:
    sim = servos()
    with open_bus(sim.url):
        pass
    sim.close()
    seen = weakref.ref(sim)
    del sim
    gc.collect()
    assert seen() is None


# On a CAN channel.


class QueueLink:
    """What `link.can` would open: `arrive` puts a frame on the bus, `next_sent` takes a frame that was sent."""

    latency = 0.0
    name = "can://queue/0"

    def __init__(self) -> None:
        self.rate = 500_000
        self.no_wire = True
        self.closed = self.is_lost = False
        self._arrived: queue.Queue[CanFrame] = queue.Queue()
        self._sent: queue.Queue[object] = queue.Queue()

    def arrive(self, frame: CanFrame) -> None:
        self._arrived.put(frame)

    def next_sent(self) -> object:
        return self._sent.get(timeout=10.0)

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: object) -> None:
        if self.is_lost:
            raise LinkLost(f"{self.name} is gone")
        self._sent.put(data)

    def read(self, until: float) -> list[CanFrame]:
        try:
            return [self._arrived.get(timeout=max(1e-9, until - time.monotonic()))]
        except queue.Empty:
            return []

    def fileno(self) -> None:
        return None

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def channel(monkeypatch: pytest.MonkeyPatch) -> QueueLink:
    """The link that opens, whatever channel is asked for."""
    link = QueueLink()
    monkeypatch.setattr("motorbus.simulation.can_channel.open_can", lambda port, **options: link)
    return link


def test_devices_on_a_channel(channel: QueueLink) -> None:
    with can_servos(faults="exchange 3: drop") as sim:
        with sim.serve("can://virtual/here") as served:
            channel.arrive(CanFrame(0x626, READ_37.data))
            channel.arrive(READ_37)
            assert channel.next_sent() == POSITION_37
            for open_it in (sim.link, lambda: sim.serve("can://virtual/there")):
                with pytest.raises(PortBusy):
                    open_it()
            channel.arrive(READ_37)
            sim.faults = "exchange 1: duplicate"
            channel.arrive(READ_37)
            assert [channel.next_sent() for _ in range(2)] == [POSITION_37] * 2
            with pytest.raises(RequestError, match="cannot be unplugged"):
                sim.faults = "at 1 s: unplug 1"
            with served.still():
                sim[37].unplug()
            left = served.now()
        assert channel.closed
        assert sim.link().now() >= left


def test_faults_are_refused_where_real_devices_may_be(channel: QueueLink) -> None:
    channel.no_wire = False
    with can_servos(faults="1%: drop") as sim:
        with pytest.raises(RequestError, match="may have real devices"):
            sim.serve("can://socketcan/can0")
        assert channel.closed
        sim.faults = ""
        with sim.serve("can://socketcan/can0"), pytest.raises(RequestError, match="may have real devices"):
            sim.faults = "1%: drop"


def test_a_channel_is_for_devices_on_can_only(channel: QueueLink) -> None:
    with servos() as sim, pytest.raises(RequestError, match="do not speak CAN"):
        sim.serve("can://virtual/here")
    with can_servos() as sim, pytest.raises(RequestError, match="no CAN channel"):
        sim.serve("/dev/ttyACM0")


def test_a_channel_that_is_lost_is_an_error_of_the_thread(channel: QueueLink) -> None:
    with can_servos() as sim:
        served = sim.serve("can://virtual/here")
        channel.is_lost = True
        channel.arrive(READ_37)
        served._thread.join(10)
        with pytest.raises(LinkLost):
            served.close()


def test_a_python_can_program_of_this_process_reaches_the_servos() -> None:
    can = import_module("can")
    with (
        can_servos() as sim,
        sim.serve("can://virtual/new"),
        can.Bus(interface="virtual", channel="new") as bus,
    ):
        bus.send(can.Message(arbitration_id=0x625, is_extended_id=False, data=READ_37.data))
        message = bus.recv(20.0)
        assert (message.arbitration_id, bytes(message.data)) == (0x5A5, POSITION_37.data)
