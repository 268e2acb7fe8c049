"""Calibrating, clearing turns and restoring in every map, and what a host sees of it afterwards."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.simulator.effects import concerned
from motorbus.families.feetech.table import TABLES
from tests.simulators.feetech.host import CALIBRATE, CLEAR_TURNS, RESTORE, Host, packet, word
from tests.simulators.feetech.test_maps import LOCK, USUAL, host_of

TORQUE, GOAL, VELOCITY, PRESENT = 40, 42, 46, 56
ACK = ["FF FF 01 02 00 FC"]


def far_host(model: str, **options: object) -> Host:
    """A servo more than two turns from where it began."""
    host = Host((1,), model, position=100, zero_velocity="maximum", **options)
    host.write(1, 9, 0, 0, 0, 0)
    host.write(1, 18, host.read(1, 18, 1) | 16)
    host.write(1, TORQUE, 1)
    host.write(1, GOAL, *word(10_000))
    host.wait(30.0)
    assert host.read(1, PRESENT) == 10_000
    return host


# 0x0A.


@pytest.mark.parametrize("model", ["hls3925", "sts3045bl", "sm30bl"])
def test_0x0a_clears_the_turns_of_those_who_know_it(model: str) -> None:
    host = far_host(model)
    assert host.say(packet(1, CLEAR_TURNS)) == ACK
    assert host.read(1, PRESENT) == 10_000 % 4096
    assert host.wait(5.0).read(1, PRESENT) == 10_000 % 4096  # and it holds there


def test_0x0a_is_ignored_by_an_sts3215_unless_asked_for() -> None:
    host = far_host("sts3215")
    assert host.say(packet(1, CLEAR_TURNS)) == []
    assert host.read(1, PRESENT) == 10_000
    host = far_host("sts3215", clear_turns="accept")
    assert host.say(packet(1, CLEAR_TURNS)) == ACK
    assert host.read(1, PRESENT) == 10_000 % 4096
    assert far_host("hls3925", clear_turns="ignore").say(packet(1, CLEAR_TURNS)) == []


# 0x0B.


@pytest.mark.parametrize(
    ("switch", "maps"),
    [("by_map", {"sts", "hls"}), ("accept", set(TABLES) - {"scs"}), ("ignore", set())],
)
def test_who_obeys_0x0b(switch: str, maps: set[str]) -> None:
    for name in TABLES:
        host = host_of(name, position=540, calibrate=switch)
        assert (host.say(packet(1, CALIBRATE)) == ACK) is (name in maps), name
        expected = TABLES[name]["present_position"]
        middle = 1024 // 2 if expected.order == "big" else 2048
        assert host.bus.nodes[1].raw_position == (middle if name in maps else 540)


def test_0x0b_takes_its_position_in_the_byte_order_of_the_servo() -> None:
    host = Host((1,), "scs215-2", position=540, calibrate="accept")
    assert host.say(packet(1, CALIBRATE, 0x02, 0x58)) == ACK  # 600
    assert host.bus.nodes[1].raw_position == 600
    assert host.read(1, 34, 1) == 60 | 0x80


def test_what_one_byte_cannot_say_is_as_near_as_it_gets() -> None:
    host = Host((1,), "scs215-2", position=900, calibrate="accept")
    host.say(packet(1, CALIBRATE))
    assert host.bus.nodes[1].raw_position == 900 - 127


def test_hls_sets_any_position_and_keeps_it_when_unlocked() -> None:
    host = host_of("hls", position=4095)
    host.write(1, LOCK["hls"], 0)
    assert host.say(packet(1, CALIBRATE, *word(1024))) == ACK
    assert host.read(1, PRESENT) == 1024
    host.wait(1.0)
    host.bus.nodes[1].power_cycle()
    assert host.read(1, PRESENT) == 1024


def test_a_calibration_under_an_angular_resolution_counts_in_its_steps() -> None:
    host = Host(position=3000)
    host.write(1, 30, 2)
    host.say(packet(1, CALIBRATE, *word(1000)))
    assert host.read(1, PRESENT) == 1000


# 0x06.


@pytest.mark.parametrize("name", TABLES)
def test_0x06_keeps_the_id_or_makes_it_1(name: str) -> None:
    for switch, id in (("keep", 9), ("default", 1)):
        host = Host((9,), USUAL[name], restore_id=switch)
        assert host.say(packet(9, RESTORE)) == ["FF FF 09 02 00 F4"]
        host.wait(2.0)
        assert list(host.bus.nodes) == [id]


def test_0x06_gives_back_the_rate_that_it_shipped_with() -> None:
    host = host_of("smbl", servo_baud=1_000_000)
    host.bus.tune(1_000_000)
    assert host.say(packet(1, RESTORE)) == ACK
    host.wait(2.0)
    assert host.bus.nodes[1].baud_rate == 115_200


def test_what_a_write_concerns_is_what_its_rows_decide() -> None:
    nothing = concerned(frozenset())
    assert not any(nothing)
    assert concerned(frozenset({"goal_position", "goal_velocity"})) == nothing._replace(
        goal=True, motion=True
    )
    assert concerned(frozenset({"second_id"})) == nothing._replace(identity=True)
    assert concerned(frozenset({"torque_enable"})) == nothing._replace(torque=True, motion=True)
    assert concerned(frozenset({"phase"})) == nothing._replace(faces=True, motion=True)
    assert concerned(frozenset({"homing_offset"})) == nothing._replace(counts=True, motion=True)
    assert concerned(frozenset({"min_position_limit"})) == nothing._replace(limits=True, motion=True)
