"""The quick way of a reading says what the slow way says, bit for bit, or that it must be asked."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.operation import ANY, UNLIKE, Answer, Exchange, Reply
from motorbus.families.feetech import driver, wire
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.gauge import Packets, blocks, quantity
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import packet
from tests.families.feetech.maps import HEADS, met

QUANTITIES = ("position", "velocity", "load", "current", "voltage", "temperature")
AT = 7.25
WISHES: list[dict[str, int]] = [
    {},
    *({"phase": phase} for phase in (0x10, 0xFF, 0x6C)),
    {"operating_mode": 1},
    {"operating_mode": 1, "homing_offset": 100},
    {"homing_offset": -100},
    {"operating_mode": 2, "homing_offset": -7, "phase": 0x10},
    {"angular_resolution": 3},
]


def has(name: str, wish: dict[str, int]) -> bool:
    """Can a servo of this map be set so?"""
    table = TABLES[name]
    return all(row in table and table[row].low <= raw <= table[row].high for row, raw in wish.items())


SETTINGS = {name: [wish for wish in WISHES if has(name, wish)] for name in HEADS}
MAPS = st.sampled_from([(name, settings) for name in HEADS for settings in SETTINGS[name]])


def slowly(exchange: Exchange[Any], data: bytes, at: float = AT) -> Any:
    """What a bus would make of these bytes: each reply that is due, in order, and nothing else; else UNLIKE."""
    found, dues = wire.StatusReceiver().feed(data), exchange.replies
    assert dues is not ANY
    wanted = [(due.key, due.length) for due in dues]
    if any(not isinstance(one, Reply) for one in found):
        return UNLIKE
    replies = tuple(one for one in found if isinstance(one, Reply))
    if [(one.key, len(one.data)) for one in replies] != wanted or sum(
        len(one.data) for one in replies
    ) != len(data):
        return UNLIKE
    assert exchange.read is not None
    return exchange.read(Answer(replies, (), at))


def is_same(exchange: Exchange[Any], data: bytes) -> bool:
    """Is it read the quick way? Then as the slow way would have it, bit for bit."""
    if exchange.whole is None:
        return False
    quick = exchange.whole(data, AT)
    if quick is UNLIKE:
        return False
    slow = slowly(exchange, data)
    assert repr(quick) == repr(slow)
    assert quick == slow
    return True


def reading(name: str, settings: dict[str, int], what: str) -> Exchange[Any] | None:
    node = met(name, 3, **settings)
    row = node.table["present_" + what] if node.table is not None else None
    if row is None or not row.unit:
        return None
    made = getattr(driver, what)(node)
    assert isinstance(made, Exchange)
    return made


@given(
    MAPS,
    st.sampled_from(QUANTITIES),
    st.binary(min_size=3, max_size=3),
    st.booleans(),
    st.sampled_from((0, 1, 4)),
)
def test_a_quantity_is_what_the_slow_way_says(
    map: tuple[str, dict[str, int]], what: str, data: bytes, longer: bool, alarm: int
) -> None:
    exchange = reading(*map, what)
    if exchange is None:
        return
    if longer:
        assert exchange.other is not None
        exchange = exchange.other()
    assert exchange.replies is not ANY
    count = exchange.replies[0].length - wire.OVERHEAD
    quick = is_same(exchange, packet(3, alarm, *data[:count]))
    assert quick == (exchange.whole is not None and not alarm)


@pytest.mark.parametrize("name", HEADS)
def test_every_raw_position_is_told_the_quick_way(name: str) -> None:
    exchange = reading(name, {}, "position")
    assert exchange is not None
    for raw in (*range(0, 65536, 251), 1, 0x7FFF, 0x8000, 0x8001, 0xFFFF):
        assert is_same(exchange, packet(3, 0, *raw.to_bytes(2, "big")))


@given(st.binary(min_size=2, max_size=2), st.integers(0, 7), st.integers(1, 255))
def test_one_changed_byte_is_never_told_the_quick_way(data: bytes, place: int, by: int) -> None:
    exchange = reading("sts", {}, "position")
    assert exchange is not None
    assert exchange.whole is not None
    spoilt = bytearray(packet(3, 0, *data))
    spoilt[place] ^= by
    assert exchange.whole(bytes(spoilt), AT) is UNLIKE


def test_what_is_of_another_length_of_another_or_told_under_other_settings_is_not_told() -> None:
    node = met("sts")
    exchange: Any = driver.position(node)
    whole = exchange.whole
    assert whole(packet(3, 0, 1, 2), AT) == 513 * 0.0015339807878856412
    for other in (packet(3, 0, 1), packet(3, 0, 1, 2, 3), packet(4, 0, 1, 2), packet(3, 0, 1, 2) * 2, b""):
        assert whole(other, AT + 1) is UNLIKE
    assert node.at == AT  # nothing of those was taken for an answer
    node.settings = met("sts", at_30=2).settings
    assert whole(packet(3, 0, 1, 2), AT) is UNLIKE
    node.forget_settings()
    assert whole(packet(3, 0, 1, 2), AT) is UNLIKE


def test_a_good_packet_ends_an_alarm_and_tells_when_it_came() -> None:
    node = met("sts")
    node.alarm = ("voltage",)
    exchange: Any = driver.position(node)
    exchange.whole(packet(3, 0, 1, 2), AT)
    assert node.at == AT
    assert not node.alarm


def test_where_the_zero_must_be_taken_out_there_is_no_quick_way() -> None:
    node = met("sts", operating_mode=1, homing_offset=100)
    assert node.table is not None
    assert quantity(node, node.table["present_position"], 2) is None
    assert quantity(node, node.table["present_velocity"], 2) is not None
    assert quantity(Node(3), node.table["present_velocity"], 2) is None


# -- several -----------------------------------------------------------------------------------------------------------


@given(st.lists(st.integers(0, 253), min_size=1, max_size=6, unique=True), st.integers(1, 40), st.data())
def test_packets_are_sound_when_each_is(ids: list[int], count: int, draw: st.DataObject) -> None:
    datas = [draw.draw(st.binary(min_size=count, max_size=count)) for _ in ids]
    good = b"".join(packet(id, 0, *data) for id, data in zip(ids, datas, strict=True))
    packets = Packets(ids, count)
    assert packets.are_sound(good)
    assert [good[part] for part in packets.parts] == [
        packet(id, 0, *data) for id, data in zip(ids, datas, strict=True)
    ]
    spoilt = bytearray(good)
    spoilt[draw.draw(st.integers(0, len(good) - 1))] ^= draw.draw(st.integers(1, 255))
    assert not packets.are_sound(bytes(spoilt))
    assert not packets.are_sound(good[:-1])
    assert not packets.are_sound(good + b"\0")
    assert not packets.are_sound(good + good[-1:])
    if len(ids) > 1:
        assert not packets.are_sound(good[packets.size // len(ids) :] + good[: packets.size // len(ids)])


@pytest.mark.parametrize("byte", [0, 255])
@pytest.mark.parametrize("count", [1, 2, 15, 249, 253])
def test_the_sums_of_neighbours_never_meet(byte: int, count: int) -> None:
    ids = [253, 0, 252]
    good = b"".join(packet(id, 0, *([byte] * count)) for id in ids)
    assert Packets(ids, count).are_sound(good)


def test_the_raw_values_of_all_are_those_of_their_first_two_bytes() -> None:
    data = packet(1, 0, 1, 2, 9) + packet(2, 0, 3, 4, 9)
    assert Packets([1, 2], 3).unpack(data) == (0x0201, 0x0403)
    assert Packets([1, 2], 3, "big").unpack(data) == (0x0102, 0x0304)


@given(st.integers(1, 20), st.booleans(), st.sampled_from((0, 0, 1)), st.data())
def test_blocks_are_what_the_slow_way_says(count: int, longer: bool, alarm: int, draw: st.DataObject) -> None:
    nodes = [met("sts", 1), met("hls", 2)]
    exchange: Exchange[Any] = driver.sync_read_raw(56, count, nodes)
    if longer:
        assert exchange.other is not None
        exchange = exchange.other()
    size = count + longer
    datas = [draw.draw(st.binary(min_size=size, max_size=size)) for _ in nodes]
    data = packet(1, 0, *datas[0]) + packet(2, alarm, *datas[1])
    assert is_same(exchange, data) == (not alarm)
    assert slowly(exchange, data) == {1: datas[0][:count], 2: datas[1][:count]}
    assert exchange.whole is not None
    assert exchange.whole(packet(2, 0, *datas[1]) + packet(1, 0, *datas[0]), AT) is UNLIKE


def test_blocks_need_no_settings_and_tell_when_they_came() -> None:
    node = Node(5)
    node.alarm = ("voltage",)
    assert blocks([node], 2, 3)(packet(5, 0, 7, 8, 9), AT) == {5: b"\x07\x08"}
    assert node.at == AT
    assert not node.alarm


# -- positions of several ----------------------------------------------------------------------------------------------

LITTLE = [(name, settings) for name in ("sts", "smbl", "smcl", "hls") for settings in SETTINGS[name]]


@given(st.lists(st.sampled_from(LITTLE), min_size=1, max_size=4), st.booleans(), st.data())
def test_positions_of_several_are_what_the_slow_way_says(
    maps: list[tuple[str, dict[str, int]]], longer: bool, draw: st.DataObject
) -> None:
    nodes = [met(name, id, **settings) for id, (name, settings) in enumerate(maps)]
    exchange: Exchange[Any] = driver.sync_read_positions(nodes)
    if longer:
        assert exchange.other is not None
        exchange = exchange.other()
    raws = [
        draw.draw(st.sampled_from((0, 1, 4095, 0x7FFF, 0x8000, 0x8001)) | st.integers(0, 65535))
        for _ in nodes
    ]
    rest = (9,) if longer else ()
    data = b"".join(packet(id, 0, *raw.to_bytes(2, "little"), *rest) for id, raw in enumerate(raws))
    plain = all(node.settings is not None and not node.settings.shift for node in nodes)
    assert (exchange.whole is not None) == plain
    assert is_same(exchange, data) == (plain and max(raws) < 0x8000)
    spoilt = bytearray(data)
    spoilt[draw.draw(st.integers(0, len(data) - 1))] ^= draw.draw(st.integers(1, 255))
    assert not is_same(exchange, bytes(spoilt))
    nodes[-1].settings = met("sts", at_30=2).settings
    assert not is_same(exchange, data)


def test_where_they_are_is_what_was_told_the_quick_way_and_under_other_settings_is_not() -> None:
    nodes = [met("sts", 1), met("sts", 2)]
    exchange: Any = driver.sync_read_positions(nodes)
    data = packet(1, 0, 0, 4) + packet(2, 0, 0, 8)
    found = exchange.whole(data, AT)
    answer = Answer(tuple(Reply(0, one[2], one) for one in (data[:8], data[8:])), (), AT)
    assert exchange.tells_position(answer) == found.values
    found.values.clear()  # what was given away is not what is kept
    assert set(exchange.tells_position(answer)) == {1, 2}
    nodes[0].forget_settings()
    assert set(exchange.tells_position(answer)) == {2}
