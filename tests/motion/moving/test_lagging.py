"""What is said of an axis that is led and does not do as it was told."""

from __future__ import annotations

import pytest

from motorbus.errors import NoReply, Stalled
from motorbus.motion.moving.lagging import behind, does_not_begin, not_there, silent
from motorbus.session.robot import Robot
from tests.motion.machines import machine


def test_each_error_names_axis_device_figures_and_what_to_do() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        one, two = robot["a1"], robot["a2"]
        late = behind(one, 0.5, 0.1, 0.2)
        assert isinstance(late, Stalled)
        assert "a1 does not follow: it is at 5.7 deg, and should be at 28.6 deg" in late.summary
        assert "within 11.5 deg" in late.expected
        short = not_there(
            [one, two],
            {"a1": 0.5, "a2": 0.1},
            {"a1": [0.2], "a2": []},
            0.02,
            1.5,
            {"a1": (), "a2": ("voltage",)},
        )
        assert (
            "a1 is not in position: its goal is 28.6 deg, and it stands at 11.5 deg; a2 is not"
            in short.summary
        )
        assert short.summary.endswith("it stands at a place that is not known (alarms: voltage)")
        assert "protects itself" not in short.cause
        assert short.expected == "within 1.1 deg of it, 1.5 s after the end"
        quiet = silent(two, 0.314)
        assert isinstance(quiet, NoReply)
        assert "a2 (arm#2) has not answered for 0.31 s" in quiet.summary
        assert "does not begin" in does_not_begin(two).summary
        assert [error.node for error in (late, short, quiet, does_not_begin(two))] == [1, 1, 2, 2]
        assert all(error.cause and error.advice for error in (late, short, quiet, does_not_begin(two)))


def test_a_device_that_protects_itself_is_told_apart_from_one_that_is_blocked() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        late = behind(robot["a1"], 0.5, 0.1, 0.2, ("overload",))
        assert late.summary.endswith("by now (alarms: overload)")
        assert late.cause == "its device protects itself: overload"
        sims["arm"][1].alarm = 0x20
        with pytest.raises(Stalled, match=r"a1 .*\(alarms: overload\)") as told:
            robot.move({"a1": 0.4})
        assert told.value.cause == "its device protects itself: overload"
        assert robot.faults == {}
