"""One cycle on one bus: what leaves, in which order and when, and what becomes of who is silent or was stopped."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from typing import Any

import pytest

from motorbus.bus.turns import Turns
from motorbus.core.operation import CanFrame, Effect, Exchange, Rank
from motorbus.errors import Interrupted, NoReply
from motorbus.motion.cycle import Part, silence, stopped, straight, train_of
from motorbus.motion.place import Place
from motorbus.session.robot import Robot
from tests.motion.machines import Heard, machine

PERIOD = 0.01


def part_of(robot: Robot, bus: str) -> Part:
    """All axes of a bus of an open machine, in a loop."""
    axes = [axis for axis in robot.axes.values() if axis.spec.bus == bus]
    face = robot.buses[bus]
    train = face.run(train_of(face, axes))  # type: ignore[attr-defined]
    return Part(face, robot.origins[bus], [Place(axis, None, PERIOD, False, None) for axis in axes], train)


@pytest.fixture
def arm() -> Iterator[tuple[Part, Any, Any]]:
    """Three servos on a serial line, its bus, and its simulation."""
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        yield part_of(robot, "arm"), robot.buses["arm"], sims["arm"]


def begun(part: Part, bus: Any, goal: float = 0.2) -> None:
    bus.run(part.begin(list(part.places.values())))
    for place in part.places.values():
        place.asked = goal
        place.judge(1)


def test_all_goals_in_one_packet_and_all_positions_in_another(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    begun(part, bus)
    sim.line = line = Heard()
    told = straight(bus, part.cycle(part.orders(1), part.now))
    assert [data[4] for data in line.sent if isinstance(data, bytes)] == [0x83, 0x82]  # SYNC WRITE, SYNC READ
    assert part.take(told) == []
    assert part.ended >= part.began > 0


def test_can_nodes_are_asked_and_told_at_the_same_time() -> None:
    with machine(can="0x21-0x23") as (made, sims), Robot.of(made) as robot:
        part, bus = part_of(robot, "can"), robot.buses["can"]
        begun(part, bus)
        assert part.abreast
        sims["can"].line = line = Heard()
        assert part.take(bus.run(part.cycle(part.orders(1), part.now))) == []  # type: ignore[attr-defined]
        frames = [data for data in line.sent if isinstance(data, CanFrame)]
        assert [frame.id - 0x600 for frame in frames[:3]] == [0x21, 0x22, 0x23]
        assert {frame.data[0] for frame in frames[:3]} == {0x22}  # goals first
        assert len(frames) == 6


def test_it_waits_for_its_slot(arm: tuple[Part, Any, Any]) -> None:
    part, bus, _ = arm
    straight(bus, part.cycle((), part.now + 0.25))
    assert part.began == pytest.approx(part.now, abs=0.01)
    began = part.began
    straight(bus, part.cycle((), 0.0))  # long ago: at once
    assert part.began - began < 0.01


def test_beginning_gives_torque_where_it_stands_and_a_speed_to_follow_with(
    arm: tuple[Part, Any, Any],
) -> None:
    part, bus, sim = arm
    places = list(part.places.values())
    bus.run(part.begin(places[:2]))
    assert [sim[node].memory["torque_enable"] for node in (1, 2, 3)] == [1, 1, 0]
    assert [place.begun for place in places] == [True, True, False]
    assert places[0].axis.engaged
    assert not places[2].axis.engaged
    assert places[0].sent == places[0].position == pytest.approx(0.0, abs=0.002)
    assert sim[1].memory["goal_velocity"] * 2 * pi / 4096 == pytest.approx(pi / 2, rel=0.01)


def test_a_servo_that_is_silent_costs_its_own_reading(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    part.take(straight(bus, part.cycle((), 0.0)))
    sim[2].unplug()
    for silent in (1, 2):
        assert part.take(straight(bus, part.cycle((), 0.0))) == ["a2"]
        assert [place.silent for place in part.places.values()] == [0, silent, 0]
    sim[2].plug()
    while part.take(straight(bus, part.cycle((), part.now + 0.1))):
        pass
    assert part.places[2].silent == 0


def test_a_can_node_that_is_silent_costs_its_own_reading() -> None:
    with machine(can="0x21-0x22") as (made, sims), Robot.of(made) as robot:
        part, bus = part_of(robot, "can"), robot.buses["can"]
        begun(part, bus)
        sims["can"][0x22].unplug()
        told = bus.run(part.cycle(part.orders(1), 0.0))  # type: ignore[attr-defined]
        assert part.take(told) == ["c2"]
        sims["can"][0x22].plug()


def test_no_order_leaves_after_a_stop_not_even_one_made_before(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    begun(part, bus)
    made = part.orders(1)
    bus.run(Exchange(b"\xff\xff\xfe\x04\x03\x28\x00\xd2", (), rank=Rank.STOP, effect=Effect.TORQUE))
    sim.line = line = Heard()
    with pytest.raises(Interrupted, match="a1: stopped from elsewhere"):
        straight(bus, part.cycle(made, 0.0))
    assert not line.sent
    assert [place.name for place in part.stopped()] == ["a1", "a2", "a3"]


def test_after_an_emergency_stop_everybody_counts_as_stopped(arm: tuple[Part, Any, Any]) -> None:
    part, bus, _ = arm
    assert part.stopped() == []
    begun(part, bus)
    assert part.stopped() == []
    turns: Turns = bus.turns
    turns.latched = True
    assert len(part.stopped()) == 3
    turns.reset()


def test_the_errors_name_the_axes() -> None:
    assert "a1, a2: stopped from elsewhere" in str(stopped(["a1", "a2"]))
    places: dict[str, Any] = {"a1": type("Heard", (), {"heard": 2.0})}
    error = silence(["a1"], 6, places, 2.5)
    assert isinstance(error, NoReply)
    assert "a1: no reading in 6 cycles" in str(error)
    assert "a1 for 0.5 s" in error.cause


def test_an_error_of_an_exchange_reaches_the_operation_on_the_short_way(arm: tuple[Part, Any, Any]) -> None:
    _, bus, _ = arm
    silent: Exchange[Any] = bus.family.probe(77, 0)

    def asks() -> Any:
        try:
            yield from silent
        except NoReply:
            return "caught"

    assert straight(bus, asks()) == "caught"
    with pytest.raises(NoReply):
        straight(bus, iter(silent))
