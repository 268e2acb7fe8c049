"""Simulated buses by name: who may open them, for how long, and what stays when a host leaves."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkLost, PortBusy, PortNotFound, RequestError
from motorbus.link.memory import MemoryLink
from motorbus.simulation.faults import FaultyLine
from motorbus.simulation.named import Simulation, find
from tests.simulation.links import QueueLink

PING_1 = bytes.fromhex("FF FF 01 02 01 FB")
PONG_1 = bytes.fromhex("FF FF 01 02 00 FC")


def simulation(*ids: int, **options: object) -> Simulation:
    return Simulation(families.load("feetech"), ids or (1,), **options)  # type: ignore[arg-type]


def asked(link: MemoryLink, request: bytes = PING_1) -> list[object]:
    link.write(request)
    return list(link.read(link.now() + 1.0))


def test_its_url_leads_to_it_until_it_is_closed() -> None:
    with simulation(name="arm") as sim:
        assert sim.url == "feetech:sim:arm"
        assert find("arm", "feetech") is sim
    with pytest.raises(PortNotFound) as caught:
        find("arm", "feetech")
    assert "simulate('feetech', name='arm')" in caught.value.advice


def test_a_wrong_name_is_told_the_live_ones() -> None:
    with simulation(name="arm"), simulation(name="leg"), pytest.raises(PortNotFound) as caught:
        find("tail", "feetech")
    assert "feetech:sim:arm, feetech:sim:leg" in caught.value.expected


def test_names_belong_to_a_family() -> None:
    with simulation(name="arm"), pytest.raises(PortNotFound):
        find("arm", "kst")


def test_without_a_name_each_gets_its_own() -> None:
    with simulation() as one, simulation() as other:
        assert one.url != other.url
        assert find(other.name, "feetech") is other


def test_a_name_that_is_taken() -> None:
    with simulation(name="arm"):
        with pytest.raises(RequestError, match="exists already"):
            simulation(name="arm")
        assert find("arm", "feetech").url == "feetech:sim:arm"


def test_the_nodes_are_at_hand() -> None:
    with simulation(1, 3) as sim:
        sim[3].unplug()
        assert asked(sim.link(), bytes.fromhex("FF FF 03 02 01 F9")) == []
        with pytest.raises(RequestError, match="no node 2"):
            sim[2]


def test_a_link_talks_to_it_in_virtual_time() -> None:
    with simulation() as sim:
        link = sim.link()
        assert link.virtual
        assert link.simulated
        assert asked(link) == [PONG_1]


def test_one_host_at_a_time() -> None:
    with simulation() as sim:
        link = sim.link()
        with pytest.raises(PortBusy):
            sim.link()
        link.close()
        link.close()
        assert asked(sim.link()) == [PONG_1]


def test_the_next_host_finds_time_and_motors_where_the_last_left_them() -> None:
    with simulation() as sim:
        first = sim.link()
        asked(first, bytes.fromhex("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5"))
        first.read(first.now() + 5.0)
        left = first.now()
        first.close()
        second = sim.link()
        assert second.now() == left >= 5.0
        assert asked(second, bytes.fromhex("FF FF 01 04 02 28 01 CF")) == [
            bytes.fromhex("FF FF 01 03 00 01 FA")
        ]


def test_a_closed_simulation_cannot_be_opened_and_kills_its_link() -> None:
    sim = simulation()
    link = sim.link()
    sim.close()
    sim.close()
    with pytest.raises(LinkLost):
        link.read(link.now())
    with pytest.raises(PortNotFound):
        sim.link()


def test_the_line_can_be_changed_at_any_time() -> None:
    with simulation() as sim:
        sim.line = FaultyLine("exchange 1 byte 5: corrupt 01")
        link = sim.link()
        assert asked(link) == [bytes.fromhex("FF FF 01 02 00 FD")]
        sim.line = FaultyLine("exchange 1 byte 0: truncate")
        assert asked(link) == []
        assert sim.line is link.line


def test_the_rate_is_the_hosts() -> None:
    with simulation() as sim:
        link = sim.link(115_200)
        assert asked(link) == []
        link.close()
        assert asked(sim.link(1_000_000)) == [PONG_1]


def test_the_real_clock_and_the_pace_of_the_wire() -> None:
    with simulation(clock="real") as sim:
        assert asked(sim.link()) == [PONG_1]
    with simulation() as sim:
        sim.pace = True
        link = sim.link(1_000_000)
        began = link.now()
        assert asked(link) == [PONG_1]
        assert link.now() - began == pytest.approx(120e-6)


def test_an_impossible_clock_model_and_option() -> None:
    for wrong in ({"clock": "wall"}, {"model": "sts9999"}, {"no_such": "1"}):
        with pytest.raises(RequestError):
            simulation(**wrong)


# On a CAN channel of somebody else.


@pytest.fixture
def channel(monkeypatch: pytest.MonkeyPatch) -> QueueLink:
    """What opens, whatever channel is asked for."""
    link = QueueLink()
    monkeypatch.setattr("motorbus.link.url.open_can", lambda port, **options: link)
    return link


def servos(*ids: int, **options: object) -> Simulation:
    return Simulation(families.load("kst"), ids, **options)  # type: ignore[arg-type]


READ_37 = CanFrame(0x625, bytes.fromhex("40 02 60 00 00 00 00 00"))
POSITION_37 = CanFrame(0x5A5, bytes.fromhex("4B 02 60 00 00 00 00 00"))


def test_can_devices_can_be_put_on_a_channel(channel: QueueLink) -> None:
    with servos(37) as sim, sim.serve("can://virtual/here"):
        channel.arrive(READ_37)
        assert channel.next_sent() == POSITION_37
    assert channel.closed


def test_a_simulation_that_is_served_is_open(channel: QueueLink) -> None:
    with servos(37) as sim:
        with sim.serve("can://virtual/here"):
            for open_it in (sim.link, lambda: sim.serve("can://virtual/there")):
                with pytest.raises(PortBusy):
                    open_it()
        link = sim.link()
        with pytest.raises(PortBusy):
            sim.serve("can://virtual/here")
        link.close()


def test_it_may_be_served_again_and_time_goes_on(channel: QueueLink) -> None:
    with servos(37) as sim:
        with sim.serve("can://virtual/here") as served:
            left = served.now()
        link = sim.link()
        assert left <= link.now()
        link.close()


def test_closing_the_simulation_ends_it(channel: QueueLink) -> None:
    sim = servos(37)
    sim.serve("can://virtual/here")
    sim.close()
    assert channel.closed
    with pytest.raises(PortNotFound):
        sim.serve("can://virtual/here")


def test_simulations_that_wait_for_the_same_moments_have_one_clock() -> None:
    with simulation() as one, simulation() as other:
        link = one.link()
        one.wait(2.0)
        other.wait(2.0)
        assert (one.now, other.now, link.now()) == (2.0, 2.0, 2.0)
        assert asked(other.link()) == [PONG_1]
        other.wait(1.0)
        assert other.now >= 2.0


def test_a_real_clock_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr("motorbus.simulation.named.time.sleep", slept.append)
    with simulation(clock="real") as sim:
        sim.wait(sim.now - 1.0)
        sim.wait(sim.now + 5.0)
    assert slept == [pytest.approx(5.0, abs=0.5)]
