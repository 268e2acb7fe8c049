"""A jog ends by itself, keeps to the limits of its axis, and ends at them where somebody wants that."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, RequestError
from motorbus.motion.clamping import Clamped
from motorbus.motion.moving.jogging import way_of_jog
from motorbus.session.robot import Robot
from tests.support.machines import listened, machine, said

HIGH = radians(50)


@contextmanager
def told_of(**made: Any) -> Iterator[tuple[Robot, list[object], Any]]:
    told: list[object] = []
    with machine(**made) as (found, sims), Robot.of(found, report=told.append) as robot:
        yield robot, told, sims


def clamps(told: list[object]) -> list[Clamped]:
    return [event for event in told if isinstance(event, Clamped)]


@pytest.mark.parametrize("name", ["a1", "c1"])
def test_a_jog_that_leads_out_of_the_limits_ends_at_them(name: str) -> None:
    axes = {"a1": {"low": "-50 deg", "high": "50 deg"}}
    with told_of(arm="1", can="0x21", axes=axes) as (robot, told, _):
        with pytest.raises(LimitExceeded):
            robot[name].jog(1.0, 3.0)
        gone = robot[name].jog(1.0, 3.0, policy="clamp")
        assert gone == pytest.approx(HIGH, abs=0.02)
        assert robot[name].position() == pytest.approx(HIGH, abs=0.02)
        (event,) = clamps(told)
        assert (event.axis, event.reason) == (name, "limits")
        assert event.given == pytest.approx(HIGH)
        assert event.asked > 2.0


def test_one_inside_its_limits_is_a_jog_as_any_other() -> None:
    with told_of(arm="1") as (robot, told, _):
        way, _limits = way_of_jog(robot["a1"], 0.5, 1.0)
        assert robot["a1"].jog(0.5, 1.0, policy="clamp") == pytest.approx(way, abs=0.01)
        assert clamps(told) == []


@pytest.mark.parametrize(("stands", "gone"), [(151, 0.0), (150, 0.0)])
def test_who_stands_at_the_end_or_beyond_stays_and_gets_no_torque(stands: float, gone: float) -> None:
    with told_of(arm="1") as (robot, told, sims):
        sims["arm"][1].raw_position = round((180 + stands) / 360 * 4096) + 1
        listened(sims)
        assert robot["a1"].jog(1.0, 1.0, policy="clamp") == gone
        assert len(clamps(told)) == 1
        assert all(line.startswith("READ") or "status" in line for line in said(sims))
        assert sims["arm"][1].memory["torque_enable"] == 0


def test_what_is_no_jog_is_refused_with_any_policy() -> None:
    with told_of(arm="1", lift=True) as (robot, _, _sims):
        for velocity, seconds in ((0.0, 1.0), (0.5, 0.0), (0.5, -1.0), (0.5, float("nan"))):
            with pytest.raises(RequestError, match="is no jog"):
                robot["a1"].jog(velocity, seconds, policy="clamp")
        with pytest.raises(LimitExceeded, match="its limit"):
            robot["a1"].jog(9.0, 1.0, policy="clamp")
        with pytest.raises(RequestError, match="'bend' is no policy"):
            robot["a1"].jog(0.5, 1.0, policy="bend")  # type: ignore[arg-type]
        with pytest.raises(RequestError, match="lift: its jog cannot be clamped"):
            robot["lift"].jog(0.01, 0.1, policy="clamp")
