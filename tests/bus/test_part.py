"""How time passes on several buses, looked at one step at a time."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from time import sleep
from typing import Any

import pytest

from motorbus.bus.crank import IDLE, push
from motorbus.bus.part import Part, advance, clock_of, follow, results, step
from motorbus.bus.ticket import Flight
from motorbus.core.operation import Listen, Operation, Pause
from motorbus.errors import LinkLost, NoReply
from tests.bus.responder import DELAY, position
from tests.bus.several import Several, single


def parts_of(several: Several, operations: Mapping[str, Operation[Any]]) -> dict[str, Part[Any]]:
    return {
        name: Part(several.buses[name], wanted, several.origins[name], lambda: None)
        for name, wanted in operations.items()
    }


def test_all_clocks_go_to_the_next_event_of_any_and_no_further() -> None:
    parts = parts_of(Several(True, True), {"a": iter(Pause(0.1)), "b": iter(Pause(0.03))})
    assert advance(parts.values())
    assert step([*parts.values()])
    assert [part.time for part in parts.values()] == pytest.approx([0.03, 0.03])
    assert advance(parts.values())
    while parts["b"].going:
        step([*parts.values()])
        advance(parts.values())
    assert [part.time for part in parts.values()] == pytest.approx([0.03, 0.03])
    step([*parts.values()])
    assert [part.time for part in parts.values()] == pytest.approx([0.1, 0.1]), "also who has ended"


def test_an_answer_is_an_event_too() -> None:
    parts = parts_of(Several(True, True), {"a": iter(Pause(0.1)), "b": single(1)})
    while advance(parts.values()) and parts["b"].going:
        step([*parts.values()])
    assert [part.time for part in parts.values()] == pytest.approx([DELAY, DELAY])
    assert parts["b"].run.result() == 1


def test_where_nothing_is_awaited_from_anybody_time_passes_all_the_same() -> None:
    parts = parts_of(Several(True, True), {name: iter(Listen(lambda notice: False, 9.0)) for name in "ab"})
    advance(parts.values())
    step([*parts.values()])
    assert [part.time for part in parts.values()] == pytest.approx([IDLE, IDLE])


def test_time_stands_still_where_somebody_can_go_on_at_once() -> None:
    several = Several(True, True)
    parts = parts_of(several, {"a": single(1), "b": iter(Pause(1.0))})
    advance(parts.values())
    assert parts["a"].push() is False
    several.buses["a"].link.close()
    assert parts["a"].reach(1.0) is False, "it is lost"
    assert step([*parts.values()])
    advance(parts.values())
    assert parts["b"].going
    with pytest.raises(LinkLost):
        parts["a"].run.result()


def test_a_real_clock_sets_the_pace() -> None:
    several = Several(True, False)
    parts = parts_of(several, {"a": iter(Pause(0.01)), "b": iter(Pause(0.01))})
    assert clock_of([parts["a"]]) is None
    clock = clock_of([*parts.values()])
    assert clock is parts["b"]
    advance(parts.values())
    left = follow(parts["a"], clock)
    assert 0.0 <= left <= 0.01
    assert parts["a"].time <= clock.time
    while advance([parts["a"]]):
        assert follow(parts["a"], clock) <= 0.01
        assert parts["a"].time <= clock.time
    assert follow(parts["a"], clock) == float("inf"), "nothing to wait for any more"
    several.close()


def test_what_waits_leaves_as_soon_as_an_answer_that_nobody_wants_is_overdue_beside_a_real_clock() -> None:
    several = Several(True, False)
    bus, several.responders["a"].dead = several.buses["a"], {1}
    unwanted = Flight(position(1))
    bus.turns.submit(unwanted, bus.link.now())
    push(bus.link, bus.turns)
    bus.turns.abandon(unwanted)
    parts = parts_of(several, {"a": single(2), "b": iter(Pause(100.0))})
    clock = clock_of([*parts.values()])
    assert clock is parts["b"]
    while advance([parts["a"]]):
        left = follow(parts["a"], clock)
        assert left < 0.1, "it sleeps, and what waits could go"
        sleep(left)
    assert parts["a"].run.result() == 2
    several.close()


def test_results_are_values_and_errors_unless_something_else_was_raised() -> None:
    several = Several(True, True)
    several.responders["a"].dead = {1}
    parts = parts_of(several, {"a": single(1), "b": single(2)})
    while advance(parts.values()):
        step([*parts.values()])
    told = results(parts)
    assert isinstance(told["a"], NoReply)
    assert told["b"] == 2


@pytest.mark.parametrize("later", [LookupError, asyncio.CancelledError, KeyboardInterrupt])
def test_what_is_no_error_of_ours_is_raised_once_by_advancing_and_in_the_end(
    later: type[BaseException],
) -> None:
    """The first of them, but rather one that ends the program."""

    def stumble() -> Operation[None]:
        yield from Pause(0)
        raise LookupError("no such thing")

    parts = parts_of(Several(True, True), {"a": stumble(), "b": iter(Pause(1.0))})
    assert advance(parts.values())
    step([*parts.values()])
    with pytest.raises(LookupError):
        advance(parts.values())
    assert parts["b"].going
    assert advance(parts.values())
    parts["b"].run.interrupt(later())
    assert not advance(parts.values())
    with pytest.raises(KeyboardInterrupt if later is KeyboardInterrupt else LookupError):
        results(parts)
