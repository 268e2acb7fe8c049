"""Why a servo does not move: each setting that is in the way is told, with what to do about it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.families.feetech.driver import Node, blockers
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import Line, play, reads
from tests.families.feetech.maps import eeprom, prepares_as, simulated


def asked(name: str, *, torque: int = 1, goal: tuple[int, ...], error: int = 0, **values: int) -> list[Line]:
    """What is read: settings; limits to masks; torque switch to limit; the alarms."""
    image = eeprom(name, **values)
    last = {"sts": 50, "hls": 50, "scs": 48}[name]
    ram = bytes((torque, 0, 0, 0, *goal))[: last - 40]
    return [
        prepares_as(name, **values),
        reads(3, 9, *image[9:20]),
        reads(3, 40, *ram),
        reads(3, 65, error),
    ]


FULL = (0xE8, 3)


def found(name: str, **options: Any) -> tuple[str, ...]:
    return play(blockers(Node(3)), *asked(name, **options))


def test_nothing_is_in_the_way_of_one_that_holds() -> None:
    assert found("sts", goal=(0, 0, 0, 0, *FULL)) == ()
    assert found("hls", goal=(0xF4, 1, 0, 0, *FULL)) == ()
    assert found("scs", goal=(0, 0, 0, 0), max_torque=1000) == ()


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("sts", {"torque": 0, "goal": (0, 0, 0, 0, *FULL)}, "its torque is off (torque_enable 0)"),
        ("hls", {"torque": 2, "goal": (0xF4, 1, 0, 0, *FULL)}, "its torque is off (torque_enable 2)"),
        ("sts", {"goal": (0, 0, 0, 0, 0, 0)}, "torque_limit is 0: set_torque_limit(1.0)"),
        ("sts", {"goal": (0, 0, 0, 0, *FULL), "max_torque": 0}, "after the next power-up"),
        ("scs", {"goal": (0, 0, 0, 0), "max_torque": 0}, "max_torque is 0, which bounds its torque: write("),
        ("hls", {"goal": (0, 0, 0, 0, *FULL)}, "goal_torque is 0: the current of its motor"),
        ("sts", {"goal": (0, 0, 0, 0, *FULL), "operating_mode": 1}, "its goal velocity is 0"),
        ("sts", {"goal": (0, 0, 9, 0, *FULL), "operating_mode": 2}, "its duty is 0"),
        ("hls", {"goal": (0xF4, 1, 0, 0, *FULL), "operating_mode": 4}, "mode 4 is not documented"),
        (
            "sts",
            {"goal": (0, 0, 0, 0, *FULL), "min_position_limit": 9, "max_position_limit": 9},
            "its position limits (9 to 9, raw) leave no way",
        ),
        ("sts", {"goal": (0, 0, 0, 0, *FULL), "error": 32}, "the alarm overload has tripped"),
        ("sts", {"goal": (0, 0, 0, 0, *FULL), "error": 4}, "the alarm temperature lets its torque drop"),
    ],
)
def test_what_is_in_the_way_is_told(name: str, options: dict[str, Any], said: str) -> None:
    (told,) = found(name, **options)
    assert said in told


def test_an_alarm_that_lets_no_torque_drop_is_not_in_the_way() -> None:
    assert found("sts", goal=(0, 0, 0, 0, *FULL), error=1) == ()


def test_both_limits_0_are_many_turns_or_a_motor_and_no_trap() -> None:
    assert found("sts", goal=(0, 0, 0, 0, *FULL), min_position_limit=0, max_position_limit=0) == ()
    motor = {"goal": (50, 0, 0, 0), "max_torque": 1000, "min_position_limit": 0, "max_position_limit": 0}
    assert found("scs", **motor) == ()
    (told,) = found("scs", **{**motor, "goal": (0, 0, 0, 0)})
    assert "its duty is 0" in told


def test_several_are_told_together() -> None:
    assert len(found("hls", torque=0, goal=(0, 0, 0, 0, 0, 0), max_torque=0, unload_mask=4, error=4)) == 5


HELD: dict[str, Callable[[Any], object]] = {
    "enable_torque()": lambda servo: servo.enable_torque(),
    "move()": lambda servo: servo.move(3.0),
    "set_velocity()": lambda servo: servo.set_velocity(0.5),
    "set_current()": lambda servo: servo.set_current(0.65),
    "write(goal_torque=…)": lambda servo: servo.write(goal_torque=0.65),
    "write(protection_current=…)": lambda servo: servo.write(protection_current=0.65),
}
"""What is said to end a goal torque of 0, done."""


@pytest.mark.parametrize(
    ("mode", "protection", "said"),
    [
        ("position", 500, ["enable_torque()", "move()", "write(goal_torque=…)"]),
        ("velocity", 500, ["enable_torque()", "set_velocity()", "write(goal_torque=…)"]),
        ("position", 0, ["write(goal_torque=…)"]),
        ("velocity", 0, ["write(goal_torque=…)"]),
        ("current", 500, ["set_current()"]),
    ],
)
def test_what_is_said_to_end_a_goal_torque_of_0_ends_it(mode: str, protection: int, said: list[str]) -> None:
    for way in said:
        with simulated("hls") as (memory, servo):
            servo.set_mode(mode)
            servo.enable_torque()
            memory.memory["goal_torque"], memory.memory["protection_current"] = 0, protection
            servo.forget_settings()
            (told,) = [told for told in servo.blockers() if told.startswith("goal_torque")]
            assert [call for call in HELD if call in told] == said + ["write(protection_current=…)"][
                protection:
            ]
            HELD[way](servo)
            assert memory.memory["goal_torque"] == (500 if "write" not in way and mode != "current" else 100)
            assert not [told for told in servo.blockers() if told.startswith("goal_torque")]


def test_a_goal_torque_of_0_in_a_mode_that_nobody_explains_is_not_judged() -> None:
    (told,) = found("hls", goal=(0, 0, 0, 0, *FULL), operating_mode=4)
    assert "set_mode('position')" in told
    assert found("hls", goal=(0, 0, 0, 0, *FULL), operating_mode=3) == ()


@pytest.mark.parametrize("name", TABLES)
def test_a_simulated_servo_of_every_map_that_is_limp_and_one_that_holds(name: str) -> None:
    with simulated(name) as (_, servo):
        assert any("its torque is off" in told for told in servo.blockers())
        servo.enable_torque()
        assert servo.blockers() == ()
