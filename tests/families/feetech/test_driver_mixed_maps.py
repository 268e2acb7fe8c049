"""Several servos of several maps on one bus, in one packet where that can be: bytes typed by hand."""

from __future__ import annotations

from math import radians, tau

import pytest

from motorbus.errors import DeviceError, RequestError
from motorbus.families.feetech import driver
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.identity import learn
from tests.families.feetech.driver_script import (
    Line,
    image,
    packet,
    play,
    prepared,
    reads,
    sync_reads,
    unheard,
)
from tests.families.feetech.maps import eeprom, met

COUNT = tau / 4096
SCS_COUNT = radians(300) / 1024


def test_a_group_of_several_maps_is_read_each_by_its_own() -> None:
    sts, hls, scs = Node(1), Node(2), Node(3)
    for node, data in ((sts, image()), (hls, eeprom("hls")), (scs, eeprom("scs"))):
        learn(node, data)
    result = play(
        driver.sync_read(["present_position"], [sts, hls, scs]),
        sync_reads(56, {1: (0, 8)}, 2),
        sync_reads(56, {2: (0, 4)}, 2),
        reads(3, 56, 2, 0),
    )
    assert {id: row["present_position"] for id, row in result.values.items()} == {
        1: pytest.approx(2048 * COUNT),
        2: pytest.approx(1024 * COUNT),
        3: pytest.approx(radians(150)),
    }


def test_a_loop_mixes_maps_and_byte_orders_in_one_packet() -> None:
    sts, hls, scs = met("sts", 1), met("hls", 2), met("scs", 4)
    write = driver.sync_write_positions([sts, hls, scs], [2048 * COUNT, 1024 * COUNT, 512 * SCS_COUNT])
    play(write, Line(packet(254, 0x83, 42, 2, 1, 0, 8, 2, 0, 4, 4, 2, 0), None))
    assert [goal.high for goal in write.goals] == pytest.approx(
        [4095 * COUNT, 4095 * COUNT, 1023 * SCS_COUNT]
    )
    found = play(
        driver.read_positions([sts, hls, scs]),
        *(sync_reads(56, {1: (0, 8), 2: None}, 2), reads(4, 56, 2, 0)),
    )
    assert found.values == {1: 2048 * COUNT, 4: pytest.approx(512 * SCS_COUNT)}
    assert found.missing == (2,)


def test_who_is_silent_costs_the_others_nothing() -> None:
    nodes = [met("scs", 1), met("scs", 2)]
    found = play(driver.read_positions(nodes), unheard(reads(1, 56, 0, 0)), reads(2, 56, 0, 5))
    assert found.values == {2: pytest.approx(5 * SCS_COUNT)}
    assert found.missing == (1,)


def test_one_packet_cannot_read_those_who_know_no_sync_read() -> None:
    with pytest.raises(RequestError, match="node 2 knows no SYNC READ") as caught:
        driver.sync_read_positions([met("sts", 1), met("scs", 2)])
    assert "read_positions()" in caught.value.advice


def test_a_servo_known_to_lack_sync_read_is_not_asked_by_it() -> None:
    nodes = [met("scs", 1), met("scs2", 2)]
    result = play(driver.sync_read(["moving"], nodes), reads(1, 66, 1), unheard(reads(2, 66, 0)))
    assert result.values == {1: {"moving": 1}}
    assert set(result.errors) == {2}


def test_an_unknown_map_tells_no_position_to_a_loop() -> None:
    node = prepared(at_0=9, at_1=9)
    with pytest.raises(DeviceError, match="cannot tell its position in a unit"):
        driver.sync_read_positions([node])


def test_one_register_that_lies_elsewhere_leaves_in_a_packet_of_its_own() -> None:
    sts, scs = met("sts", 1), met("scs", 2)
    wish = {sts: {"lock": 1}, scs: {"lock": 1}}
    play(
        driver.sync_write(wish),
        Line(packet(254, 0x83, 55, 1, 1, 1), None),
        Line(packet(254, 0x83, 48, 1, 2, 1), None),
    )


def test_all_or_nothing_when_a_register_is_not_in_every_map() -> None:
    with pytest.raises(RequestError, match="table scs has no register 'torque_limit'"):
        play(driver.sync_write({met("sts", 1): {"torque_limit": 0.5}, met("scs", 2): {"torque_limit": 0.5}}))
