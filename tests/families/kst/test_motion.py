"""Moves: start rule, limits, arrival, stalls, time-outs, stop, health."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians

import pytest

from motorbus.core.family import Identity
from motorbus.core.request import Notification
from motorbus.errors import DeviceError, LimitExceeded, MotionError, Stalled
from motorbus.families.kst import FAMILY, Promise
from motorbus.families.kst.notifications import LOW_VOLTAGE
from motorbus.link.base import PerfectLine
from tests.families.kst.bench import Answers, Bench, abort

POSITION = "605#4002600000000000"
LIMITS = ["605#400A300000000000", "605#400B300000000000"]


def position(raw: int) -> str:
    """The reply of node 5 at this position."""
    return f"585#4B026000{raw.to_bytes(2, 'little', signed=True).hex()}0000"


def test_move_is_one_target_or_a_start_and_a_target() -> None:
    with Bench() as bench:
        bench.servo().move(0.2, wait=False)
        assert bench.sent() == ["605#2203600073000000"]
        bench.servo().move(0.2)
        assert bench.servo().position() == pytest.approx(0.2, abs=0.02)
    with Bench(profile="xqpower") as bench:
        bench.servo().move(0.2, wait=False)
        assert bench.sent() == ["000#0105", "605#22036000CE000000"]


def test_move_outside_the_travel_limits_of_the_servo_is_refused() -> None:
    with Bench(profile="kst-ext") as bench:
        servo = bench.servo()
        servo.write(negative_limit=-0.2, positive_limit=0.1)
        bench.sent()
        with pytest.raises(LimitExceeded):
            servo.move(0.15)
        assert bench.sent() == LIMITS
        servo.move(0.05, wait=False)
        assert bench.sent() == ["605#220360001D000000"], "the limits are known"
        servo.write(positive_limit=0.2)
        servo.move(0.15, wait=False)


def test_servo_without_limits_has_those_of_the_profile() -> None:
    line = Answers({request: abort(int(request[6:8], 16) | 0x3000, 0x0602_0000) for request in LIMITS})
    with Bench(profile="kst-ext", line=line) as bench:
        bench.servo().move(radians(100), wait=False)
        assert bench[5].memory["goal_position"] == 1000


@pytest.mark.parametrize(
    ("raws", "error"),
    [
        ([0, 30, 57, 58], None),
        ([0, 57, 90, 57, 58], None),
        ([57, 57], None),
        ([10] * 26, "Stalled"),
        ([3 * step for step in range(11)], "MotionError"),
    ],
    ids=["two near", "one of two is far", "at once", "no progress", "late"],
)
def test_move_ends_after_two_positions_near_the_goal(raws: Sequence[int], error: str | None) -> None:
    """A servo without progress for 0.5 s is stalled; one that needs more than `timeout` is late."""
    with Bench(line=Answers({POSITION: [position(raw) for raw in raws]})) as bench:
        if error is None:
            bench.servo().move(0.1)
        else:
            with pytest.raises(MotionError) as raised:
                bench.servo().move(0.1, timeout=0.2 if error == "MotionError" else None)
            assert type(raised.value).__name__ == error
        assert bench.sent().count(POSITION) == len(raws)


def test_stall_names_the_start_rule_and_alarms() -> None:
    with Bench(profile="xqpower", settings={"nmt": "none"}) as bench:
        with pytest.raises(Stalled, match="off its goal") as raised:
            bench.servo().move(0.5)
        assert "profile=xqpower" in raised.value.advice
        bench.settings.state.note(Notification(5, "alarm", LOW_VOLTAGE))
        with pytest.raises(Stalled, match="low voltage"):
            bench.servo().move(0.5)


@pytest.mark.parametrize(
    ("raw", "targets"), [(300, ["2C01"]), (950, ["B603", "8403"]), (-950, ["4AFC", "7CFC"])]
)
def test_stop_holds_the_present_position_or_the_end_of_the_range(raw: int, targets: list[str]) -> None:
    with Bench() as bench:
        bench[5].raw_position = raw
        assert bench.servo().stop() is Promise.HOLD_REQUESTED
        assert bench.sent() == [POSITION, *(f"605#22036000{target}0000" for target in targets)]


def test_estop_holds_each_known_servo_also_outside_the_range() -> None:
    with Bench(5, 6) as bench:
        for node, raw in ((5, 300), (6, 950)):
            bench[node].raw_position = raw
            assert bench.servo(node).ping() is True
        assert sorted(bench.bus.estop().acknowledged) == [5, 6]
        assert [bench[node].memory["goal_position"] for node in (5, 6)] == [300, 900]


@pytest.mark.parametrize(("profile", "request_"), [("kst", POSITION), ("kst-ext", "605#4005600000000000")])
def test_health_is_one_read_and_counts_boot_messages(profile: str, request_: str) -> None:
    line = Answers({request_: [abort(0, 0), f"705#00 {abort(0, 0)}"]})
    with Bench(profile=profile) as bench:
        health, servo = FAMILY.open().axis(Identity(5, "", "", profile)).health, bench.servo()
        assert bench.bus.run(health(servo)).restarts == 0
        assert bench.sent() == [request_]
        bench.link.line = line
        for _ in range(2):
            with pytest.raises(DeviceError):
                bench.bus.run(health(servo))
        bench.link.line = PerfectLine()
        assert bench.bus.run(health(servo)).restarts == 1
