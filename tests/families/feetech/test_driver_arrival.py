"""In position, stalled, or out of time: judged by what the samples say and when they came."""

from __future__ import annotations

from math import tau

import pytest

from motorbus.errors import MotionError, Stalled
from motorbus.families.feetech.driver.arrival import POLL, Move, arrive
from motorbus.families.feetech.table import STS
from tests.families.feetech.driver_script import (
    Line,
    Played,
    image,
    low_high,
    prepared,
    prepares,
    reads,
    unheard,
)

COUNT = tau / 4096


def sample(raw: int, moving: int = 1, error: int = 0) -> Line:
    return reads(3, 56, *low_high(raw), *[0] * 8, moving, 0, 0, 0, 0, error=error)


def stalls(*samples: Line, after: int = 24) -> list[Line]:
    """The last of these again and again until it counts as stalled; and nobody answers what is in the way then."""
    return [*samples, *[samples[-1]] * after, unheard(prepares())]


def wait_for(goal: int, samples: list[Line], **wish: float) -> Played:
    """`wish` in rad, rad/s and s."""
    order = Move(
        goal * COUNT,
        wish.get("velocity"),
        wish.get("acceleration"),
        wish.get("tolerance", 0.05),
        wish.get("timeout"),
    )
    played = Played(samples)
    played.run(arrive(prepared(), STS, order))
    assert played.script == []
    return played


def test_there_and_at_rest_is_in_position() -> None:
    wait_for(2048, [sample(2048, 0)])
    wait_for(2048, [sample(0), sample(1024), sample(2030, 0)])


def test_passing_through_the_goal_is_not_in_position() -> None:
    wait_for(2048, [sample(2047), sample(2060), sample(2050, 0)])


def test_the_tolerance_decides() -> None:
    wait_for(2048, [sample(2048 - 32, 0)])
    with pytest.raises(Stalled):
        wait_for(2048, stalls(sample(2048 - 32, 0)), tolerance=31 * COUNT)


@pytest.mark.parametrize("moving", [0, 1])
def test_standing_off_the_goal_is_a_stall_whatever_the_flag_says(moving: int) -> None:
    bounds = reads(3, 13, 70, 80, 40, error=0x20)
    played = Played([*stalls(sample(1000, moving, error=0x20)), bounds])
    with pytest.raises(
        Stalled, match=r"stands at 1\.534 rad, 1\.608 rad off its goal.*alarms: overload"
    ) as caught:
        played.run(arrive(prepared(), STS, Move(2048 * COUNT, None, None, 0.05, None)))
    assert 0.5 < played.now - 100 < 0.6
    assert caught.value.node == 3
    assert "stop()" in caught.value.advice


def test_progress_of_two_counts_is_progress_and_one_count_is_noise() -> None:
    slow = [sample(1000 + 2 * (index // 20), 1) for index in range(200)]
    wait_for(1020, [*slow, sample(1020, 0)], tolerance=0.0, timeout=60.0)
    with pytest.raises(Stalled):
        wait_for(2048, stalls(*[sample(1000 + index % 2, 1) for index in range(24)], after=1))


def test_a_stall_says_which_setting_is_in_the_way() -> None:
    limp = [*(0, 0, 0, 8, 0, 0, 0, 0), 0xE8, 3]
    masks = image()[9:20]
    script = [
        *stalls(sample(1000, 0))[:-1],
        prepares(),
        reads(3, 9, *masks),
        reads(3, 40, *limp),
        reads(3, 65, 0),
    ]
    with pytest.raises(Stalled, match="2048|off its goal") as caught:
        wait_for(2048, script)
    assert caught.value.cause == "its torque is off (torque_enable 0): enable_torque()"


def test_a_slow_move_is_given_time_for_its_counts() -> None:
    crawl = [sample(1000 + index // 45) for index in range(500)]
    wait_for(1011, [*crawl, sample(1011, 0)], velocity=COUNT, tolerance=0.0, timeout=60.0)


def test_the_time_allowed_follows_from_way_and_velocity() -> None:
    assert Move(0, 0.5, None, 0.05, None).allowance(2.0) == pytest.approx(1 + 2 * 2.0 / 0.5)
    assert Move(0, 100.0, None, 0.05, None).allowance(2.0) == pytest.approx(1 + 2 * 2.0 / 2.0)
    assert Move(0, None, 4.0, 0.05, None).allowance(2.0) == pytest.approx(1 + 2 * (1.0 + 0.5))
    assert Move(0, 0.5, 4.0, 0.05, 7.0).allowance(2.0) == 7.0


def test_too_late_is_told_with_where_it_is() -> None:
    swing = [sample(1000 if index % 2 else 1100) for index in range(100)]
    with pytest.raises(MotionError, match=r"not in position after 0\.3 s: it is at 1\.\d+ rad") as caught:
        wait_for(2048, swing, timeout=0.3)
    assert not isinstance(caught.value, Stalled)


def test_polls_leave_the_bus_to_others() -> None:
    played = wait_for(2048, [sample(0), sample(1024), sample(2048, 0)])
    assert played.now - 100 == pytest.approx(2 * 0.02 + 3 * 0.001)


# -- positions told within a turn ----------------------------------------------------------------------------

TURN = 4096 * COUNT


def ways(move: Move, *samples: Line) -> Played:
    played = Played(list(samples))
    played.run(arrive(prepared(), STS, move))
    assert played.script == []
    return played


def test_a_goal_turns_away_is_compared_within_a_turn_and_not_before_it_could_move() -> None:
    goal = (2 * 4096 + 100) * COUNT
    played = ways(
        Move(goal, None, None, 0.05, None, turn=TURN), sample(3000), sample(4000), sample(102), sample(90, 0)
    )
    assert played.now - 100 > POLL


def test_a_way_from_a_start_is_followed_over_the_seam_in_both_directions() -> None:
    for sign in (1, -1):
        samples = [sample((2000 + sign * gone) % 4096) for gone in range(0, 8000, 1000)]
        goal = (2000 + sign * 8000) * COUNT
        there = sample((2000 + sign * 8000) % 4096, 0)
        ways(
            Move(goal, None, None, 0.05, None, turn=TURN, start=2000 * COUNT),
            *(sample(2000), *samples, there),
        )


def test_a_coarse_servo_makes_no_progress_by_a_count_to_and_fro() -> None:
    played = Played(stalls(*[sample(1000 + number % 2) for number in range(26)], after=0))
    with pytest.raises(Stalled):
        played.run(arrive(prepared(), STS, Move(2048 * COUNT, None, None, 0.05, None, resolution=0.01)))
    assert played.now - 100 < 0.6
