"""Each manual command is one frame, the manual's own, and nothing that may not be said leaves."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest

from motorbus.core.operation import Effect, Exchange, Goal, Rank
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver import commands, reading
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.table import ORDERS, PARAMETERS
from tests.families.stepper.vectors import MANUAL, name_of
from tests.families.vectors import Vector

MOVING = ("start_project", "jog_forward", "jog_reverse", "run_once", "home")
READING: dict[str, Callable[..., Exchange[Any]]] = {
    "read_project": reading.dump_once,
    "read_input": reading.read_input,
}


def made(name: str, **values: int) -> Exchange[Any]:
    node = Node()
    if name in MOVING:
        return commands.motion(node, name, (Goal(1, "relative", 1.0, -2.0, 2.0),), **values)
    function: Callable[..., Exchange[Any]] = READING.get(name) or getattr(commands, name)
    return function(node, **values)


@pytest.mark.parametrize("example", [one for one in MANUAL if one.direction == "instruction"], ids=name_of)
def test_the_27_examples_are_what_is_sent(example: Vector) -> None:
    decoded = wire.decode_request(example.data)
    assert decoded is not None
    exchange = made(decoded.command.name, **decoded.values)
    assert exchange.request == example.data
    assert exchange.effect is ORDERS[decoded.command.name].effect


def test_there_is_a_function_for_every_command() -> None:
    assert {*wire.COMMANDS} == {*MOVING, *READING, *(n for n in wire.COMMANDS if hasattr(commands, n))}


@pytest.mark.parametrize("name", [name for name in wire.COMMANDS if hasattr(commands, name)])
def test_its_arguments_are_the_numbers_of_the_request(name: str) -> None:
    arguments = [one for one in inspect.signature(getattr(commands, name)).parameters if one != "node"]
    assert sorted(arguments) == sorted(place.name for place in wire.COMMANDS[name].places)


@pytest.mark.parametrize("name", wire.COMMANDS)
def test_a_number_outside_its_range_is_refused_by_its_name(name: str) -> None:
    places = wire.COMMANDS[name].places
    good = {place.name: PARAMETERS[place.name].low for place in places}
    if name == "read_input":
        good["port"] = 1
    for place in places:
        with pytest.raises(RequestError, match=f"{place.name}|no input") as refused:
            made(name, **{**good, place.name: 1 << 8 * place.size})
        assert "nothing was sent" in refused.value.advice
        assert refused.value.expected


def test_what_stops_goes_before_what_moves_and_that_before_what_sets() -> None:
    ranks = [
        made("stop_motor").rank,
        made("home").rank,
        made("set_output", port=1, level=1).rank,
        made("set_mode4", mode4=0).rank,
    ]
    assert ranks == [Rank.STOP, Rank.CONTROL, Rank.CONTROL, Rank.CONFIGURATION]


def test_what_moves_says_where_to() -> None:
    order = made("jog_forward")
    assert order.effect is Effect.MOTION
    assert order.goals
    assert not order.repeatable
