"""Reading and writing by name, REG WRITE and ACTION, byte by byte."""

from __future__ import annotations

from contextlib import nullcontext
from math import tau

import pytest

from motorbus.core.entry import Value
from motorbus.core.operation import Effect, Exchange, Goal, Rank
from motorbus.errors import DeviceError, NoReply, OutcomeUnknown, RequestError
from motorbus.families.feetech.driver import Node, action, action_all, read, read_raw, reg_write, write
from motorbus.families.feetech.driver.node import Pending
from motorbus.families.feetech.driver.registers import spans
from motorbus.families.feetech.table import STS
from tests.families.feetech.driver_script import (
    ACTION,
    ALL,
    REG_WRITE,
    Line,
    packet,
    play,
    prepared,
    prepares,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import met

COUNT = tau / 4096
ORDER = Line(packet(3, REG_WRITE, 42, 0, 8, 0, 0, 0xE8, 3), packet(3, 0))
GO = Line(packet(3, ACTION), packet(3, 0))


def test_neighbours_are_read_together_and_come_in_the_order_asked_for() -> None:
    found = play(
        read(prepared(), "present_voltage", "present_position", "goal_velocity"),
        reads(3, 46, 0xE8, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0x18, 5, 0, 0, 0, 0, 121),
    )
    assert list(found) == ["present_voltage", "present_position", "goal_velocity"]
    assert found == {
        "present_voltage": pytest.approx(12.1),
        "present_position": pytest.approx(1304 * COUNT),
        "goal_velocity": pytest.approx(1000 * COUNT),
    }


def test_a_wide_gap_and_the_border_of_eeprom_and_ram_part_reads() -> None:
    rows = [STS[name] for name in ("max_torque", "position_p", "velocity_i", "torque_enable", "moving")]
    assert [(span.address, span.size) for span in spans(rows)] == [(16, 6), (39, 1), (40, 1), (66, 1)]


def test_all_registers_come_in_few_reads() -> None:
    assert [(span.address, span.size) for span in spans(STS.values())] == [(0, 40), (40, 31), (80, 7)]


def test_a_new_servo_is_asked_what_it_is_first() -> None:
    assert play(read(Node(3), "lock"), prepares(), reads(3, 55, 1)) == {"lock": 1}


def test_raw_values_have_their_sign_and_no_unit() -> None:
    assert play(
        read_raw(prepared(), "present_load", "present_position"), reads(3, 56, 1, 0x80, 0, 0, 5, 4)
    ) == {
        "present_load": -5,
        "present_position": -1,
    }


def test_no_name_means_all_that_can_be_read() -> None:
    found = play(read_raw(prepared()), prepares(), reads(3, 40, *range(31)), reads(3, 80, *range(80, 87)))
    assert list(found) == [row.name for row in STS.values() if row.readable]
    assert (found["model_minor"], found["acceleration"], found["moving_threshold"]) == (3, 1, 80)


def test_an_unknown_name_costs_no_packet() -> None:
    with pytest.raises(RequestError, match="perhaps present_"):
        play(read(Node(3), "present_positron"))


def test_silence_is_no_reply() -> None:
    with pytest.raises(NoReply):
        play(read(prepared(), "lock"), unheard(reads(3, 55, 1)))


def test_ram_is_written_at_once_in_the_order_of_addresses() -> None:
    play(
        write(prepared(), torque_limit=0.5, goal_position=2048 * COUNT, acceleration=10 * 100 * COUNT),
        writes(3, 41, 10, 0, 8),
        writes(3, 48, 0xF4, 1),
    )


def test_a_write_that_moves_carries_goal_and_effect() -> None:
    (exchange,) = watch(write(prepared(), goal_position=1.0), writes(3, 42, 0x8C, 2)).exchanges
    assert (exchange.effect, exchange.rank, exchange.repeatable) == (Effect.MOTION, Rank.CONTROL, True)
    assert exchange.goals == (Goal(3, "position", 652 * COUNT, 0.0, 4095 * COUNT),)


def test_a_write_in_step_mode_is_never_repeated() -> None:
    node = prepared(at_33=3)
    (exchange,) = watch(write(node, goal_position=1.0), writes(3, 42, 0x8C, 2)).exchanges
    assert not exchange.repeatable
    with pytest.raises(OutcomeUnknown):
        play(write(node, goal_position=1.0), unheard(writes(3, 42, 0x8C, 2)))


@pytest.mark.parametrize(
    "values",
    [
        {"nope": 1},
        {"id": 4},
        {"position_p": 300},
        {"lock": 0},
        {"led_mask": 1, "phase": 12},
        {"goal_time": 5000},
    ],
)
def test_what_is_refused_costs_no_packet(values: dict[str, Value]) -> None:
    with pytest.raises(RequestError):
        play(write(Node(3), **values))


def test_nothing_to_write_writes_nothing() -> None:
    play(write(prepared()))


def test_a_register_may_be_called_like_an_argument() -> None:
    with pytest.raises(RequestError, match="no register 'node'"):
        play(write(prepared(), node=1))


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("sts", {"operating_mode": 0}),
        ("sts", {"min_position_limit": 0.1, "led_mask": 1}),
        ("hls", {"control_loop": 0}),
    ],
)
def test_goals_are_not_written_together_with_what_may_change_their_meaning(
    name: str, settings: dict[str, Value]
) -> None:
    with pytest.raises(RequestError, match="goal_position together with") as caught:
        play(write(met(name), goal_position=1.0, **settings))
    assert "enable_torque()" in caught.value.advice


def test_reg_write_hands_over_and_is_never_repeated() -> None:
    node = prepared()
    wish = reg_write(node, goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT)
    (exchange,) = watch(wish, ORDER).exchanges
    assert (exchange.effect, exchange.repeatable) == (Effect.MOTION, False)
    assert [goal.quantity for goal in exchange.goals] == ["position", "time", "speed"]
    assert node.pending is not None
    assert node.pending.goals == exchange.goals


def test_reg_write_that_is_not_acknowledged_is_in_doubt() -> None:
    wish = reg_write(prepared(), goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT)
    with pytest.raises(OutcomeUnknown):
        play(wish, unheard(ORDER))


@pytest.mark.parametrize(("pending", "lost"), [(1, False), (0, True)])
def test_reg_write_to_a_servo_that_acknowledges_nothing_is_looked_for(pending: int, lost: bool) -> None:
    wish = reg_write(prepared(at_8=0), goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT)
    with pytest.raises(OutcomeUnknown, match="holds no REG WRITE") if lost else nullcontext():
        play(wish, unheard(ORDER), reads(3, 64, pending))


@pytest.mark.parametrize("values", [{"led_mask": 1}, {"goal_position": 1.0, "goal_velocity": 1.0}, {}])
def test_reg_write_is_for_one_run_of_ram(values: dict[str, Value]) -> None:
    with pytest.raises(RequestError, match="REG WRITE carries adjoining RAM registers only"):
        play(reg_write(prepared(), **values))


def test_action_shows_the_gate_what_was_handed_over() -> None:
    node = prepared()
    play(reg_write(node, goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT), ORDER)
    assert node.pending is not None
    goals = node.pending.goals
    (exchange,) = watch(action(node), GO).exchanges
    assert (exchange.effect, exchange.goals, exchange.repeatable) == (Effect.MOTION, goals, False)
    assert node.pending is None


def test_action_of_what_others_handed_over_is_leave_to_go() -> None:
    exchange = action(prepared())
    assert isinstance(exchange, Exchange)
    assert (exchange.effect, exchange.goals, exchange.repeatable) == (Effect.TORQUE, (), False)


def test_a_servo_that_is_not_known_is_asked_what_it_is_before_action() -> None:
    go = Line(packet(3, ACTION), packet(3, 0))
    play(action(Node(3)), prepares(), go)
    with pytest.raises(DeviceError, match="register map is not described"):
        play(action(Node(3)), prepares(at_0=9))
    with pytest.raises(DeviceError, match="register map is not described"):
        action_all([prepared(4), prepared(3, at_0=9)])


def test_a_servo_that_acknowledges_nothing_is_asked_whether_a_reg_write_still_waits() -> None:
    go = Line(packet(3, ACTION), None)
    play(action(prepared(at_8=0)), go, reads(3, 64, 0))
    with pytest.raises(OutcomeUnknown, match="still holds a REG WRITE"):
        play(action(prepared(at_8=0)), go, reads(3, 64, 1))


def test_action_of_what_was_handed_over_under_other_settings_is_refused_until_it_is_replaced() -> None:
    node = prepared()
    play(reg_write(node, goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT), ORDER)
    for settings in (None, prepared(at_9=1).settings):
        node.settings = settings
        with pytest.raises(
            RequestError, match="the REG WRITE that waits was made before the settings of node 3"
        ):
            action_all([node])
    play(action_all([prepared(4)]), Line(packet(ALL, ACTION), None))
    play(reg_write(node, goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT), ORDER)
    play(action(node), GO)


def test_a_reg_write_that_moves_nothing_replaces_one_that_would() -> None:
    node = prepared()
    play(reg_write(node, goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT), ORDER)
    play(reg_write(node, torque_enable=0), Line(packet(3, REG_WRITE, 40, 0), packet(3, 0)))
    assert node.pending is None


def test_action_for_all_is_owed_no_reply() -> None:
    one, other = prepared(3), prepared(4)
    for node in (one, other):
        node.pending = Pending((Goal(node.node, "position", 1.0, 0.0, 2.0),), node.settings)
    exchange = action_all([one, other])
    assert [goal.node for goal in exchange.goals] == [3, 4]
    assert (exchange.effect, exchange.replies) == (Effect.MOTION, ())
    play(exchange, Line(packet(ALL, ACTION), None))
    assert one.pending is other.pending is None


def test_who_hands_over_and_who_lets_begin_is_marked_and_known_to_have_been_heard() -> None:
    node = prepared()
    one = watch(reg_write(node, goal_position=2048 * COUNT, goal_time=0, goal_velocity=1000 * COUNT), ORDER)
    alone = watch(action(node), GO)
    everyone = watch(action_all([node]), Line(packet(ALL, ACTION), None))
    marks = [played.exchanges[-1].later for played in (one, alone, everyone)]
    assert [(mark.node, mark.begins, mark.done) for mark in marks if mark] == [
        (3, False, True),
        (3, True, True),
        (None, True, True),
    ]


def test_the_broadcast_of_an_action_is_that_of_the_manual() -> None:
    assert action_all().request == bytes.fromhex("FF FF FE 02 05 FA")
