"""Velocity, duty, current and steps: what is sent in the mode it is for, and refused in every other."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan, radians, tau
from typing import Any

import pytest

from motorbus.core.operation import Goal, Runnable
from motorbus.errors import LimitExceeded, MotorbusError, OutcomeUnknown, RequestError, Stalled
from motorbus.families.feetech.driver import Node, Powerless, set_current, set_duty, set_velocity, step
from motorbus.families.feetech.table import HLS, TABLES, Mode
from tests.families.feetech.driver_script import (
    Line,
    Played,
    low_high,
    play,
    prepares,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import met, prepares_as

COUNT = tau / 4096
SCS_COUNT = radians(300) / 1024
MOTOR = {"at_11": 0, "at_12": 0}


# -- velocity ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "changes", "velocity", "data"),
    [
        ("sts", {"at_33": 1}, -1000, (0xE8, 0x83)),
        ("sts", {"at_33": 1, "at_18": 8}, -1000, (20, 0x80)),
        ("smbl", {"at_33": 1}, 1000, (0xE8, 3)),
        ("smcl", {"at_35": 1}, 1000, (0xE8, 3)),
    ],
)
def test_a_velocity_has_the_unit_and_the_sign_of_its_servo(
    name: str, changes: dict[str, int], velocity: int, data: tuple[int, int]
) -> None:
    wish = set_velocity(met(name), velocity * COUNT)
    _, exchange = watch(wish, prepares_as(name, **changes), writes(3, 46, *data)).exchanges
    (goal,) = exchange.goals
    assert goal.quantity == "velocity"
    assert goal.value == pytest.approx(velocity * COUNT)
    assert exchange.repeatable


def test_hls_velocities_bring_no_bound_as_long_as_there_is_one() -> None:
    node, asked = met("hls"), prepares_as("hls", at_33=1)
    play(set_velocity(node, -1000 * COUNT), asked, reads(3, 44, 0x2C, 1), writes(3, 46, 20, 0x80))
    play(set_velocity(node, 1000 * COUNT), asked, writes(3, 46, 20, 0))
    play(set_velocity(node, 1000 * COUNT, current=1.3), asked, writes(3, 44, 200, 0, 20, 0))


def test_hls_without_a_bound_gets_one_and_it_is_told() -> None:
    played = Played([prepares_as("hls", at_33=1), reads(3, 44, 0, 0), writes(3, 44, 0xF4, 1, 20, 0)])
    played.run(set_velocity(Node(3), 1000 * COUNT))
    assert played.events == [Powerless(3, 500 * HLS["goal_torque"].scale)]


def test_an_acceleration_goes_first_and_stays() -> None:
    play(
        set_velocity(Node(3), 1000 * COUNT, acceleration=5000 * COUNT),
        *(prepares(at_33=1), writes(3, 41, 50), writes(3, 46, 0xE8, 3)),
    )


def test_smcl_is_given_no_negative_velocity() -> None:
    with pytest.raises(RequestError, match="out of range 0"):
        play(set_velocity(Node(3), -1000 * COUNT), prepares_as("smcl", at_35=1))


# -- duty and current ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "changes", "data"),
    [
        ("sts", {"at_33": 2}, (0xF4, 5)),
        ("smbl", {"at_33": 2}, (0xF4, 5)),
        ("smcl", {"at_35": 2}, (0xF4, 5)),
        ("scs", MOTOR, (5, 0xF4)),
        ("scs2", MOTOR, (5, 0xF4)),
    ],
)
def test_a_duty_is_written_with_its_sign_at_bit_10(
    name: str, changes: dict[str, int], data: tuple[int, int]
) -> None:
    wish = set_duty(met(name), -0.5)
    _, exchange = watch(wish, prepares_as(name, **changes), writes(3, 44, *data)).exchanges
    assert exchange.goals == (Goal(3, "load", -0.5, -1.0, 1.0),)


def test_hls_has_no_register_for_a_duty_that_is_published() -> None:
    with pytest.raises(RequestError, match="nobody has published which register takes the duty") as caught:
        play(set_duty(Node(3), 0.5), prepares_as("hls", at_33=3))
    assert "memory table" in caught.value.cause


def test_a_current_is_a_goal_in_current_mode() -> None:
    asked = prepares_as("hls", at_33=2)
    _, exchange = watch(set_current(met("hls"), -1.3), asked, writes(3, 44, 200, 0x80)).exchanges
    (goal,) = exchange.goals
    assert goal.quantity == "current"
    assert goal.value == pytest.approx(-1.3)
    play(set_current(Node(3), 0.0), asked, writes(3, 44, 0, 0))
    with pytest.raises(LimitExceeded, match="more than it can be told"):
        play(set_current(Node(3), 14.0), asked)


# -- steps ---------------------------------------------------------------------------------------------------

STEPS = {"at_33": 3, **MOTOR}


def sample(raw: int, moving: int = 1) -> Line:
    return reads(3, 56, *low_high(raw), *[0] * 8, moving, 0, 0, 0, 0)


def test_a_step_is_one_packet_that_is_never_repeated() -> None:
    wish = step(Node(3), -1000 * COUNT, velocity=500 * COUNT, acceleration=200 * COUNT, wait=False)
    _, exchange = watch(wish, prepares(**STEPS), writes(3, 41, 2, 0xE8, 0x83, 0, 0, 0xF4, 1)).exchanges
    goal, speed = exchange.goals
    assert speed.quantity == "speed"
    assert goal.quantity == "relative"
    assert goal.value == pytest.approx(-1000 * COUNT)
    assert not exchange.repeatable


def test_a_step_that_was_not_acknowledged_is_not_sent_again() -> None:
    with pytest.raises(OutcomeUnknown):
        play(
            step(Node(3), 1000 * COUNT, wait=False),
            prepares(**STEPS),
            unheard(writes(3, 41, 0, 0xE8, 3, 0, 0, 0, 0)),
        )


def test_the_way_of_a_step_is_followed_over_the_end_of_a_turn() -> None:
    samples = [sample(raw % 4096) for raw in range(4000, 8600, 600)]
    play(
        step(Node(3), 4596 * COUNT),
        *(prepares(**STEPS), reads(3, 56, *low_high(4000)), writes(3, 41, 0, *low_high(4596), 0, 0, 0, 0)),
        *(*samples, sample(8596 - 8192, 0)),
    )


def test_a_step_of_a_whole_turn_is_not_over_before_it_began() -> None:
    with pytest.raises(Stalled, match="6.283 rad off its goal"):
        play(
            step(Node(3), 4096 * COUNT),
            *(prepares(**STEPS), reads(3, 56, 0, 4), writes(3, 41, 0, 0, 0x10, 0, 0, 0, 0)),
            *[sample(1024, 0)] * 25,
            unheard(prepares()),  # what may be in the way
        )


def test_a_step_is_measured_by_what_the_offset_leaves() -> None:
    play(
        step(Node(3), 1000 * COUNT),
        prepares(**STEPS, at_31=100),
        *(reads(3, 56, 50, 0), writes(3, 41, 0, 0xE8, 3, 0, 0, 0, 0), sample(1050, 0)),
    )


def test_a_step_too_far_for_the_register_is_refused() -> None:
    with pytest.raises(LimitExceeded, match="too far for one step"):
        play(step(Node(3), 30720 * COUNT), prepares(**STEPS))


# -- refusals ------------------------------------------------------------------------------------------------

ORDERS: dict[Mode, Callable[[Node], Runnable[Any]]] = {
    Mode.VELOCITY: lambda node: set_velocity(node, 1.0),
    Mode.PWM: lambda node: set_duty(node, 0.5),
    Mode.CURRENT: lambda node: set_current(node, 0.5),
    Mode.STEP: lambda node: step(node, 0.5),
}


@pytest.mark.parametrize("wanted", ORDERS)
@pytest.mark.parametrize("name", TABLES)
def test_an_order_for_another_mode_is_refused_and_the_way_out_is_named(name: str, wanted: Mode) -> None:
    node = met(name)
    with pytest.raises(RequestError) as caught:
        play(ORDERS[wanted](node), prepares_as(name))
    if wanted in node.control.has and (name, wanted) != ("hls", Mode.PWM):
        assert f"set_mode({wanted.value!r})" in caught.value.advice
    elif name != "hls":
        assert "mode only" in caught.value.advice


@pytest.mark.parametrize(
    ("wanted", "name", "code"), [(Mode.VELOCITY, "sts", 1), (Mode.PWM, "sts", 2), (Mode.STEP, "sts", 3)]
)
def test_an_order_for_the_mode_that_it_was_in_is_refused(wanted: Mode, name: str, code: int) -> None:
    """Another program has put it into position mode since."""
    with pytest.raises(RequestError, match="in operating mode position"):
        play(ORDERS[wanted](met(name, at_33=code)), prepares_as(name))


@pytest.mark.parametrize("wanted", ORDERS)
@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_in_a_mode_that_nobody_explains_nothing_is_ordered(name: str, wanted: Mode) -> None:
    with pytest.raises(RequestError):
        play(ORDERS[wanted](Node(3)), prepares_as(name, at_33=9))


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("order", [set_velocity, set_duty, set_current, step])
def test_what_is_no_number_costs_no_packet(order: Callable[..., Runnable[Any]], value: float) -> None:
    with pytest.raises(LimitExceeded):
        play(order(Node(3), value))


@pytest.mark.parametrize("order", [set_velocity, set_duty, set_current])
def test_what_is_of_another_type_costs_no_packet(order: Callable[..., Runnable[Any]]) -> None:
    with pytest.raises(MotorbusError, match="is no"):
        play(order(Node(3), True))


@pytest.mark.parametrize("duty", [1.001, -2.0])
def test_a_duty_beyond_the_whole_is_refused(duty: float) -> None:
    with pytest.raises(LimitExceeded, match="is no duty"):
        play(set_duty(met("sts", at_33=2), duty))
