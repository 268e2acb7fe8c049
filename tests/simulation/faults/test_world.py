"""What happens to a whole simulated bus happens at its moment, and what cannot happen is refused beforehand."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus import families
from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkLost, RequestError
from motorbus.families.stepper.wire import encode
from motorbus.link.base import Side
from motorbus.link.memory import MemoryLink
from motorbus.simulation.faults import Fault, FaultyLine, World

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


def test_at_a_byte_what_comes_before_has_arrived() -> None:
    link, _, _, port = host("exchange 1 byte 3 to host: unplug 0.5")
    assert asked(link, PING) == PONG  # this port only keeps a record
    assert port.pulls == [0.5]
    link, _, _, port = host("exchange 1 byte 3 to host: unplug 0.5")
    link.write(PING)
    assert link.read(1.0) == [PONG[:3]]
    assert port.pulls == []
    assert link.read(1.0) == [PONG[3:]]
    assert port.pulls == [0.5]


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


def test_a_second_kst_servo_says_something_else() -> None:
    link, world, _, _ = host("exchange 1: duplicate-id 0x25", "kst", (0x25,), duplicate_delay=0.0)
    world.nodes[0x25].raw_position = 300
    link.tune(500_000)
    link.write(CanFrame(0x625, bytes.fromhex("40 02 60 00 00 00 00 00")))
    frames = [piece for _ in range(30) for piece in link.read(link.now() + 0.1)]
    assert len(world.simulator.servos) == 2
    assert any(isinstance(frame, CanFrame) and frame.id >> 29 for frame in frames)


def test_a_torn_eeprom_is_what_the_switch_says() -> None:
    for torn, left in (("old", 1), ("new", 7), ("erased", 255)):
        script = "exchange 1: torn-eeprom 1"
        link, world, line, _ = host(script, torn=torn, torn_identity="unreachable", while_storing="answer")
        asked(link, UNLOCK)
        assert line.fired == []
        assert [str(one) for one in line.pending] == [script]
        asked(link, WRITE_ID, 1.0)
        assert [str(one) for one in line.record] == [script]
        assert line.pending == ()
        assert world.simulator.servos[0].id == left
        assert world.simulator.servos[0].lives > 1


def test_what_lies_in_wait_cuts_nothing_that_is_under_way() -> None:
    link, _, line, _ = host("exchange 1 byte 3 to host: torn-eeprom 1; exchange 2: torn-eeprom 1")
    for _ in range(2):
        sent = link.now()
        link.write(PING)
        assert link.read(1.0) == [PONG]
        assert link.now() - sent < 1e-6
    assert line.fired == []
    assert len(line.pending) == 2


def test_a_torn_save_of_other_families() -> None:
    link, world, line, _ = host("exchange 1: torn-eeprom 0x25", "kst", (0x25,), flash_cut="new")
    servo = world.nodes[0x25]
    servo.values["node_id"] = 0x26
    servo.flash.save(servo.values, 0.0, 0.3)
    assert servo.midway() == 0.15
    link.tune(500_000)
    link.write(CanFrame(0x625, bytes.fromhex("40 02 60 00 00 00 00 00")))
    link.read(1.0)
    assert list(world.nodes) == [0x26]
    assert round(line.fired[0].at, 6) == 0.15


@pytest.mark.parametrize(("save_cut", "left"), [("empty", False), ("old", True)])
def test_a_torn_save_of_a_project(save_cut: str, left: bool) -> None:
    link, world, line, _ = host(
        "exchange 1: torn-eeprom 1", "stepper", save_cut=save_cut, save_time=0.5, turnaround=0.01
    )
    link.tune(9600)
    world.nodes[1].put(1, world.nodes[1].store.project(1))
    assert any(world.nodes[1].store.stored[1][:220])
    link.write(encode("save_project", project=1))
    link.read(1.0)
    assert [str(one) for one in line.record] == ["exchange 1: torn-eeprom 1"]
    assert line.fired[0].at == pytest.approx(0.26, abs=1e-5)
    assert any(world.nodes[1].store.stored[1]) is left


def test_a_clock_step_makes_devices_older_and_nobody_hears_it() -> None:
    link, world, line, _ = host("exchange 2: clock-step 3600")
    servo = world.nodes[1]
    asked(link, PING)
    servo.memory["torque_enable"] = 1
    servo.memory["goal_position"] = 3000
    servo.move(world.simulator.now)
    assert asked(link, PING, 0.01) == PONG
    assert servo.raw_position == 3000
    assert link.now() < 1
    assert world.simulator.now > 3600
    assert asked(link, PING) == PONG
    assert len(line.fired) == 1


def test_what_reports_meanwhile_is_not_heard_afterwards() -> None:
    link, _, _, _ = host("exchange 1: clock-step 100", "kst", (0x25,), reports_ms=10)
    link.tune(500_000)
    before = [piece for _ in range(10) for piece in link.read(link.now() + 0.01)]
    link.write(CanFrame(0x000, bytes.fromhex("00 00")))
    after: list[object] = []
    while link.now() < 1.2:
        after += link.read(1.2)
    assert 5 <= len(before) <= 15
    assert 90 <= len(after) <= 130


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


def test_where_no_second_device_can_be_it_is_said_why_and_what_to_do() -> None:
    world = World(families.load("stepper").simulator((1,), ""))
    with pytest.raises(RequestError, match="no second device") as caught:
        world.check(Fault(1, None, "duplicate-id", node=1))
    assert "told apart by their ids" in caught.value.expected
    assert "alone on its line" in caught.value.cause
    assert "leave it out" in caught.value.advice


def test_forgetting_leaves_what_would_give_the_supply_back() -> None:
    link, world, _, _ = host("exchange 1: brown-out 0.2 1; at 1 s: power-cycle 1; exchange 1: torn-eeprom 1")
    asked(link, PING)
    world.forget()
    assert world.armed == ()
    world.nodes[1].memory["torque_enable"] = 1
    link.read(0.9)
    assert world.nodes[1].plugged
    world.nodes[1].memory["torque_enable"] = 1
    link.read(2.0)
    assert world.nodes[1].memory["torque_enable"] == 1


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
