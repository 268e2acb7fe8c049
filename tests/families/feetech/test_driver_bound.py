"""The bound of the current that every order to an HLS servo carries, and never as 0: bytes typed by hand."""

from __future__ import annotations

from math import tau

import pytest

from motorbus.errors import OutcomeUnknown, RequestError
from motorbus.families.feetech import driver
from motorbus.families.feetech.driver import Powerless
from motorbus.families.feetech.driver.bound import ask_bound, raw_bound
from motorbus.families.feetech.table import HLS
from tests.families.feetech.driver_script import Line, Played, play, reads, unheard, writes
from tests.families.feetech.maps import eeprom, met, prepares_as

COUNT = tau / 4096
GOAL = 1024 * COUNT


ASKED, IS_ON = prepares_as("hls"), reads(3, 40, 1)


def goes(bound: tuple[int, int], velocity: int = 68) -> Line:
    return writes(3, 40, 1, 0, 0, 4, *bound, velocity, 0)


def test_what_is_set_is_read_once_and_carried_along() -> None:
    node = met("hls")
    play(driver.move(node, GOAL, wait=False), ASKED, reads(3, 44, 0x2C, 1), goes((0x2C, 1)), IS_ON)
    play(driver.move(node, GOAL, wait=False), ASKED, goes((0x2C, 1)), IS_ON)


def test_a_new_bound_is_sent_and_kept_and_nothing_is_read() -> None:
    node = met("hls")
    play(driver.move(node, GOAL, current=1.3, wait=False), ASKED, goes((200, 0)), IS_ON)
    play(driver.move(node, GOAL, wait=False), ASKED, goes((200, 0)), IS_ON)


def test_a_bound_of_0_is_replaced_by_the_protection_current_and_told() -> None:
    played = Played([ASKED, reads(3, 44, 0, 0), goes((0xF4, 1)), IS_ON])
    played.run(driver.move(met("hls"), GOAL, wait=False))
    assert played.events == [Powerless(3, 500 * HLS["goal_torque"].scale)]
    assert "never moves" in str(played.events[0])


def test_a_goal_current_that_was_left_over_bounds_by_its_amount() -> None:
    play(driver.move(met("hls"), GOAL, wait=False), ASKED, reads(3, 44, 100, 0x80), goes((100, 0)), IS_ON)


def test_without_any_bound_nothing_is_sent() -> None:
    none = prepares_as("hls", at_28=0, at_29=0)
    with pytest.raises(RequestError, match="it would never move") as caught:
        play(driver.move(met("hls"), GOAL), none, reads(3, 44, 0, 0))
    assert "current=" in caught.value.advice
    play(driver.move(met("hls"), GOAL, current=0.65, wait=False), none, goes((100, 0)), IS_ON)


@pytest.mark.parametrize("current", [0.0, 0.003, 20.0])
def test_a_bound_that_is_none_is_refused(current: float) -> None:
    with pytest.raises(RequestError, match="is no bound of its current"):
        play(driver.move(met("hls"), GOAL, current=current), ASKED)


def test_writing_it_by_name_makes_it_unknown() -> None:
    node = met("hls")
    play(driver.move(node, GOAL, current=1.3, wait=False), ASKED, goes((200, 0)), IS_ON)
    play(driver.write(node, goal_torque=0.65), writes(3, 44, 100, 0))
    play(driver.move(node, GOAL, wait=False), ASKED, reads(3, 44, 100, 0), goes((100, 0)), IS_ON)


def test_a_doubtful_order_leaves_it_unknown() -> None:
    node = met("hls")
    order = goes((200, 0))
    with pytest.raises(OutcomeUnknown):
        play(
            driver.move(node, GOAL, current=1.3, wait=False),
            *(ASKED, unheard(order), unheard(reads(3, 40, *[0] * 8))),
        )
    assert node.bound is None


@pytest.mark.parametrize("name", ["sts", "smbl", "smcl", "scs", "scs2"])
def test_other_maps_have_none(name: str) -> None:
    node = met(name)
    assert node.table is not None
    play(ask_bound(node, node.table))
    with pytest.raises(RequestError, match="no register that bounds its current"):
        play(driver.move(node, 0.5, current=1.0), prepares_as(name))


def test_nothing_is_guessed_for_a_servo_that_was_not_asked() -> None:
    node = driver.Node(3)
    with pytest.raises(RequestError, match="never move"):
        raw_bound(node, HLS["goal_torque"], None)


def test_a_servo_set_anew_is_asked_anew() -> None:
    node = met("hls")
    play(ask_bound(node, HLS), reads(3, 44, 100, 0))
    node.forget_settings()
    play(driver.prepare(node), reads(3, 0, *eeprom("hls")))
    play(ask_bound(node, HLS), reads(3, 44, 200, 0))
