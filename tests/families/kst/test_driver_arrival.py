"""When a move is over: two looks in position; else stalled, or out of time, by the link's clock."""

from __future__ import annotations

import pytest

from motorbus.errors import MotionError, Stalled
from motorbus.families.kst.driver.arrival import PATIENCE, Move, arrive
from tests.families.kst.bench import bench, node, play

LOOK = "605#4002600000000000"


def at(raw: int) -> tuple[str, str]:
    return LOOK, "4b026000" + raw.to_bytes(2, "little", signed=True).hex() + "0000"


def test_in_position_is_two_looks_in_a_row() -> None:
    move = Move(0.1, 0.02, None)
    play(arrive(node(), move), at(0), at(30), at(57), at(58))
    play(arrive(node(), move), at(0), at(57), at(90), at(57), at(58))
    play(arrive(node(), move), at(57), at(57))


def test_who_does_not_move_has_stalled() -> None:
    looks = int(PATIENCE / 0.02) + 1
    with pytest.raises(Stalled, match="off its goal") as raised:
        play(arrive(node(), Move(1.0, 0.02, None)), *[at(10 + n % 2) for n in range(looks)])
    assert "profile=xqpower" in raised.value.advice


def test_who_is_slow_is_late() -> None:
    with pytest.raises(MotionError, match="after 0.2 s") as raised:
        play(arrive(node(), Move(1.0, 0.02, 0.2)), *[at(3 * n) for n in range(11)])
    assert not isinstance(raised.value, Stalled)
    assert Move(1.0, 0.02, None).allowance(2.0) == 5.0


def test_a_servo_that_is_not_started_stalls_and_the_error_says_why() -> None:
    with bench(profile="xqpower", settings={"nmt": "none"}) as there:
        with pytest.raises(Stalled):
            there.servo().move(0.5)
        there.sim().voltage = 3.0
        there.link.advance(0.01)
        with pytest.raises(Stalled, match="low voltage"):
            there.servo().move(0.5)
