"""An order that a control loop repeats is judged each time, alone or in one burst with a read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import pi
from typing import Any

import pytest

from motorbus import Robot
from motorbus.errors import LimitExceeded, Refused
from motorbus.families.feetech import ServoGroup
from tests.support.machines import listen, machine, sent

AXES = {name: {"low": "-60 deg", "high": "60 deg", "max_step": "15 deg"} for name in ("a1", "a2")}
SYNC_WRITE = 0x83
WAYS: dict[str, Callable[[Any, Any, Any], object]] = {
    "alone": lambda bus, order, nodes: bus.run(order),
    "with a read": lambda bus, order, nodes: bus.exchange((order, ServoGroup(nodes).positions)),
}


def instructions(sims: Any) -> list[int]:
    """The instruction bytes of all frames sent so far."""
    return [data[4] for data in sent(sims) if isinstance(data, bytes)]


def goals(sims: Any) -> int:
    return instructions(sims).count(SYNC_WRITE)


@contextmanager
def ordered() -> Iterator[tuple[Any, Any, Any, Any]]:
    """Two servos whose loop has sent one order: bus, nodes, writer of orders, simulations."""
    with machine(arm="1-2", axes=AXES) as (config, sims), Robot(config) as robot:
        listen(sims)
        nodes = [robot["a1"].device, robot["a2"].device]
        writer = ServoGroup(nodes).write("goal_position")
        robot.positions()
        robot.buses["arm"].run(writer([pi, pi]))
        robot.positions()
        yield robot.buses["arm"], nodes, writer, sims


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("angle", [0.4, 1.5], ids=["beyond its step", "beyond its limit"])
def test_a_goal_that_the_gate_refuses_is_not_sent(way: Any, angle: float) -> None:
    with ordered() as (bus, nodes, writer, sims):
        before = goals(sims)
        with pytest.raises(LimitExceeded):
            way(bus, writer([pi, pi + angle]), nodes)
        assert goals(sims) == before
        way(bus, writer([pi, pi + 0.05]), nodes)
        assert goals(sims) == before + 1


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_a_goal_is_refused_while_the_position_is_old(way: Any) -> None:
    with ordered() as (bus, nodes, writer, sims):
        bus.link.advance(9.0)
        before = goals(sims)
        with pytest.raises(Refused, match=r"9\.\d s old"):
            way(bus, writer([pi, pi + 0.05]), nodes)
        assert goals(sims) == before
        bus.run(ServoGroup(nodes).positions)
        way(bus, writer([pi, pi + 0.05]), nodes)
        assert goals(sims) == before + 1


def test_a_limit_of_the_device_inside_that_of_the_axis_counts() -> None:
    axes = {"a1": {"low": "-60 deg", "high": "60 deg", "max_step": "60 deg"}}
    with machine(arm="1", axes=axes) as (config, sims):
        sims["arm"][1].memory["max_position_limit"] = 2248  # 0.307 rad above the middle
        with Robot(config) as robot:
            bus: Any = robot.buses["arm"]
            device = robot["a1"].device
            robot.positions()
            bus.run(ServoGroup([device]).write("goal_position")([pi + 0.02]))
            robot.positions()
            with pytest.raises(LimitExceeded):
                bus.run(ServoGroup([device]).write("goal_position")([pi + 0.4]))
