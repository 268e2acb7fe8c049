"""When a move is over: two looks in position; else stalled, or out of time, by the link's clock."""

from __future__ import annotations

import pytest

from motorbus.core.arrival import STALL_TIME
from motorbus.errors import MotionError, Stalled
from motorbus.families.kst.driver.motion import wait_arrival
from tests.families.kst.bench import bench, node, play

LOOK = "605#4002600000000000"


def at(raw: int) -> tuple[str, str]:
    return LOOK, "4b026000" + raw.to_bytes(2, "little", signed=True).hex() + "0000"


def test_in_position_is_two_looks_in_a_row() -> None:
    for looks in ([0, 30, 57, 58], [0, 57, 90, 57, 58], [57, 57]):
        play(wait_arrival(node(), 0.1, 0.02, None), *map(at, looks))


def test_who_does_not_move_has_stalled() -> None:
    looks = int(STALL_TIME / 0.02) + 1
    with pytest.raises(Stalled, match="off its goal") as raised:
        play(wait_arrival(node(), 1.0, 0.02, None), *[at(10 + n % 2) for n in range(looks)])
    assert "profile=xqpower" in raised.value.advice


def test_who_is_slow_is_late() -> None:
    with pytest.raises(MotionError, match="after 0.2 s") as raised:
        play(wait_arrival(node(), 1.0, 0.02, 0.2), *[at(3 * n) for n in range(11)])
    assert not isinstance(raised.value, Stalled)


def test_a_servo_that_is_not_started_stalls_and_the_error_says_why() -> None:
    with bench(profile="xqpower", settings={"nmt": "none"}) as there:
        with pytest.raises(Stalled):
            there.servo().move(0.5)
        there.sim().voltage = 3.0
        there.link.advance(0.01)
        with pytest.raises(Stalled, match="low voltage"):
            there.servo().move(0.5)
