"""What happens to a whole simulated bus happens at its moment, and what cannot happen is refused beforehand."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus import families
from motorbus.errors import LinkLost, RequestError
from motorbus.link.base import Side
from motorbus.link.memory import MemoryLink
from motorbus.simulation.faults import FaultyLine, World

PING, PONG = bytes.fromhex("FFFF 01 02 01 FB"), bytes.fromhex("FFFF 01 02 00 FC")
WRITE_ID = bytes.fromhex("FFFF 01 04 03 05 07 EB")
UNLOCK = bytes.fromhex("FFFF 01 04 03 37 00 C0")


class Pulled:
    """A port that keeps when it was pulled."""

    def __init__(self) -> None:
        self.pulls: list[float] = []

    def unplug(self, *, seconds: float) -> None:
        self.pulls.append(seconds)


def host(script: str, family: str = "feetech", ids: tuple[int, ...] = (1,), **options: object) -> Any:
    """A link to simulated devices to which this happens, and its world and line."""
    port = Pulled()
    world = World(families.load(family).simulator(ids, "", **options), port=port)
    line = FaultyLine(script, world)
    link = MemoryLink(world, line=line)
    return link, world, line, port


def asked(link: MemoryLink, data: bytes, patience: float = 0.05) -> bytes:
    link.write(data)
    got, end = b"", link.now() + patience
    while link.now() < end:
        got += b"".join(bytes(piece) for piece in link.read(end) if isinstance(piece, bytes))
    return got


def test_without_events_it_is_the_simulator() -> None:
    link, world, line, _ = host("")
    assert asked(link, PING) == PONG
    assert world.nodes[1].id == 1
    assert line.fired == []


def test_a_power_cycle_comes_before_the_request_of_its_exchange() -> None:
    link, world, line, _ = host("exchange 2: power-cycle 1")
    world.nodes[1].memory["torque_enable"] = 1
    assert asked(link, PING) == PONG
    assert world.nodes[1].memory["torque_enable"] == 1
    assert asked(link, PING) == PONG
    assert world.nodes[1].memory["torque_enable"] == 0
    assert str(line.record) == "exchange 2: power-cycle 1"


def test_a_brown_out_is_silence_and_then_a_start_anew() -> None:
    link, world, line, _ = host("exchange 2: brown-out 0.2 1", ids=(1, 2))
    servo = world.nodes[1]
    servo.memory["torque_enable"] = world.nodes[2].memory["torque_enable"] = 1
    assert asked(link, PING) == PONG
    assert asked(link, PING) == b""
    assert not servo.plugged
    assert asked(link, PING, 0.5) == b""
    assert servo.plugged
    assert asked(link, PING) == PONG
    assert (servo.memory["torque_enable"], world.nodes[2].memory["torque_enable"]) == (0, 1)
    assert len(line.fired) == 1


@pytest.mark.parametrize("action", ["brown-out 0.1", "power-cycle all"])
def test_of_all_devices(action: str) -> None:
    link, world, _, _ = host(f"exchange 1: {action}", ids=(1, 2))
    for node in world.nodes.values():
        node.memory["torque_enable"] = 1
    asked(link, PING, 1.0)
    assert [node.memory["torque_enable"] for node in world.nodes.values()] == [0, 0]
    assert asked(link, PING) == PONG


def test_at_a_moment_devices_suffer_though_nobody_says_anything() -> None:
    link, world, line, _ = host("at 2.5 s: power-cycle 1")
    world.nodes[1].memory["torque_enable"] = 1
    assert [str(one) for one in line.pending] == ["at 2.5 s: power-cycle 1"]
    link.read(2.4)
    assert world.nodes[1].memory["torque_enable"] == 1
    link.read(2.6)
    assert world.nodes[1].memory["torque_enable"] == 0
    assert [(fired.at, fired.to) for fired in line.fired] == [(2.5, Side.DEVICE)]
    assert line.pending == ()


def test_a_second_servo_answers_too() -> None:
    link, world, _, _ = host("exchange 2: duplicate-id 1")
    assert asked(link, PING) == PONG
    first = world.simulator.servos[0]
    first.memory["status_return_level"] = 1
    assert asked(link, PING) != PONG  # the second reply garbles the first
    first.memory["return_delay"] = 250
    assert asked(link, PING) == PONG + PONG
    assert len(world.simulator.servos) == 2


def test_a_torn_eeprom_is_what_the_switch_says() -> None:
    for torn, left in (("old", 1), ("new", 7), ("erased", 1)):
        script = "exchange 1: torn-eeprom 1"
        link, world, line, _ = host(script, torn=torn)
        asked(link, UNLOCK)
        assert line.fired == []
        assert [str(one) for one in line.pending] == [script]
        asked(link, WRITE_ID, 1.0)
        assert [str(one) for one in line.record] == [script]
        assert line.pending == ()
        assert world.simulator.servos[0].id == left
        assert world.simulator.servos[0].lives > 1


@pytest.mark.parametrize(
    ("family", "fault", "why"),
    [
        ("stepper", "duplicate-id 1", "no second device"),
        ("feetech", "power-cycle 9", "no node 9"),
        ("feetech", "brown-out 1 9", "no node 9"),
        ("feetech", "torn-eeprom 9", "no node 9"),
        ("feetech", "unplug 1", "no port .*because"),
    ],
)
def test_what_cannot_happen_is_refused(family: str, fault: str, why: str) -> None:
    world = World(families.load(family).simulator((1,), ""), why="because")
    with pytest.raises(RequestError, match=f"(?s){why}"):
        FaultyLine(f"exchange 1: {fault}", world)


def test_an_unplugged_link_is_lost() -> None:
    world = World(families.load("feetech").simulator((1,), ""))

    class Port:
        def unplug(self, *, seconds: float) -> None:
            link.unplug()

    world.port = Port()
    link = MemoryLink(world, line=FaultyLine("exchange 2: unplug 1", world))
    assert asked(link, PING) == PONG
    link.write(PING)
    with pytest.raises(LinkLost):
        link.read(1.0)
