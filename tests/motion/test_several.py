"""Everyone is visited whatever happens to some, and one error names all whom it befell."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus import DeviceError, MotorbusError, NoReply, PortBusy, Robot
from motorbus.core.operation import Operation, Pause
from motorbus.motion.abreast import Abreast
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.several import errors_of, everyone, gathered, insisted, named, of_each, raised
from tests.motion.machines import Cut, machine


def test_a_name_goes_before_the_summary_and_the_error_stays_as_it_was() -> None:
    error = DeviceError("it said no", code=3, register="goal", node=2, advice="ask again")
    found = named("a2", error)
    assert isinstance(found, DeviceError)
    assert str(found).startswith("a2: it said no")
    assert (found.code, found.register, found.node, found.advice) == (3, "goal", 2, "ask again")
    assert str(error).startswith("it said no")
    assert found.args == ("a2: it said no",)
    assert found.__cause__ is error


def test_a_name_is_said_once() -> None:
    error = NoReply("a2: silent")
    assert named("a2", error) is error


def test_an_error_of_a_port_can_be_named_too() -> None:
    error = PortBusy("/dev/ttyACM0 is busy")
    error.owner = 42
    error.add_note("seen at noon")
    found = named("bus.arm", error)
    assert isinstance(found, PortBusy)
    assert isinstance(found, OSError)
    assert (found.owner, found.__notes__) == (42, ["seen at noon"])
    found.add_note("another")
    assert error.__notes__ == ["seen at noon"]


def test_one_error_names_all_and_those_alike_are_said_once() -> None:
    gone = NoReply("the port is gone")
    found = gathered({"a1": gone, "a2": gone, "c1": DeviceError("it said no")})
    assert isinstance(found, NoReply)
    assert str(found).startswith("a1, a2: the port is gone")
    assert found.__notes__ == ["also: c1: it said no"]


def test_what_came_of_each_or_the_error() -> None:
    assert raised({"a1": 1, "a2": 2}) == {"a1": 1, "a2": 2}
    told: dict[str, Any] = {"a1": 1, "a2": NoReply("silent")}
    assert list(errors_of(told)) == ["a2"]
    with pytest.raises(NoReply, match="a2: silent"):
        raised(told)


def test_an_error_of_a_bus_is_one_of_each_axis_on_it() -> None:
    with machine(arm="1-2", can="0x25") as (made, _), Robot.of(made) as robot:
        lost = NoReply("the bus is gone")
        told = of_each(robot.by_bus(robot.axes), {"arm": lost, "can": {"c1": 3}})
        assert told == {"a1": lost, "a2": lost, "c1": 3}


def _visited(seen: list[str]) -> Any:
    def act(axis: AxisVerbs) -> Operation[str]:
        yield from Pause(0.01 * int(axis.name[1:]))
        yield from axis.able["position"](axis.device)
        seen.append(axis.name)
        if axis.name == "a2":
            raise NoReply("silent")
        return axis.name.upper()

    return act


@pytest.mark.parametrize("how", [everyone, insisted])
def test_everyone_is_visited_though_one_fails(how: Any) -> None:
    seen: list[str] = []
    with machine(arm="1-4") as (made, _), Robot.of(made) as robot:
        axes = list(robot.axes.values())
        told = robot.conductor.run(
            Abreast({"arm": how(axes, _visited(seen))}, lambda results: results["arm"])
        )
    assert sorted(seen) == ["a1", "a2", "a3", "a4"]
    assert isinstance(told.pop("a2"), MotorbusError)
    assert told == {"a1": "A1", "a3": "A3", "a4": "A4"}


def test_an_interruption_keeps_nobody_from_being_visited_who_is_insisted_on() -> None:
    seen: list[str] = []
    with machine(arm="1-4") as (made, sims), Robot.of(made) as robot:
        axes = list(robot.axes.values())
        sims["arm"].line = Cut(2)
        with pytest.raises(KeyboardInterrupt):
            robot.conductor.run(Abreast({"arm": insisted(axes, _visited(seen))}, dict))
    assert set(seen) == {"a1", "a2", "a3", "a4"}


def test_an_interruption_ends_what_is_not_insisted_on() -> None:
    seen: list[str] = []
    with machine(arm="1-4") as (made, sims), Robot.of(made) as robot:
        axes = list(robot.axes.values())
        sims["arm"].line = Cut(2)
        with pytest.raises(KeyboardInterrupt):
            robot.conductor.run(Abreast({"arm": everyone(axes, _visited(seen))}, dict))
    assert set(seen) < {"a1", "a2", "a3", "a4"}
