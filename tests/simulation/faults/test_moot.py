"""What would change nothing does not count as having happened: a place stays pending, chance passes by."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.core.operation import CanFrame, Data
from motorbus.link.base import Side
from motorbus.simulation.faults import FaultyLine, World

FRAME = CanFrame(0x581, bytes(8))


def told(script: str, *packets: Data) -> FaultyLine:
    line = FaultyLine(script)
    line.carry(Side.HOST, b"\x01", 0.5)
    for number, packet in enumerate(packets, start=1):
        line.carry(Side.DEVICE, packet, float(number))
    return line


@pytest.mark.parametrize("packet", [FRAME, b"\x07"])
@pytest.mark.parametrize("script", ["exchange 1: split", "at 0 s: split 0.1"])
def test_what_cannot_be_split(packet: Data, script: str) -> None:
    line = told(script, packet)
    assert (line.fired, [str(fault) for fault in line.pending]) == ([], [script])
    assert told("100%: split", packet).fired == []
    assert len(told(script, b"\x07\x08").fired) == 1


def test_a_moment_waits_for_a_packet_that_can_be_split() -> None:
    line = told("at 0 s: split", b"\x07", b"\x07\x08", b"\x07\x08")
    assert [one.fault for one in line.fired] == ["exchange 1 packet 2: split"]


def test_what_is_lost_suffers_no_more() -> None:
    line = told(
        "exchange 1 byte 1: truncate; exchange 1 packet 2: drop; 100%: duplicate", b"\x01\x02", b"\x03"
    )
    assert [one.fault for one in line.fired] == ["exchange 1: duplicate", "exchange 1 byte 1: truncate"]
    assert [str(fault) for fault in line.pending] == ["exchange 1 packet 2: drop"]


@pytest.mark.parametrize("script", ["exchange 1: power-cycle 2", "at 0 s: brown-out 0.1 2"])
def test_a_device_whose_id_is_another_one_by_now(script: str) -> None:
    simulator = families.load("feetech").simulator((1, 2))
    world = World(simulator)
    line = FaultyLine(script, world)
    simulator.nodes[2].memory["id"] = 3  # type: ignore[index]
    simulator._forget_ids()  # type: ignore[attr-defined]
    assert 2 not in world.nodes
    line.carry(Side.HOST, bytes.fromhex("FFFF010201FB"), 0.5)
    world.advance(1.0)
    assert (line.fired, [str(fault) for fault in line.pending]) == ([], [script])
