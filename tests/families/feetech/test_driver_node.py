"""What the settings of a servo mean for ids, units, limits and alarms; nothing is guessed."""

from __future__ import annotations

import sys
from contextlib import suppress
from copy import copy
from math import inf, nan, tau
from types import FrameType
from typing import Any

import pytest

from motorbus.core.entry import Value
from motorbus.errors import RequestError
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.node import CHANGES, Settings, _set_settings, as_nodes
from motorbus.families.feetech.table import CONTROL, STS, TABLES, Control, Mode
from tests.families.feetech.driver_script import prepared
from tests.families.feetech.maps import met, simulated

COUNT = tau / 4096


@pytest.mark.parametrize("id", [0, 1, 253])
def test_ids_of_one_servo_are_0_to_253(id: int) -> None:
    assert Node(id).node == id


@pytest.mark.parametrize("id", [-1, 254, 255, 1000, 1.0, "3", True, None])
def test_nothing_else_is_the_id_of_one_servo(id: object) -> None:
    with pytest.raises(RequestError, match="not the id of a servo"):
        Node(id)  # type: ignore[arg-type]


def test_254_is_named_as_everyone() -> None:
    with pytest.raises(RequestError, match="everyone at once"):
        Node(254)


def test_a_new_node_knows_nothing() -> None:
    node = Node(3)
    assert (node.identity, node.table, node.settings, node.limits, node.known_mode) == (None,) * 5
    assert (node.alarm, node.at, node.writable) == ((), -inf, False)


def looks_while_set(node: Node, settings: Settings | None, cut: int) -> list[tuple[object, Settings | None]]:
    """What others see before each line of setting these; an interrupt falls in front of this line, where it is one."""
    looks: list[tuple[object, Settings | None]] = []

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        if event == "line" and frame.f_code is _set_settings.__code__:
            looks.append((CHANGES.now, node.settings))
            if len(looks) == cut:
                raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    with suppress(KeyboardInterrupt):
        sys.settrace(trace)
        try:
            node.settings = settings
        finally:
            sys.settrace(before)
    return looks


def test_whoever_has_looked_while_settings_were_set_looks_again() -> None:
    node, others = met("sts", 1), met("sts", 1, at_30=2).settings
    looks = looks_while_set(node, others, cut=0)
    assert len(looks) == 4
    assert node.settings is others
    for token, settings in looks:
        assert token is not CHANGES.now or settings is others


@pytest.mark.parametrize("cut", [1, 2, 3, 4])
def test_settings_that_were_set_before_an_interrupt_are_seen(cut: int) -> None:
    node, others = met("sts", 1), met("sts", 1, at_30=2).settings
    token = CHANGES.now
    assert len(looks_while_set(node, others, cut)) == cut
    assert (node.settings is others) == (cut == 4)
    assert token is not CHANGES.now or node.settings is not others


def test_settings_of_a_copy_are_its_own() -> None:
    node = met("sts", 1)
    made_by, other = node.settings, copy(node)
    node.forget_settings()
    assert other.settings is made_by


def test_limits_are_those_of_the_servo() -> None:
    low, high = prepared(at_9=0x64, at_11=0xB8, at_12=0x0B).limits or (nan, nan)
    assert (low, high) == (100 * COUNT, 3000 * COUNT)


def test_both_limits_0_are_many_turns() -> None:
    assert prepared(at_11=0, at_12=0).limits == (-30719 * COUNT, 30719 * COUNT)


@pytest.mark.parametrize(
    ("phase", "factor", "zero_is_maximum", "tells_current"),
    [
        (0b00_1100, 1, True, True),
        (0b00_1000, 50, True, True),
        (0b00_0100, 1, False, True),
        (0b10_1100, 1, True, False),
        (0, 50, False, True),
    ],
)
def test_the_phase_register_says_what_velocities_and_currents_mean(
    phase: int, factor: int, zero_is_maximum: bool, tells_current: bool
) -> None:
    node = prepared(at_18=phase)
    assert node.settings is not None
    assert node.settings.zero_is_maximum is zero_is_maximum
    assert node.settings.tells_current is tells_current
    for name in ("present_velocity", "goal_velocity"):
        assert node.value(STS[name], 10) == pytest.approx(10 * factor * COUNT)
        assert node.raw(STS[name], 10 * factor * COUNT) == 10


def test_angular_resolution_widens_every_position_and_the_limits() -> None:
    node = prepared(at_30=2)
    assert node.value(STS["present_position"], 1000) == pytest.approx(2000 * COUNT)
    assert node.raw(STS["goal_position"], 2000 * COUNT) == 1000
    assert node.limits == (0, 2 * 4095 * COUNT)
    assert node.value(STS["max_position_limit"], 4095) == 2 * 4095 * COUNT
    assert node.raw(STS["min_position_limit"], 2000 * COUNT) == 1000


def test_limits_that_are_written_are_the_limits_that_hold() -> None:
    with simulated("sts") as (simulation, servo):
        simulation.memory["angular_resolution"] = 2
        servo.write(min_position_limit=2.0, max_position_limit=10.0)
        assert servo.read("min_position_limit", "max_position_limit") == {
            "min_position_limit": pytest.approx(2.0, abs=2 * COUNT),
            "max_position_limit": pytest.approx(10.0, abs=2 * COUNT),
        }
        assert servo.mode() is Mode.POSITION  # which asks anew
        assert servo.limits == pytest.approx((2.0, 10.0), abs=2 * COUNT)
        assert simulation.memory["max_position_limit"] == round(10.0 / COUNT / 2)


def test_status_return_level_and_mode_are_known() -> None:
    node = prepared(at_8=0, at_33=1)
    assert node.settings is not None
    assert node.settings.answers_writes is False
    assert (node.known_mode, node.settings.mode_code) == (Mode.VELOCITY, 1)


def test_settings_are_forgotten_and_identity_is_not() -> None:
    node = prepared()
    node.forget_settings()
    assert (node.limits, node.known_mode) == (None, None)
    assert node.writable


@pytest.mark.parametrize("value", [True, "1", None, [1]])
def test_only_numbers_are_values(value: object) -> None:
    wrong: Value = value  # type: ignore[assignment]
    with pytest.raises(RequestError, match="not a number"):
        prepared().raw(STS["position_p"], wrong)


def test_every_alarm_bit_is_told_and_none_stays() -> None:
    node = Node(3)
    node.heard(0b1110_0001, 7.0)
    assert node.alarm == ("voltage", "overload", "undefined bit 6", "undefined bit 7")
    node.heard(0, 8.0)
    assert not node.alarm
    assert node.at == 8.0


def test_ids_and_servos_mix_and_each_is_visited_once() -> None:
    known = prepared(4)
    assert [(n.node, n is known) for n in as_nodes([2, known, 4, 2])] == [(2, False), (4, True)]


# -- of every map ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TABLES)
def test_every_map_that_is_known_is_writable_and_knows_its_parts(name: str) -> None:
    node = met(name)
    assert node.writable
    assert node.control is CONTROL[name]
    assert node.known_mode is Mode.POSITION


def test_an_unknown_map_is_read_only_and_plays_no_part() -> None:
    node = prepared(at_0=9)
    assert not node.writable
    assert node.control == Control()
    assert (node.known_mode, node.limits) == (None, None)
    assert Node(3).control == Control()


@pytest.mark.parametrize(
    ("name", "changes", "mode", "code"),
    [
        ("hls", {"at_33": 2}, Mode.CURRENT, 2),
        ("hls", {"at_33": 3}, Mode.PWM, 3),
        ("hls", {"at_33": 4}, None, 4),
        ("smcl", {"at_35": 1}, Mode.VELOCITY, 1),
        ("smcl", {"at_33": 1}, Mode.POSITION, 0),
        ("smbl", {"at_33": 3}, Mode.STEP, 3),
        ("scs", {"at_11": 0, "at_12": 0}, Mode.PWM, None),
        ("scs2", {"at_33": 1}, Mode.POSITION, None),
    ],
)
def test_the_mode_is_what_its_map_says(
    name: str, changes: dict[str, int], mode: Mode | None, code: int | None
) -> None:
    settings = met(name, **changes).settings
    assert settings is not None
    assert (settings.mode, settings.mode_code) == (mode, code)


@pytest.mark.parametrize(("name", "turns"), [("sts", True), ("smbl", True), ("hls", True), ("smcl", False)])
def test_both_limits_0_are_many_turns_where_that_is_published(name: str, turns: bool) -> None:
    node = met(name, at_11=0, at_12=0)
    assert node.settings is not None
    assert node.settings.many_turns is turns
    assert (node.limits is not None) is turns


OFFSETS = {
    "sts": {"at_31": 100},
    "smbl": {"at_31": 100},
    "smcl": {"at_33": 100},
    "hls": {"at_31": 100},
    "scs2": {"at_34": 100},
}
OTHER_MODE = {
    "sts": {"at_33": 1},
    "smbl": {"at_33": 2},
    "smcl": {"at_35": 1},
    "hls": {"at_33": 2},
    "scs2": {"at_11": 0, "at_12": 0},
}


@pytest.mark.parametrize("name", OFFSETS)
def test_the_homing_offset_is_taken_out_in_every_mode_but_position(name: str) -> None:
    row = TABLES[name]["present_position"]
    turn = CONTROL[name].turn
    node = met(name, **OFFSETS[name])
    assert node.settings is not None
    assert (node.settings.offset, node.settings.turn) == (100, turn)
    assert node.value(row, 500) == pytest.approx(500 * row.scale)
    node = met(name, **OFFSETS[name], **OTHER_MODE[name])
    assert node.value(row, 500) == pytest.approx(400 * row.scale)
    assert node.value(row, 30) == pytest.approx((turn - 70) * row.scale)
    assert node.value(row, turn + 30) == pytest.approx(
        (turn - 70) * row.scale
    )  # told beyond the turn: no wrap
    assert node.value(TABLES[name]["goal_position"], 500) == pytest.approx(500 * row.scale)


def test_a_position_over_many_turns_is_shifted_and_not_wrapped() -> None:
    node = prepared(at_18=28, at_31=100, at_33=1)
    assert node.settings is not None
    assert node.settings.accumulates
    assert node.value(STS["present_position"], 30) == pytest.approx(-70 * COUNT)


def test_the_offset_of_a_mode_that_nobody_explains_is_left_to_the_servo() -> None:
    assert met("hls", at_31=100, at_33=4).value(TABLES["hls"]["present_position"], 500) == 500 * COUNT
