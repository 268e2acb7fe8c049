"""An open machine: its axes by the names of axes, groups and buses, and one clock for its buses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus import RequestError, Robot
from motorbus.core.operation import Pause
from motorbus.motion.abreast import Abreast
from motorbus.motion.body import Body
from tests.motion.machines import listened, machine, said


def test_names_stand_for_axes_each_once_in_their_order() -> None:
    with machine(arm="1-3", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        assert list(robot.chosen()) == ["a1", "a2", "a3", "c1", "lift"]
        assert list(robot.chosen("upper")) == ["a1", "a2", "a3"]
        assert list(robot.chosen(["lift", "a2", "arm"])) == ["lift", "a2", "a1", "a3"]
        assert list(robot.chosen(name for name in ("c1", "c1"))) == ["c1"]


def test_what_is_not_there_or_not_open_is_refused() -> None:
    with machine(arm="1-3", can="0x25") as (made, _), Robot.of(made, "a1") as robot:
        with pytest.raises(RequestError, match="no axis, group or bus 'elbow'"):
            robot.chosen("elbow")
        with pytest.raises(RequestError, match="the axis 'a2' is not open") as caught:
            robot.chosen("upper")
        assert "nothing was sent" in str(caught.value)


def test_one_axis_by_its_name_and_no_group() -> None:
    with machine(arm="1-3") as (made, _), Robot.of(made) as robot:
        assert robot.axis("a2").name == "a2"
        with pytest.raises(RequestError, match="'upper' is not an axis: it stands for a1, a2, a3"):
            robot.axis("upper")


def test_axes_by_their_bus() -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        found = robot.by_bus(robot.chosen(["lift", "a2"]))
        assert {bus: [axis.name for axis in there] for bus, there in found.items()} == {
            "arm": ["a2"],
            "stage": ["lift"],
        }


def test_the_clock_of_the_robot_is_at_0_when_it_is_made() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        robot.conductor.run(Abreast({"arm": Pause(1.5).__iter__()}, dict))
        later = Body(robot.machine, robot.buses, robot.axes)
        assert later.origins["arm"] >= 1.5
        assert later.origins["arm"] == robot.buses["arm"].link.now()
        assert robot.origins["arm"] < 1.0


def test_what_is_no_name_is_one_clear_error_and_sends_nothing() -> None:
    with machine(arm="1-2", can="0x25") as (made, sims), Robot.of(made) as robot:
        listened(sims)
        number: Any = 3
        uses: list[tuple[Callable[[], object], str]] = [
            (lambda: robot.positions(number), "3 is not a name"),
            (lambda: robot.positions(["a1", number]), "3 is not a name"),
            (lambda: robot[number], "3 is not a name"),
            (lambda: robot.stop([]), "no axis is named"),
            (lambda: robot.move({}), "no axis is named"),
            (lambda: robot.move({number: 0.1}), "3 is not a name"),
            (lambda: robot.move("a1"), "'a1' is not a mapping of goals"),  # type: ignore[arg-type]
            (lambda: Robot.of(made, number), "3 is not a name"),
            (lambda: Robot.of(made, []), "no axis is named"),
            (lambda: Robot.of("m.toml"), "is not a machine"),  # type: ignore[arg-type]
        ]
        for use, told in uses:
            with pytest.raises(RequestError, match=told):
                use()
        assert said(sims) == []


def test_its_clock_is_that_of_its_buses_which_is_ahead() -> None:
    with machine(arm="1", can="0x25") as (made, _), Robot.of(made) as robot:
        before = robot.now
        robot.buses["arm"].run(iter(Pause(1.5)))  # type: ignore[attr-defined]
        assert robot.now - before == pytest.approx(1.5, abs=0.3)
        at = robot.now
        robot.buses["can"].run(iter(Pause(0.1)))  # type: ignore[attr-defined]
        assert robot.now == at
