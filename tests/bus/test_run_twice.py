"""Ctrl-C once more, at any line of what deals with the first: all that cleans up does so, and nobody waits for ever."""

from __future__ import annotations

import sys
from types import FrameType
from typing import Any

import pytest

from motorbus.bus import run
from motorbus.bus.pump import Bus
from motorbus.core.operation import Alone, Operation, Pause, Report, Together, afterwards
from tests.bus.responder import memory_bus, position, write
from tests.bus.test_run import interrupted

CLEANED = (3, 4, 5, 6, 7)
TURNS = 2000
"""Of the pump, far more than any of it takes."""


class Again:
    """Raises KeyboardInterrupt at the nth line of run.py behind the first interruption; counts them all otherwise."""

    def __init__(self, at: int) -> None:
        self.at = at
        self.count = 0
        self.begun = False
        self.where = ""

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        return self.line if frame.f_code.co_filename == run.__file__ else None

    def line(self, frame: FrameType, event: str, argument: object) -> Any:
        doing = frame.f_code.co_name
        if doing in (
            "interrupt",
            "result",
        ):  # behind the latter all is over, and the second is raised by itself
            self.begun = doing == "interrupt"
        if event == "line" and self.begun and doing != "_alive":  # that asks about somebody else's error
            self.count += 1
            if self.count == self.at:
                self.where = f"line {frame.f_lineno} in {doing}"
                raise KeyboardInterrupt("again")
        return self.line


def waits() -> Operation[None]:
    yield from Pause(1e9)


def naps(seconds: float) -> Operation[None]:
    yield from Pause(seconds)


def late() -> Operation[None]:
    yield from Pause(0.6)
    yield from Alone(afterwards(waits(), lambda: write(3, 20, 1)))


def several() -> Operation[None]:
    yield from Together([naps(0.05), iter(write(4, 20, 1)), iter(Alone(write(5, 20, 1)))])


def last() -> Operation[None]:
    yield from Together(list[Operation[None]]())
    yield from Alone(write(7, 20, 1))
    yield from Report("nearly there")
    yield from Together([iter(write(6, 20, 1)), naps(0.01)])


def all_at_once() -> Operation[None]:
    yield from Together([iter(position(1)), late(), afterwards(waits(), several)])


def cut_twice(at: int) -> tuple[Again, list[str]]:
    """Where the second fell, and what is wrong afterwards."""
    bus, responder = memory_bus()
    responder.dead = {1}
    again, before = Again(at), sys.gettrace()
    sys.settrace(again)
    try:
        with pytest.raises(KeyboardInterrupt) as caught:
            interrupted(bounded(bus), afterwards(all_at_once(), last), 14)
    finally:
        sys.settrace(before)
    first = not caught.value.args or "in interrupt" in again.where  # there the first one is not yet known
    wrong = [] if first else ["the second one is raised"]
    notes = list(getattr(caught.value, "__notes__", ()))
    if not any("node 1" in note for note in notes):
        wrong.append("what went wrong before is not told")
    left = set(CLEANED) - {packet.id for packet in responder.heard}
    wrong += [f"{node} was not cleaned up" for node in left]
    if not bus.turns.idle or bus.turns._timers or any(bus.turns._queues) or bus.run(position(9)) != 9:
        wrong.append("the bus is not free")
    return again, [f"{one}: {again.where}" for one in wrong]


def bounded(bus: Bus) -> Bus:
    """Whoever waits for ever fails, and does not hang."""
    turn, left = bus.relay.turn, iter(range(TURNS))

    def turned() -> None:
        assert next(left, None) is not None, "it waits for ever"
        turn()

    bus.relay.turn = turned  # type: ignore[method-assign]
    return bus


def test_a_second_interrupt_at_any_line_loses_nothing_of_what_cleans_up() -> None:
    whole, wrong = cut_twice(0)
    assert wrong == []
    assert whole.count > 900
    for at in range(1, whole.count + 1):
        again, found = cut_twice(at)
        wrong += found
        assert again.where
    assert wrong == []
