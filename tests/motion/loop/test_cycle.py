"""One cycle on one bus: what leaves, in which order and when, and what becomes of who is silent or was stopped."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from typing import Any

import pytest

from motorbus.bus.turns import Turns
from motorbus.core.operation import CanFrame, Effect, Exchange, Rank
from motorbus.errors import Interrupted, NoReply
from motorbus.motion.command import Command
from motorbus.motion.loop.cycle import Part, train_of
from motorbus.motion.loop.errors import silence, stopped
from motorbus.motion.loop.place import Place
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


def cycle(part: Part, bus: Any, orders: Any = (), moment: float = 0.0) -> Any:
    """One cycle, and what came of each exchange."""
    return bus.run(part.cycle(orders, moment))


def begun(part: Part, bus: Any, goal: float = 0.2) -> None:
    bus.run(part.begin(list(part.places.values())))
    for place in part.places.values():
        place.asked = goal
        place.judge(1)


def test_all_goals_in_one_packet_and_all_positions_in_another(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    begun(part, bus)
    sim.line = line = Heard()
    told = cycle(part, bus, part.orders(1), part.now)
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
    cycle(part, bus, moment=part.now + 0.25)
    assert part.began == pytest.approx(part.now, abs=0.01)
    began = part.began
    cycle(part, bus)  # long ago: at once
    assert part.began - began < 0.01


def test_by_the_short_way_it_is_the_same(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    begun(part, bus)
    sim[2].unplug()
    sim.line = line = Heard()
    moment = part.now + 0.25
    assert part.take(part.at_once(bus, part.orders(1), moment)) == ["a2"]
    assert part.ended > part.began >= moment
    assert [data[4] for data in line.sent[:2] if isinstance(data, bytes)] == [0x83, 0x82]
    sim[2].plug()


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


def test_beginning_sets_the_cap_of_the_machine_file() -> None:
    with machine(arm="1", torque=0.4) as (made, sims), Robot.of(made) as robot:
        part, bus = part_of(robot, "arm"), robot.buses["arm"]
        begun(part, bus)
        assert sims["arm"][1].memory["torque_limit"] == 400


def test_the_command_over_who_begins_is_that_from_when_its_goal_was_set(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    places = list(part.places.values())[:2]
    for place in places:
        place.claim = Command((place.axis,))
    places[0].axis.orders += 1  # somebody tells it something before this gets to its bus
    sim.line = line = Heard()
    with pytest.raises(Interrupted, match="^a1: stopped from elsewhere"):
        bus.run(part.begin(places))
    assert not line.sent
    assert not any(place.begun for place in places)


def test_who_cannot_begin_goes_nowhere_and_is_led_by_nobody(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    sim[2].unplug()
    with pytest.raises(NoReply):
        bus.run(part.begin(list(part.places.values())))
    assert not any(place.begun or place.axis.under_way for place in part.places.values())
    assert part.places[1].axis.engaged  # it may have torque
    assert part.command.axes == ()
    sim[2].plug()


def test_a_servo_that_is_silent_costs_its_own_reading(arm: tuple[Part, Any, Any]) -> None:
    part, bus, sim = arm
    part.take(cycle(part, bus))
    sim[2].unplug()
    for silent in (1, 2):
        assert part.take(cycle(part, bus)) == ["a2"]
        assert [place.silent for place in part.places.values()] == [0, silent, 0]
    sim[2].plug()
    while part.take(told := cycle(part, bus, moment=part.now + 0.1)):
        pass
    assert part.places[2].silent == 0
    assert part.heard(told) == {place.name: place.heard for place in part.places.values()}


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
    with pytest.raises(Interrupted, match="a1: the movement was ended by another order"):
        cycle(part, bus, made)
    assert not line.sent
    assert part.release_lost() == ["a1", "a2", "a3"]
    assert part.orders(1) == ()


def test_who_was_told_something_is_led_no_more_and_the_others_are(arm: tuple[Part, Any, Any]) -> None:
    part, bus, _ = arm
    begun(part, bus)
    assert part.release_lost() == []
    axis: Any = part.places[2].axis
    axis.stop()
    assert part.command.lost() is not None
    assert part.release_lost() == ["a2"]
    assert part.command.lost() is None
    assert [goal.node for exchange in part.orders(1) for goal in exchange.goals] == [1, 3]
    bus.run(part.begin([part.places[2]]))  # and comes back
    part.places[1].axis.departs()
    assert part.release_lost() == ["a1"]
    part.places[2].axis.departs()
    assert part.release_lost() == ["a2"]


def test_after_an_emergency_stop_everybody_counts_as_stopped(arm: tuple[Part, Any, Any]) -> None:
    part, bus, _ = arm
    begun(part, bus)
    assert part.release_lost() == []
    turns: Turns = bus.turns
    turns.latched = True
    assert part.release_lost() == ["a1", "a2", "a3"]
    turns.reset()


def test_who_is_held_back_stays_and_the_others_go_on() -> None:
    with machine(arm="1-2", axes={"a2": {"max_step": "1 deg"}}) as (made, _), Robot.of(made) as robot:
        part, bus = part_of(robot, "arm"), robot.buses["arm"]
        begun(part, bus)
        before = part.places[2].sent
        part.places[2].position = -0.1
        (order,) = part.orders(3)
        assert part.places[1].sent > 0.002  # type: ignore[operator]
        assert part.places[2].sent == before
        assert order.goals[1].value == pytest.approx(part.places[2].stay(), abs=0.002)
        assert ["a2: the goal" in str(error) for error in part.refused] == [True]


def test_the_errors_name_the_axes() -> None:
    assert "a1, a2: stopped from elsewhere" in str(stopped(["a1", "a2"]))
    places: dict[str, Any] = {"a1": type("Heard", (), {"heard": 2.0})}
    error = silence(["a1"], 6, places, 2.5)
    assert isinstance(error, NoReply)
    assert "a1: no reading in 6 cycles" in str(error)
    assert "a1 for 0.5 s" in error.cause
