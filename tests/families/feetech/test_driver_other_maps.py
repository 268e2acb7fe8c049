"""Servos whose map the driver does not command: read by name with right values, and nothing else but let go.

Packets are typed by hand, with the bytes of each map's own order and units.
"""

from __future__ import annotations

from collections.abc import Callable
from math import radians, tau
from typing import Any

import pytest

from motorbus.core.operation import Runnable
from motorbus.errors import DeviceError, RequestError
from motorbus.families.feetech import driver
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.identity import learn
from motorbus.families.feetech.driver.motion import move_block
from motorbus.families.feetech.driver.node import COMMANDED
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import image, play, reads, sync_reads, writes

HEADS = {
    "smbl": {"at_0": 2, "at_1": 45, "at_3": 8, "at_4": 44},
    "smcl": {"at_0": 1, "at_1": 10, "at_3": 6, "at_4": 12},
    "scs": {"at_0": 0, "at_1": 10, "at_2": 1, "at_3": 5, "at_4": 4},
    "scs2": {"at_0": 3, "at_1": 25, "at_2": 1, "at_3": 9, "at_4": 15},
    "hls": {"at_0": 3, "at_1": 43, "at_3": 10, "at_4": 18},
}
COUNT = tau / 4096


def eeprom(name: str, **changes: int) -> bytes:
    return image(**{**HEADS[name], **changes})


def met(name: str, **changes: int) -> Node:
    """A servo of this map that has been asked already."""
    node = Node(3)
    learn(node, eeprom(name, **changes))
    return node


def test_these_are_all_the_maps_that_are_not_commanded() -> None:
    assert set(HEADS) == set(TABLES) - COMMANDED


# --- reading ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", HEADS)
def test_it_is_known_by_its_own_map_and_not_writable(name: str) -> None:
    node = Node(3)
    found = play(driver.prepare(node), reads(3, 0, *eeprom(name)))
    assert (found.table, found.details["register_map"], node.table) == (name, name, TABLES[name])
    assert not node.writable
    assert node.mode is None


@pytest.mark.parametrize("name", HEADS)
def test_every_register_is_read_by_its_name(name: str) -> None:
    node = met(name)
    bytes_of = {row.name: (row.address, row.encode(max(row.low, 1))) for row in TABLES[name].values()}
    for row, (address, data) in bytes_of.items():
        raws = play(driver.read_raw(node, row), reads(3, address, *data))
        assert raws == {row: max(TABLES[name][row].low, 1)}


def test_scs_words_have_their_high_byte_first() -> None:
    values = play(
        driver.read(met("scs"), "present_position", "present_velocity"),
        reads(3, 56, 0x02, 0x00, 0x80, 0x0A),
    )
    assert values == {
        "present_position": pytest.approx(radians(150)),
        "present_velocity": pytest.approx(-10 * radians(300) / 1024),
    }


def test_hls_velocity_counts_in_steps_of_50_whatever_phase_says() -> None:
    for phase in (0, 4, 12):
        value = play(driver.read(met("hls", at_18=phase), "present_velocity"), reads(3, 58, 20, 0x80))
        assert value == {"present_velocity": pytest.approx(-1000 * COUNT)}


def test_smbl_velocity_is_told_by_bit_2_of_phase_as_on_sts() -> None:
    for phase, unit in ((4, 1), (0, 50)):
        value = play(driver.read(met("smbl", at_18=phase), "present_velocity"), reads(3, 58, 20, 0))
        assert value == {"present_velocity": pytest.approx(20 * unit * COUNT)}


def test_the_angular_resolution_stretches_positions_where_a_map_has_one() -> None:
    for name, factor in (("smbl", 3), ("hls", 3), ("smcl", 1)):
        value = play(driver.read(met(name, at_30=3), "present_position"), reads(3, 56, 100, 0))
        assert value == {"present_position": pytest.approx(100 * factor * COUNT)}


def test_offsets_have_their_sign_where_the_map_has_it() -> None:
    for name, address, data, counts in (
        ("smbl", 31, (0x74, 0x0E), -1652),
        ("smcl", 33, (0x74, 0x0E), -1652),
        ("hls", 31, (0x74, 0x86), -1652),
    ):
        value = play(driver.read(met(name), "homing_offset"), reads(3, address, *data))
        assert value == {"homing_offset": pytest.approx(counts * COUNT)}


def test_telemetry_of_an_hls_servo() -> None:
    block = (0, 8, 20, 0, 50, 4, 74, 30, 0, 0, 1, 0, 8, 100, 0)
    state = play(driver.telemetry(met("hls")), reads(3, 56, *block))
    assert state.position == pytest.approx(2048 * COUNT)
    assert state.velocity == pytest.approx(1000 * COUNT)
    assert (state.load, state.temperature) == (-0.05, 30)
    assert state.voltage == pytest.approx(7.4)
    assert state.current == pytest.approx(0.65)


def test_telemetry_of_an_scs_servo_tells_no_current() -> None:
    block = (2, 0, 0, 5, 0x04, 0x32, 60, 30, 0, 0, 1, 0, 0, 0x12, 0x34)
    state = play(driver.telemetry(met("scs")), reads(3, 56, *block))
    assert state.position == pytest.approx(radians(150))
    assert state.load == -0.05
    assert state.voltage == pytest.approx(6.0)
    assert state.current is None
    with pytest.raises(DeviceError, match="nobody has published whether it tells its present current"):
        play(driver.current(met("scs")))


def test_alarms_have_the_names_of_its_map() -> None:
    node = met("scs")
    play(driver.read(node, "moving"), reads(3, 66, 0, error=0x21))
    assert node.alarm == ("voltage", "overload")
    node = met("hls")
    play(driver.read(node, "moving"), reads(3, 66, 0, error=0x10))
    assert node.alarm == ("undefined bit 4",)


def test_limits_are_told_unless_nobody_knows_what_they_mean() -> None:
    assert met("hls").limits == pytest.approx((0, 4095 * COUNT))
    assert met("scs", at_11=0x03, at_12=0xFF).limits == pytest.approx((0, 1023 * radians(300) / 1024))
    assert met("scs", at_11=0, at_12=0).limits is None


def test_a_register_of_another_map_is_refused_with_a_name() -> None:
    with pytest.raises(RequestError, match="table scs has no register 'torque_limit'"):
        play(driver.read(met("scs"), "torque_limit"))


def test_a_group_of_several_maps_is_read_each_by_its_own() -> None:
    sts, hls, scs = Node(1), Node(2), Node(3)
    for node, data in ((sts, image()), (hls, eeprom("hls")), (scs, eeprom("scs"))):
        learn(node, data)
    result = play(
        driver.sync_read(["present_position"], [sts, hls, scs]),
        *(sync_reads(56, {id: data}, 2) for id, data in ((1, (0, 8)), (2, (0, 4)), (3, (2, 0)))),
    )
    assert {id: row["present_position"] for id, row in result.values.items()} == {
        1: pytest.approx(2048 * COUNT),
        2: pytest.approx(1024 * COUNT),
        3: pytest.approx(radians(150)),
    }
    together = play(
        driver.sync_read_positions([sts, hls, scs]), sync_reads(56, {1: (0, 8), 2: (0, 4), 3: (2, 0)}, 2)
    )
    assert together.values == {1: 2048 * COUNT, 2: 1024 * COUNT, 3: pytest.approx(radians(150))}


# --- and nothing else ---------------------------------------------------------------------------------------

REFUSED: dict[str, Callable[[Node], Runnable[Any]]] = {
    "write": lambda node: driver.write(node, led_mask=1),
    "write goal": lambda node: driver.write(node, goal_position=0.5),
    "reg_write": lambda node: driver.reg_write(node, goal_position=0.5),
    "move": lambda node: driver.move(node, 0.5),
    "stop": driver.stop,
    "factory_restore": driver.factory_restore,
    "sync_write": lambda node: driver.sync_write({node: {"goal_position": 0.5}}),
    "write what only hls has": lambda node: driver.write(node, goal_torque=0.5),
}


@pytest.mark.parametrize("verb", REFUSED)
@pytest.mark.parametrize("name", HEADS)
def test_it_refuses_to_be_written_and_moved_and_not_a_byte_leaves(name: str, verb: str) -> None:
    with pytest.raises(DeviceError, match=f"map {name} is read and not commanded yet") as caught:
        play(REFUSED[verb](met(name)))
    assert caught.value.node == 3
    assert "nothing was written" in str(caught.value)


@pytest.mark.parametrize("name", HEADS)
def test_torque_is_not_switched_on(name: str) -> None:
    with pytest.raises(DeviceError, match="not commanded yet"):
        play(driver.enable_torque(met(name)), reads(3, 0, *eeprom(name)))


@pytest.mark.parametrize("name", HEADS)
def test_no_loop_and_no_group_moves_it(name: str) -> None:
    node = met(name)
    with pytest.raises(DeviceError, match="not commanded yet"):
        driver.sync_write_positions([node], [0.5])
    assert node.table is not None
    with pytest.raises(DeviceError, match="not commanded yet"):
        move_block(node, node.table, 0.5)


@pytest.mark.parametrize("name", HEADS)
def test_torque_off_works_on_every_map(name: str) -> None:
    play(driver.disable_torque(met(name)), writes(3, 40, 0))


def test_a_name_that_only_another_map_has_is_no_register_of_an_sts_servo() -> None:
    node = Node(3)
    learn(node, image())
    with pytest.raises(RequestError, match="table sts has no register 'goal_torque'"):
        play(driver.write(node, goal_torque=0.5))


def test_an_unknown_map_tells_no_position_to_a_loop() -> None:
    node = Node(3)
    learn(node, image(at_0=9, at_1=9))
    with pytest.raises(DeviceError, match="cannot tell its position in a unit"):
        driver.sync_read_positions([node])
