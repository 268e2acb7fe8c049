"""Work on several buses as a value: methods made of it, and what becomes of several errors."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from motorbus.errors import Interrupted, MotorbusError, NoReply
from motorbus.motion.abreast import Abreast, Led, LedAsync, settled, together
from motorbus.motion.conductor import Conductor, LoopConductor
from tests.bus.responder import position
from tests.bus.several import Several, SeveralAsync


def asked(machine: Any, node: int, *, more: int = 0) -> Abreast[dict[str, int]]:
    """The id of one node on every bus."""
    return Abreast({name: position(node + more) for name in machine.names}, settled)


class Verbs:
    """Asks two buses."""

    names = ("a", "b")
    ask = together(asked)


class Blocking(Verbs, Led):
    def __init__(self) -> None:
        several = Several(True, True)
        self.conductor = Conductor(several.buses, several.origins)


class Awaiting(Verbs, LedAsync):
    def __init__(self) -> None:
        several = SeveralAsync(True, True)
        self.conductor = LoopConductor(several.buses, several.origins)


def test_one_function_is_a_blocking_and_an_async_method() -> None:
    assert Blocking().ask(3, more=1) == {"a": 4, "b": 4}

    async def main() -> dict[str, int]:
        return await Awaiting().ask(3, more=1)

    assert asyncio.run(main()) == {"a": 4, "b": 4}


def test_a_method_says_what_its_function_says() -> None:
    assert Verbs.ask.__doc__ == asked.__doc__
    assert Blocking().ask.__doc__ == asked.__doc__
    assert isinstance(Verbs.ask, together)


def test_without_errors_there_is_what_was_returned() -> None:
    assert settled({"a": 1, "b": None}) == {"a": 1, "b": None}
    assert settled({}) == {}


def test_the_first_error_is_raised_and_tells_of_the_others_once() -> None:
    errors = {name: MotorbusError(text) for name, text in (("a", "one"), ("c", "two"), ("d", "two"))}
    with pytest.raises(MotorbusError, match="one") as caught:
        settled({**errors, "b": 3})
    assert caught.value is errors["a"]
    assert caught.value.__notes__ == ["also: two"]


def test_a_cause_is_raised_before_what_came_of_it() -> None:
    silent = NoReply("node 1 said nothing")
    waited = Interrupted("a does not move", cause="node 1 said nothing")
    waited.__cause__ = silent
    with pytest.raises(NoReply) as caught:
        settled({"a": waited, "b": silent})
    assert caught.value.__notes__ == ["also: a does not move"]


def test_one_whose_cause_is_on_no_other_bus_is_raised_as_any() -> None:
    alone = Interrupted("it does not move")
    alone.__cause__ = OSError("the disk is full")
    with pytest.raises(Interrupted):
        settled({"a": alone})
