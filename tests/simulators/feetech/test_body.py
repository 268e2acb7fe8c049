"""A servo that is pushed, blocked and cut off: what it shows, and what it finds when it comes back."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.simulator.servo import Servo
from tests.simulators.feetech.host import (
    ALL,
    CALIBRATE,
    PING,
    RESTORE,
    SYNC_WRITE,
    WRITE,
    Host,
    packet,
    word,
)

LOCK, TORQUE, POSITION = 55, 40, 42


def one(**options: object) -> tuple[Host, Servo]:
    """A host and its only servo."""
    host = Host(**options)
    return host, host.bus.nodes[1]


def unlocked(**options: object) -> tuple[Host, Servo]:
    """The same with the EEPROM lock open."""
    host, servo = one(**options)
    host.write(1, LOCK, 0)
    return host.wait(0.1), servo


# Walls and weights.


def test_a_wall_stops_it_off_its_goal_with_all_its_torque() -> None:
    host, servo = one()
    servo.blocked = (1000.0, 2500.0)
    host.write(1, POSITION, *word(3000))
    host.wait(0.5)
    assert (host.read(1, 56), host.read(1, 58), host.read(1, 66, 1)) == (
        2500,
        0,
        0,
    )  # stopped, says the moving flag
    assert (host.read(1, 60), host.read(1, 69)) == (1000, 500)
    servo.blocked = None
    host.wait(0.5)
    assert (host.read(1, 56), host.read(1, 60), host.read(1, 69)) == (3000, 0, 0)


@pytest.mark.parametrize(("limit", "load"), [(1000, 1000), (300, 300), (5, 0)])
def test_it_presses_with_what_the_torque_limit_allows(limit: int, load: int) -> None:
    host, servo = one()
    servo.blocked = (2000.0, 2100.0)
    host.write(1, 48, *word(limit))
    host.write(1, POSITION, *word(3000))
    host.wait(1.0)
    assert host.read(1, 60) == load


def test_the_goal_torque_of_an_hls_bounds_it_too() -> None:
    host = Host((1,), "hls3930", goal_at_power_up="present")
    servo = host.bus.nodes[1]
    servo.blocked = (2000.0, 2100.0)
    host.write(1, TORQUE, 1)
    host.write(1, POSITION, *word(3000), *word(100), *word(20))  # 100 units of 6.5 mA are 0.2 of 3.25 A
    host.wait(1.0)
    assert (host.read(1, 56), host.read(1, 60), host.read(1, 69)) == (2100, 200, 100)


def test_a_wall_put_into_the_way_and_onto_the_shaft() -> None:
    host, servo = one()
    host.write(1, POSITION, *word(3000), 0, 0, *word(1000))
    host.wait(0.2)
    servo.blocked = (0.0, 2300.0)
    host.wait(1.0)
    assert host.read(1, 56) == 2300
    servo.blocked = (0.0, 2200.0)  # it stands beyond it now, and may only come back
    host.wait(0.1)
    assert host.read(1, 56) == 2300
    host.write(1, POSITION, *word(2100))
    host.wait(1.0)
    assert host.read(1, 56) == 2100


def test_a_shaft_that_is_turned_back_into_a_wall_it_touches_comes_back() -> None:
    host, servo = one()
    host.write(1, POSITION, *word(3000))
    host.wait(0.2)
    host.write(1, POSITION, *word(2100))  # which is behind it
    servo.blocked = (0.0, servo.motion.position(host.now))
    host.wait(1.0)
    assert host.read(1, 56) == 2100


def test_a_wheel_at_a_wall_stalls_and_turns_back() -> None:
    host, servo = one()
    servo.blocked = (2000.0, 2500.0)
    host.write(1, 33, 1)
    host.write(1, TORQUE, 1)
    host.write(1, 46, *word(1000))
    host.wait(1.0)
    assert (servo.motion.position(host.now), host.read(1, 60)) == (2500.0, 1000)
    host.write(1, 46, *word(-1000))
    host.wait(0.2)
    assert servo.motion.position(host.now) < 2400


def test_a_weight_makes_it_slower_and_shows_in_load_and_current() -> None:
    host, servo = one(position=0)
    servo.torque = 0.5
    host.write(1, POSITION, *word(4000))
    host.wait(1.0)
    assert host.read(1, 58) == 1700  # half of the duty is left for speed
    assert (host.read(1, 60), host.read(1, 69)) == (1000, 273)  # 0.15 A and half of 3.25 A
    host.wait(2.0)
    assert host.read(1, 56) == 4000


@pytest.mark.parametrize(("switch", "place"), [("stays", 2048), ("yields", 2048 - 680)])
def test_more_torque_than_it_may_use(switch: str, place: int) -> None:
    host, servo = one(overpowered=switch, goal_at_power_up="present")
    host.write(1, 48, *word(500))
    host.write(1, TORQUE, 1)
    host.wait(0.1)
    servo.torque = 0.7  # 0.2 too much: 680 counts/s
    host.wait(1.0)
    ramp = 680 / 25_400 / 2  # s it loses while it gets as fast as that
    assert host.read(1, 56) == pytest.approx(place + (680 * ramp if switch == "yields" else 0), abs=1)
    assert host.read(1, 60) == 500


def test_where_shafts_yield_an_arm_falls_when_its_torque_is_off() -> None:
    host, servo = one(overpowered="yields", goal_at_power_up="present")
    host.write(1, TORQUE, 1)
    servo.torque = 0.3
    host.wait(1.0)
    assert host.read(1, 56) == 2048
    servo.blocked = (1500.0, 4000.0)
    host.write(1, TORQUE, 0)
    host.wait(0.2)
    assert 1500 < host.read(1, 56) < 2048
    host.wait(1.0)
    assert (host.read(1, 56), host.read(1, 60), host.read(1, 69)) == (1500, 0, 0)


def test_droop_by_hand() -> None:
    # SO-ARM100#134: 20 to 30 counts at half of the stall torque
    host, servo = one(droop=50)
    servo.torque = 0.5
    host.write(1, POSITION, *word(3000))
    host.wait(2.0)
    assert (host.read(1, 56), host.read(1, 66, 1)) == (2975, 0)
    servo.torque = -0.5
    host.wait(1.0)
    assert host.read(1, 56) == 3025


def test_backlash_by_hand() -> None:
    # 10 counts of play: it stops at the near side, does not stir within it, and lies where it is pushed
    host, servo = one(backlash=10)
    for goal, rests in ((3000, 2995), (2998, 2995), (2000, 2005), (3000, 2995)):
        host.write(1, POSITION, *word(goal))
        host.wait(2.0)
        assert host.read(1, 56) == rests
    servo.torque = -0.01
    host.wait(1.0)
    assert host.read(1, 56) == 3005


def test_the_lamp_shows_what_its_mask_names() -> None:
    host, servo = one()
    assert not servo.led
    servo.voltage = 12.0
    assert servo.led
    host.write(1, 20, 46)
    assert not servo.led


# Supplies that are cut.


def test_the_commits_of_a_write_are_told_and_done_when_it_is_acknowledged() -> None:
    host, servo = unlocked()
    host.bus.receive(packet(1, WRITE, 9, 1, 0, 2, 0), host.now)
    assert [(commit.address, commit.value) for commit in servo.memory.commits] == [
        (9, 1),
        (10, 0),
        (11, 2),
        (12, 0),
    ]
    moments = [commit.moment - host.now for commit in servo.memory.commits]
    assert moments == pytest.approx([0.005, 0.01, 0.015, 0.02])
    assert host.bus.due() == pytest.approx(host.now + 0.02)


def test_with_an_early_acknowledgement_they_come_after_it() -> None:
    host, servo = unlocked(eeprom_commit="after_ack")
    assert host.timed(packet(1, WRITE, 13, 60)) == [(0.0, "FF FF 01 02 00 FC")]
    assert len(servo.memory.commits) == 1
    servo.power_cycle()
    assert host.read(1, 13, 1) == 70


def test_anything_said_while_it_stores_is_acknowledged_when_it_is_done() -> None:
    host, _ = unlocked()
    host.say(packet(ALL, WRITE, 13, 60))  # a broadcast: no answer, and 20 ms of work
    host.wait(0.005)
    assert host.timed(packet(1, WRITE, 41, 5)) == [(0.015, "FF FF 01 02 00 FC")]
    host.wait(0.1)
    assert host.timed(packet(1, WRITE, 41, 5)) == [(0.0, "FF FF 01 02 00 FC")]


@pytest.mark.parametrize("torn", ["old", "new", "erased"])
@pytest.mark.parametrize("commits", [0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4])
def test_every_step_of_a_write_can_be_cut(commits: float, torn: str) -> None:
    host, servo = unlocked(torn=torn)
    old, new = (0, 0, 255, 15), (1, 2, 3, 4)
    servo.cut(commits)
    assert host.write(1, 9, *new) == []  # it never gets to the acknowledgement
    done = int(commits)
    cell = {"old": old, "new": new, "erased": (255, 255, 255, 255)}[torn]
    middle = [cell[done]] if commits % 1 else []
    expected = [*new[:done], *middle, *old[done + len(middle) :]]
    host.wait(0.1)
    assert list(servo.memory.stored[9:13]) == expected
    assert list(host.bus.nodes[1].memory.read(9, 4)) == expected
    assert sum(servo.memory.wear.values()) == done + len(middle)
    assert servo.locked  # as after any power-up
    assert host.write(1, 41, 7) == ["FF FF 01 02 00 FC"]  # it happens once


def test_a_cut_waits_for_enough_commits() -> None:
    host, servo = unlocked()
    servo.cut(3)
    assert len(host.write(1, 13, 60)) == 1
    assert len(host.wait(1.0).write(1, 14, 90)) == 1
    assert host.wait(1.0).write(1, 15, 30, 1) == []
    host.wait(1.0)
    assert (servo.memory["max_temperature"], servo.memory["max_voltage"], servo.memory["min_voltage"]) == (
        60,
        90,
        30,
    )


def test_an_unplugged_cable_is_a_cut_as_well() -> None:
    host, servo = unlocked()
    host.bus.receive(packet(1, WRITE, 13, 60), host.now)
    host.wait(0.01)
    servo.unplug()
    host.wait(1.0)
    servo.plug()
    assert (servo.memory["max_temperature"], servo.memory.commits) == (255, [])


@pytest.mark.parametrize(("switch", "reached"), [("default", [1]), ("unreachable", [])])
def test_a_torn_id_is_the_factory_one_or_unreachable(switch: str, reached: list[int]) -> None:
    host = Host((7,), torn_identity=switch)
    servo = host.bus.servos[0]
    host.write(7, LOCK, 0)
    servo.cut(0.5)
    host.write(7, 5, 9)
    host.wait(1.0)
    assert servo.memory.stored[5] == 255
    assert [id for id in range(254) if host.say(packet(id, PING))] == reached
    host.say(packet(ALL, SYNC_WRITE, 41, 1, 255, 9))
    assert host.say(packet(ALL, WRITE, LOCK, 0)) == []
    assert host.say(packet(ALL, WRITE, 5, 9)) == []  # a broadcast reaches it in any case
    host.wait(1.0)
    servo.power_cycle()
    assert host.say(packet(9, PING)) == ["FF FF 09 02 00 F4"]


def test_a_torn_rate_is_the_factory_one() -> None:
    host, servo = unlocked()
    servo.cut(0.5)
    host.write(1, 6, 4)
    host.wait(1.0)
    assert (servo.memory.stored[6], servo.baud_rate) == (255, 1_000_000)


def test_a_factory_restore_that_is_cut_leaves_half_of_it() -> None:
    host, servo = unlocked()
    host.write(1, 9, 5, 0)
    host.wait(1.0).write(1, 38, 5)
    host.wait(1.0)
    servo.cut(10)
    assert host.say(packet(1, RESTORE)) == ["FF FF 01 02 00 FC"]
    host.wait(5.0)
    assert (servo.memory["min_position_limit"], servo.memory["overcurrent_time"]) == (0, 5)


def test_a_calibration_is_stored_in_its_time_too() -> None:
    for data in (packet(1, WRITE, TORQUE, 128), packet(1, CALIBRATE)):
        host, servo = unlocked(position=3000)
        assert [at for at, _ in host.timed(data)] == [0.02]
        servo.power_cycle()
        assert host.read(1, 31) == 952


def test_a_reply_that_a_cut_meets_is_lost() -> None:
    host, servo = unlocked()
    servo.cut(1)
    assert host.write(1, 13, 60) == []
    assert servo.memory["max_temperature"] == 60  # stored, and nobody was told
