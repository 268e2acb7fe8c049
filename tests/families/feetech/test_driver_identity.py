"""Is it there, what is it, which map has it; and that an unknown one is read and never written."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Due, Rank, Timeout
from motorbus.errors import ChecksumError, DeviceError, NoReply
from motorbus.families.feetech.driver import Node, identify, ping, prepare, read, write
from motorbus.families.feetech.driver.identity import (
    common_table,
    identity_of,
    known,
    ping_exchange,
    writable,
)
from motorbus.families.feetech.table import STS, TABLES, Mode
from tests.families.feetech.driver_script import (
    PING,
    Line,
    image,
    packet,
    play,
    prepared,
    prepares,
    reads,
    unheard,
)

ASKED = packet(3, PING)


def test_ping_of_a_servo_that_is_there() -> None:
    node = Node(3)
    assert play(ping(node), Line(ASKED, packet(3, 0x04))) is True
    assert node.alarm == ("temperature",)


def test_what_prepares_a_servo_is_made_once_and_learns_each_time() -> None:
    node, other = Node(3), Node(4)
    assert prepare(node) is prepare(node)
    assert prepare(other).request != prepare(node).request
    for mode in (Mode.POSITION, Mode.VELOCITY, Mode.POSITION):
        number = {Mode.POSITION: 0, Mode.VELOCITY: 1}[mode]
        play(prepare(node), prepares(at_33=number))
        assert node.known_mode is mode


def test_ping_into_silence_is_false() -> None:
    assert play(ping(Node(3)), Line(ASKED, None)) is False


def test_ping_does_not_take_a_damaged_answer_for_silence() -> None:
    with pytest.raises(ChecksumError):
        play(ping(Node(3)), Line(ASKED, ChecksumError("damaged")))


def test_ping_is_answered_by_a_servo_that_acknowledges_no_writes() -> None:
    assert ping_exchange(prepared(at_8=0)).replies == (Due(3, 3, 6),)


def test_a_scanning_ping_waits_shortly_and_yields_to_everything_else() -> None:
    exchange = ping_exchange(Node(3), scanning=True)
    assert (exchange.timeout, exchange.rank, exchange.repeatable) == (Timeout.SCAN, Rank.CONFIGURATION, True)


def test_identify_is_one_read_and_fills_the_node() -> None:
    node = Node(3)
    found = play(identify(node), reads(3, 0, 3, 10, 0, 9, 3))
    assert (found.node, found.model, found.firmware, found.table) == (3, "STS3215", "3.10", "sts")
    assert found.details == {
        "model_number": 777,
        "byte_order": "little",
        "register_map": "sts",
        "writable": True,
    }
    assert (node.identity, node.table, node.settings) == (found, STS, None)
    assert node.writable


@pytest.mark.parametrize(
    ("head", "model", "table", "order"),
    [
        ((3, 9, 0, 9, 2), "STS3032", "sts", "little"),
        ((3, 10, 0, 9, 99), "unknown model 9.99", "sts", "little"),
        ((3, 43, 0, 10, 18), "HLS3950", "hls", "little"),
        ((0, 10, 1, 5, 4), "SCS0009", "scs", "big"),
        ((3, 25, 1, 9, 15), "SCS15-2", "scs2", "big"),
        ((2, 45, 0, 8, 44), "SM85BLHV", "smbl", "little"),
        ((20, 5, 0, 9, 3), "STS3215", "", "little"),
        ((3, 10, 1, 77, 7), "unknown model 77.7", "", "big"),
    ],
)
def test_firmware_and_byte_order_decide_the_map(
    head: tuple[int, ...], model: str, table: str, order: str
) -> None:
    found = identity_of(3, bytes(head))
    assert (found.model, found.table) == (model, table)
    assert (found.details["register_map"], found.details["byte_order"]) == (table or "unknown", order)


def test_the_model_outweighs_the_byte_order_register() -> None:
    assert identity_of(3, bytes((3, 10, 1, 9, 3))).table == "sts"


def test_prepare_reads_identity_and_settings_in_one_read() -> None:
    node = Node(3)
    assert play(prepare(node), prepares()).model == "STS3215"
    assert node.known_mode is Mode.POSITION
    assert node.limits == pytest.approx((0, 6.28165), abs=1e-5)


def test_known_asks_once() -> None:
    node = Node(3)
    assert play(known(node), prepares()) is STS
    assert play(known(node)) is STS


def test_known_asks_again_when_the_settings_were_forgotten() -> None:
    node = prepared()
    node.forget_settings()
    play(known(node), prepares(at_33=1))
    assert node.known_mode is Mode.VELOCITY


def test_a_silent_servo_is_no_reply() -> None:
    with pytest.raises(NoReply):
        play(known(Node(3)), unheard(prepares()))


def test_an_unknown_firmware_can_be_read_by_the_common_rows() -> None:
    node = Node(3)
    found = play(
        read(node, "present_position", "present_voltage", "id"),
        prepares(at_0=9, at_1=9),
        reads(3, 5, 3),
        reads(3, 56, 0, 8, 0, 0, 0, 0, 74),
    )
    assert found == {"present_position": 2048, "present_voltage": pytest.approx(7.4), "id": 3}
    assert not node.writable


def test_an_unknown_firmware_is_not_written() -> None:
    with pytest.raises(DeviceError, match=r"firmware 9\.9.*refuses to write") as caught:
        play(write(Node(3), led_mask=1), prepares(at_0=9, at_1=9))
    assert caught.value.node == 3


def test_every_map_that_is_known_is_written() -> None:
    assert play(writable(Node(3)), reads(3, 0, *image(at_1=43, at_3=10, at_4=18))) is TABLES["hls"]


@pytest.mark.parametrize("order", ["little", "big"])
def test_common_rows_are_read_only_and_in_the_byte_order_of_the_servo(order: str) -> None:
    table = common_table(order)
    assert not any(row.writable for row in table.values())
    assert {row.order for row in table.values()} == {order}
    assert "lock" not in table
    assert "torque_limit" not in table
    assert table["present_position"].decode(b"\x00\x08") == (2048 if order == "little" else 8)


def test_common_rows_have_units_only_where_all_maps_agree() -> None:
    units = {row.name: row.unit for row in common_table("little").values() if row.unit}
    assert set(units.values()) == {"V", "°C", "fraction"}
