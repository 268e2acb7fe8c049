"""A memory link gets its faults in one call, and what cannot be there is refused."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.errors import LinkLost, RequestError
from motorbus.link.memory import MemoryLink
from motorbus.simulation.faults import strike

PING, PONG = bytes.fromhex("FFFF 01 02 01 FB"), bytes.fromhex("FFFF 01 02 00 FC")


def asked(link: MemoryLink) -> bytes:
    link.write(PING)
    return b"".join(piece for piece in link.read(link.now() + 0.05) if isinstance(piece, bytes))


def test_line_and_world_are_in_place() -> None:
    link = MemoryLink(families.load("feetech").simulator((1,), ""))
    link.advance(5.0)
    line = strike(link, "exchange 1 byte 5: corrupt 01; at 1 s: power-cycle 1; exchange 3: unplug 1")
    link.simulator.nodes[1].memory  # noqa: B018 - the devices are still at hand
    assert asked(link) == PONG[:5] + b"\xfd"
    link.advance(2.0)
    assert asked(link) == PONG
    link.write(PING)
    with pytest.raises(LinkLost):
        link.read(link.now() + 0.1)
    assert [fired.fault for fired in line.fired] == [
        "exchange 1 byte 5: corrupt 01",
        "at 1 s: power-cycle 1",
        "exchange 3: unplug 1",
    ]
    assert line.fired[1].at == pytest.approx(6.0)


def test_there_is_no_adapter_here() -> None:
    link = MemoryLink(families.load("kst").simulator((1,), ""))
    before = link.line
    with pytest.raises(RequestError, match="text of an adapter"):
        strike(link, "exchange 1 on adapter: drop")
    assert link.line is before
