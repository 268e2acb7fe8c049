"""SYNC READ with partial results and short trains, SYNC WRITE split to capacity; who is unknown is asked first."""

from __future__ import annotations

from math import tau

import pytest

from motorbus.core.operation import Effect, Exchange, Goal
from motorbus.errors import ChecksumError, DeviceError, LimitExceeded, NoReply, RequestError
from motorbus.families.feetech.driver import Node, prepare_all, sync_read, sync_write
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.group import block_of_each, trains, written_all
from motorbus.families.feetech.driver.group import sync_writes as packets
from motorbus.families.feetech.table import Mode
from tests.families.feetech.driver_script import (
    ALL,
    SYNC_WRITE,
    Line,
    image,
    low_high,
    packet,
    play,
    prepared,
    prepares,
    reads,
    sync_reads,
    unheard,
    watch,
)

COUNT = tau / 4096


def asks(*ids: int, silent: tuple[int, ...] = (), **changes: int) -> Line:
    """SYNC READ of identity and settings."""
    return sync_reads(0, {id: None if id in silent else tuple(image(id, **changes)) for id in ids}, 40)


def sync_writes(address: int, length: int, items: dict[int, tuple[int, ...]]) -> Line:
    parameters = [byte for id, data in items.items() for byte in (id, *data)]
    return Line(packet(ALL, SYNC_WRITE, address, length, *parameters), None)


# -- read ----------------------------------------------------------------------------------------------------


def test_ids_alone_are_asked_what_they_are_and_then_read() -> None:
    result = play(
        sync_read(["present_position", "present_velocity"], [1, 2]),
        asks(1, 2, at_18=0b1000),
        sync_reads(56, {1: (0x18, 5, 10, 0), 2: (0, 8, 0, 0)}, 4),
    )
    assert result.values == {
        1: {"present_position": pytest.approx(1304 * COUNT), "present_velocity": pytest.approx(500 * COUNT)},
        2: {"present_position": pytest.approx(2048 * COUNT), "present_velocity": 0},
    }
    assert (result.errors, result.alarms) == ({}, {1: (), 2: ()})
    assert result.at > 100


def test_prepared_servos_are_read_at_once_and_hear_their_alarms() -> None:
    one, other = prepared(1), prepared(2)
    frames = [packet(1, 0x20, 74), packet(2, 0, 75)]
    result = play(sync_read(["present_voltage"], [one, other]), Line(packet(ALL, 0x82, 62, 1, 1, 2), frames))
    assert (one.alarm, other.alarm, result.alarms[1]) == (("overload",), (), ("overload",))
    assert one.at == result.at


def test_one_dead_servo_costs_its_own_value_only() -> None:
    result = play(
        sync_read(["present_voltage"], [prepared(1), prepared(2), prepared(3)]),
        sync_reads(62, {1: (74,), 2: None, 3: (76,)}, 1),
        unheard(reads(2, 62, 0)),
    )
    assert {id: values["present_voltage"] for id, values in result.values.items()} == {
        1: pytest.approx(7.4),
        3: pytest.approx(7.6),
    }
    assert [(id, type(error)) for id, error in result.errors.items()] == [(2, NoReply)]
    assert list(result.alarms) == [1, 3]


def test_who_knows_no_sync_read_is_read_alone() -> None:
    result = play(
        sync_read(["present_voltage"], [prepared(1), prepared(2)]),
        sync_reads(62, {1: None, 2: None}, 1),
        reads(1, 62, 74),
        reads(2, 62, 75),
    )
    assert sorted(result.values) == [1, 2]


def test_a_damaged_train_is_read_one_by_one() -> None:
    request = sync_reads(62, {1: None, 2: None}, 1).sent
    result = play(
        sync_read(["present_voltage"], [prepared(1), prepared(2)]),
        *(
            Line(request, ChecksumError("c")),
            reads(1, 62, 74),
            Line(reads(2, 62, 0).sent, ChecksumError("d")),
        ),
    )
    assert list(result.values) == [1]
    assert isinstance(result.errors[2], ChecksumError)


def test_who_is_not_there_at_all_is_not_asked_again() -> None:
    result = play(
        sync_read(["present_voltage"], [1, 2]),
        *(asks(1, 2, silent=(2,)), unheard(prepares(2)), sync_reads(62, {1: (74,)}, 1)),
    )
    assert list(result.values) == [1]
    assert list(result.errors) == [2]


def test_nobody_there_is_a_result_too() -> None:
    result = play(sync_read(["lock"], [7]), asks(7, silent=(7,)), unheard(prepares(7)))
    assert (result.values, list(result.errors), result.at) == ({}, [7], float("-inf"))


def test_registers_far_apart_are_several_reads_and_the_missing_are_dropped_on_the_way() -> None:
    result = play(
        sync_read(["present_voltage", "led_mask"], [prepared(1), prepared(2)]),
        sync_reads(20, {1: (47,), 2: None}, 1),
        unheard(reads(2, 20, 0)),
        sync_reads(62, {1: (74,)}, 1),
    )
    assert result.values == {1: {"present_voltage": pytest.approx(7.4), "led_mask": 47}}


def test_servos_with_unknown_maps_are_read_apart_by_common_rows() -> None:
    strange = Node(2)
    play(prepare_all([strange]), asks(2, at_0=9))
    result = play(
        sync_read(["present_position"], [prepared(1), strange]),
        sync_reads(56, {1: (0, 8)}, 2),
        sync_reads(56, {2: (0, 8)}, 2),
    )
    assert result.values == {
        1: {"present_position": pytest.approx(2048 * COUNT)},
        2: {"present_position": 2048},
    }


@pytest.mark.parametrize(
    ("ids", "message"), [([], "no servo is named"), ([1, 2, 1], "named twice"), ([254], "everyone at once")]
)
def test_impossible_groups_cost_no_packet(ids: list[int], message: str) -> None:
    with pytest.raises(RequestError, match=message):
        play(sync_read(["lock"], ids))


def test_unknown_names_cost_no_packet() -> None:
    with pytest.raises(RequestError, match="no register"):
        play(sync_read(["locke"], [1, 2]))


@pytest.mark.parametrize(
    ("count", "rate", "air", "most"),
    [
        (2, 1_000_000, 0.004, 50),
        (15, 1_000_000, 0.004, 19),
        (40, 1_000_000, 0.004, 8),
        (2, 115_200, 0.004, 5),
        (40, 38_400, 0.004, 1),
        (2, 1_000_000, float("inf"), 251),
    ],
)
def test_trains_take_no_more_air_than_asked_for(count: int, rate: int, air: float, most: int) -> None:
    nodes = [Node(id) for id in range(254)]
    parts = list(trains(nodes, count, rate, air))
    assert max(map(len, parts)) == most
    assert [node for part in parts for node in part] == nodes
    assert most == 1 or most * (count + 6) * 10 / rate <= air


def test_a_group_read_is_split_into_trains() -> None:
    nodes = [prepared(id) for id in range(60)]
    first, second = (
        sync_reads(56, {id: low_high(id) for id in ids}, 2) for ids in (range(50), range(50, 60))
    )
    assert len(play(sync_read(["present_position"], nodes), first, second).values) == 60
    whole = sync_reads(56, {id: low_high(id) for id in range(60)}, 2)
    assert len(play(sync_read(["present_position"], nodes, air=1.0), whole).values) == 60


def test_prepare_all_leaves_those_alone_who_are_known() -> None:
    known, new = prepared(1), Node(2)
    assert play(prepare_all([known, new]), asks(2, at_33=1)) == {}
    assert new.known_mode is Mode.VELOCITY
    assert play(prepare_all([known, new])) == {}


def test_a_group_exchange_is_plain_data_for_the_bus() -> None:
    exchange = block_of_each([Node(1), Node(2)], 56, 2)
    assert [(due.node, due.length) for due in exchange.replies] == [(1, 8), (2, 8)]  # type: ignore[union-attr]
    assert exchange.tells_position
    assert exchange.repeatable
    assert not block_of_each([Node(1)], 58, 2).tells_position


# -- write ---------------------------------------------------------------------------------------------------


def test_the_sync_write_of_the_manual() -> None:
    goal = {"goal_position": 2048 * COUNT, "goal_time": 0, "goal_velocity": 1000 * COUNT}
    wish = sync_write({prepared(id): goal for id in (1, 2, 3, 4)})
    (exchange,) = watch(
        wish, sync_writes(42, 6, dict.fromkeys((1, 2, 3, 4), (0, 8, 0, 0, 0xE8, 3)))
    ).exchanges
    assert isinstance(exchange.request, bytes)
    assert exchange.request.hex(" ").upper().startswith("FF FF FE 20 83 2A 06 01 00 08")
    assert exchange.request[-1] == 0x58
    assert (exchange.effect, exchange.replies) == (Effect.MOTION, ())
    assert [goal for goal in exchange.goals if goal.quantity == "position"] == [
        Goal(id, "position", 2048 * COUNT, 0.0, 4095 * COUNT) for id in (1, 2, 3, 4)
    ]


def test_ids_alone_are_asked_for_their_limits_first() -> None:
    wish = sync_write({1: {"goal_position": 1.0}, 2: {"goal_position": 0.0}})
    played = watch(wish, asks(1, 2, at_12=8), sync_writes(42, 2, {1: (0x8C, 2), 2: (0, 0)}))
    assert played.exchanges[1].goals == (
        Goal(1, "position", 652 * COUNT, 0.0, 2303 * COUNT),
        Goal(2, "position", 0.0, 0.0, 2303 * COUNT),
    )


def test_more_than_a_packet_carries_are_split() -> None:
    lines = [
        sync_writes(42, 2, dict.fromkeys(ids, (0, 8))) for ids in (range(83), range(83, 166), range(166, 200))
    ]
    play(sync_write({prepared(id): {"goal_position": 2048 * COUNT} for id in range(200)}), *lines)


def test_the_first_packet_is_judged_by_the_goals_of_all() -> None:
    exchanges = list(
        packets(
            [prepared(id) for id in range(90)],
            [Block(42, b"\0\x08", goals=(Goal(id, "position", 0.0),)) for id in range(90)],
        )
    )
    assert [[goal.node for goal in exchange.goals] for exchange in exchanges] == [
        [*range(90)],
        [*range(83, 90)],
    ]


def test_an_error_between_two_packets_says_that_the_first_has_left() -> None:
    operation = written_all([Exchange[None](b"1"), Exchange[None](b"2")])
    next(operation)
    operation.send(None)
    with pytest.raises(NoReply) as caught:
        operation.throw(NoReply("a stop"))
    assert caught.value.__notes__ == ["1 of 2 packets had left before this one"]


def test_nothing_is_written_when_one_is_silent() -> None:
    with pytest.raises(NoReply):
        play(
            sync_write({1: {"torque_enable": 0}, 2: {"torque_enable": 0}}),
            *(asks(1, 2, silent=(2,)), unheard(prepares(2))),
        )


def test_nothing_is_written_when_one_is_a_stranger() -> None:
    with pytest.raises(DeviceError, match="refuses to write"):
        play(sync_write({1: {"torque_limit": 1.0}}), asks(1, at_0=9))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({1: {"led_mask": 1}}, "adjoining RAM registers only"),
        ({1: {"torque_enable": 1}}, "jump to an old goal"),
        ({1: {"goal_position": 0.0}, 2: {"goal_velocity": 0.0}}, "other registers"),
        ({1: {"goal_position": 0.0}, 2: {"goal_position": 0.0, "goal_time": 0}}, "other registers"),
        ({1: {"goal_position": 0.0, "torque_limit": 0.0}}, "adjoining RAM registers only"),
        ({}, "no servo is named"),
        ({1: {}}, "adjoining RAM registers only, not none"),
    ],
)
def test_what_no_sync_write_can_carry_is_refused(values: dict[int, dict[str, float]], message: str) -> None:
    with pytest.raises(RequestError, match=message):
        play(sync_write({prepared(id): orders for id, orders in values.items()}))


def test_in_step_mode_goals_are_ways() -> None:
    wish = sync_write({prepared(1, at_33=3): {"goal_position": 1.0}})
    (exchange,) = watch(wish, sync_writes(42, 2, {1: (0x8C, 2)})).exchanges
    assert exchange.goals[0].quantity == "relative"
    assert not exchange.repeatable


def test_limits_are_for_the_gate_to_judge() -> None:
    from motorbus.motion.safety import Gate

    (exchange,) = watch(
        sync_write({prepared(1, at_12=8): {"goal_position": 4.0}}), sync_writes(42, 2, {1: low_high(2608)})
    ).exchanges
    with pytest.raises(LimitExceeded):
        Gate()(exchange)
