"""Plans against the world, by hand: a torque that takes its part of the speed, walls, and a motor that gives in."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.core.plant import Drive, Motion, move, rest, run
from motorbus.families.feetech.simulator.effort import Carried, Load, World, carried_out, loads
from motorbus.families.feetech.simulator.motor import Settings
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import Mode

DRIVE = Drive(top_speed=1000.0, idle_current=0.1, stall_current=2.0)


def going(
    way: float, speed: float = 1000.0, mode: Mode = Mode.POSITION, duty: float = 0.0, **world: object
) -> Carried:
    """A way from 0 at a speed, with no inertia, in a world."""
    torque = float(str(world.pop("available", 1.0)))
    switches = Switches(**{name: world.pop(name) for name in ("overpowered", "droop") if name in world})  # type: ignore[arg-type]

    def plan(drive: Drive) -> Motion:
        if mode in (Mode.VELOCITY, Mode.PWM, Mode.CURRENT):
            return run(0.0, 0.0, max(-drive.top_speed, min(drive.top_speed, way)))
        return move(0.0, 0.0, way, speed=min(speed, drive.top_speed))

    wanted = Settings(torque=torque, burden=0.0, mode=mode, duty=duty, current=duty)
    return carried_out(plan, wanted, World(**world), 0.0, DRIVE, switches)  # type: ignore[arg-type]


def test_nothing_in_the_way_leaves_the_plan_alone() -> None:
    assert going(500.0) == Carried(move(0.0, 0.0, 500.0, speed=1000.0))


@pytest.mark.parametrize(
    ("way", "torque", "available", "time"),
    [
        (500.0, 0.5, 1.0, 1.0),  # half of the duty is torque, half of it speed
        (-500.0, -0.5, 1.0, 1.0),
        (500.0, -0.5, 1.0, 0.5),  # helped: no faster than asked for
        (500.0, 0.0, 0.25, 2.0),  # a torque limit is a speed limit
        (500.0, 0.25, 0.75, 1.0),
    ],
)
def test_speed_and_torque_share_the_duty(way: float, torque: float, available: float, time: float) -> None:
    carried = going(way, torque=torque, available=available)
    assert (carried.motion.goal, carried.push) == (way, None)
    assert carried.motion.done_at == pytest.approx(time)


def test_a_slow_way_is_as_slow_under_a_burden() -> None:
    assert going(500.0, speed=100.0, torque=0.5).motion.done_at == 5.0


def test_against_more_than_it_may_use_it_stays_and_pushes_with_all_it_has() -> None:
    carried = going(500.0, torque=0.6, available=0.5)
    assert carried == Carried(rest(0.0, 0.0), 0.5)
    assert going(-500.0, torque=-0.6, available=0.5) == Carried(rest(0.0, 0.0), -0.5)


def test_or_it_is_pushed_along_by_what_it_cannot_hold() -> None:
    carried = going(500.0, torque=0.6, available=0.5, overpowered="yields")
    assert (round(carried.motion.cruise, 9), carried.push) == (-100.0, 0.5)


def test_holding_is_no_way_and_can_be_too_much_as_well() -> None:
    assert going(0.0, torque=0.6, available=0.5).motion == rest(0.0, 0.0)
    assert going(0.0, torque=0.6, available=0.5, overpowered="yields").motion.cruise == pytest.approx(-100.0)
    assert going(0.0, torque=0.4, available=0.5, overpowered="yields").motion.cruise == 0.0


def test_a_limp_shaft_stays_or_goes_where_it_is_pushed() -> None:
    assert going(0.0, torque=0.6, available=0.0).motion.cruise == 0.0
    carried = going(0.0, torque=0.6, available=0.0, overpowered="yields")
    assert (round(carried.motion.cruise, 9), carried.push) == (-600.0, 0.0)


def test_a_wall_ends_the_way_and_is_pressed_with_all_it_may_use() -> None:
    carried = going(500.0, speed=100.0, blocked=(-50.0, 200.0))
    assert (carried.motion.done_at, carried.motion.goal, carried.push) == (2.0, 200.0, 1.0)
    assert going(-500.0, speed=100.0, blocked=(-50.0, 200.0), available=0.4).push == -0.4


def test_with_a_droop_it_presses_as_hard_as_it_is_far_off() -> None:
    # all of it at 50 counts off, so half of it at 25
    assert going(225.0, blocked=(0.0, 200.0), droop=50.0).push == 0.5
    assert going(500.0, blocked=(0.0, 200.0), droop=50.0).push == 1.0


def test_a_wheel_a_duty_and_a_current_press_as_they_are_told() -> None:
    blocked = (-100.0, 100.0)
    assert going(-300.0, mode=Mode.VELOCITY, blocked=blocked).push == -1.0
    assert going(300.0, mode=Mode.PWM, duty=0.3, blocked=blocked).push == 0.3
    assert going(-1000.0, mode=Mode.CURRENT, duty=-0.7, blocked=blocked).push == -0.7


def test_a_wall_in_an_overshoot_is_left_again() -> None:
    plan = move(0.0, 0.0, 10.0, velocity=100.0, speed=100.0, acceleration=100.0)
    carried = carried_out(
        lambda drive: plan, Settings(torque=1.0), World(blocked=(-inf, 30.0)), 0.0, DRIVE, Switches()
    )
    assert carried.push is None
    assert carried.again == carried.motion.done_at == pytest.approx(1 - 0.4**0.5)


@pytest.mark.parametrize("ahead", [0.0, 1e-13])
def test_a_wall_nearer_than_the_clock_can_tell_is_reached_at_once(ahead: float) -> None:
    """Otherwise the moment at which it thinks again would not pass, and come for ever."""
    at, wall = 100.0, 30.0
    plan = move(at, wall - ahead, 10.0, velocity=100.0, speed=100.0, acceleration=100.0)
    carried = carried_out(
        lambda drive: plan, Settings(torque=1.0), World(blocked=(-inf, wall)), at, DRIVE, Switches()
    )
    assert carried == Carried(rest(at, wall), None, at)


@pytest.mark.parametrize(
    ("torque", "cruise", "push"),
    [(0.2, 300.0, None), (-0.2, 700.0, None), (0.5, 0.0, 0.5), (0.8, 0.0, 0.5)],
)
def test_a_duty_turns_with_what_is_left_of_it(torque: float, cruise: float, push: float | None) -> None:
    carried = going(500.0, mode=Mode.PWM, duty=0.5, torque=torque)
    assert (round(carried.motion.cruise, 9), carried.push) == (cruise, push)


def test_a_duty_that_is_overcome_turns_back_where_shafts_yield() -> None:
    carried = going(500.0, mode=Mode.PWM, duty=0.5, torque=0.8, overpowered="yields")
    assert (round(carried.motion.cruise, 9), carried.push) == (-300.0, 0.5)


def test_loads_by_hand() -> None:
    # 0.5 s up to 500 counts/s, 1 s along, 0.5 s down; a fifth of the stall torque all the while
    motion = move(1.0, 0.0, 750.0, speed=500.0, acceleration=1000.0)
    found = list(loads(motion, None, World(torque=0.2), 1.0, DRIVE, 1.0))
    assert [(load.begin, load.end) for load in found] == [(1.0, 1.5), (1.5, 2.5), (2.5, 3.0), (3.0, inf)]
    assert [load.duty for load in found] == pytest.approx([0.2, 0.7, 0.7, 0.2])
    assert [load.slope for load in found] == [1.0, 0.0, -1.0, 0.0]
    assert [load.current for load in found] == pytest.approx([0.5, 0.5, 0.5, 0.4])
    assert {load.torque for load in found} == {0.2}


def test_loads_of_one_who_presses_end_in_that() -> None:
    motion = Motion(0.0, (), 10.0)
    assert list(loads(motion, -0.5, World(), 1.0, DRIVE, 0.0)) == [Load(0.0, inf, -0.5, 0.0, -1.0, -0.5)]


def test_no_more_torque_is_given_than_is_available() -> None:
    (held,) = loads(rest(0.0, 0.0), None, World(torque=0.9), 0.2, DRIVE, 0.0)
    assert (held.torque, held.current) == (0.2, 0.4)
