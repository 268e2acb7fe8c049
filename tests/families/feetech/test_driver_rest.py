"""Orders that make nothing move, and where none is known."""

from __future__ import annotations

from math import tau

import pytest

from motorbus.core.goal import Goal, Stays
from motorbus.core.operation import Effect
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.rest import at_rest, held, held_within, outside, switched_on, with_bound
from motorbus.families.feetech.table import CONTROL, HLS, STS, TABLES, Mode
from tests.families.feetech.driver_script import play, prepared, reads
from tests.families.feetech.maps import met

COUNT = tau / 4096


@pytest.mark.parametrize(
    ("name", "mode"),
    [(name, mode) for name in TABLES for mode in CONTROL[name].has if mode not in (Mode.POSITION, Mode.STEP)],
)
def test_rest_is_a_0_in_the_register_that_the_mode_heeds(name: str, mode: Mode) -> None:
    node = met(name)
    if (name, mode) == ("hls", Mode.PWM):
        with pytest.raises(RequestError, match="nobody has published which register takes the duty"):
            at_rest(node, TABLES[name], mode)
        return
    block = at_rest(node, TABLES[name], mode)
    names = {Mode.VELOCITY: "goal_velocity", Mode.CURRENT: "goal_torque", Mode.PWM: "goal_time"}
    assert block.address == TABLES[name][names[mode]].address
    assert (block.data, block.effect) == (b"\0\0", Effect.MOTION)
    assert [goal[2:] for goal in block.goals] == [(0.0, 0.0, 0.0, Stays.STILL)]


def test_held_is_where_it_stands_whatever_its_limits() -> None:
    block = play(held(prepared(at_12=0), STS), reads(3, 56, 0x84, 3))
    here = 900 * COUNT
    goal = Goal(3, "position", here, here, here, Stays.STILL)
    assert block == Block(42, b"\x84\x03", Effect.MOTION, (goal,))


def test_held_within_goes_to_the_limit_that_is_near() -> None:
    before = reads(3, 40, 0, 7, 1, 2, 3, 4, 5, 6)
    block = play(held_within(prepared(at_12=0), STS, jump=5.0), before, reads(3, 56, 0x84, 3))
    assert (block.address, block.data) == (40, b"\x01\x07\xff\x00")
    assert block.goals[0].stays is None, "it goes there, and is judged as what goes"
    assert outside(prepared(at_12=0), STS, play(held(prepared(at_12=0), STS), reads(3, 56, 0x84, 3)))
    assert not outside(prepared(), STS, play(held(prepared(), STS), reads(3, 56, 0x84, 3)))


def test_the_switch_travels_with_the_order_and_keeps_what_lies_between() -> None:
    found = bytes((0, 7, 1, 2, 3, 4, 5, 6))
    assert switched_on(Block(46, b"\0\0"), found) == Block(40, b"\x01\x07\x01\x02\x03\x04\0\0")
    assert switched_on(Block(44, b"\0\0"), found) == Block(40, b"\x01\x07\x01\x02\0\0")
    assert switched_on(Block(41, b"\x09\1\2")) == Block(40, b"\x01\x09\1\2")
    assert switched_on(Block(42, b"\1\2")) == Block(40, b"\x01\x00\1\2")


def test_a_bound_stands_before_a_velocity_and_behind_a_goal() -> None:
    node = met("hls")
    node.bound = 300
    assert with_bound(node, HLS, Block(46, b"\1\2")) == Block(44, b"\x2c\1\1\2")
    assert with_bound(node, HLS, Block(42, b"\1\2")) == Block(42, b"\1\2\x2c\1")
    assert with_bound(prepared(), STS, Block(42, b"\1\2")) == Block(42, b"\1\2")
