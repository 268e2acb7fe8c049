"""Several buses at once, cut short: at any line, twice, by an error of one of them; everybody cleans up."""

from __future__ import annotations

import gc
import sys
import threading
from typing import Any

import pytest

from motorbus.core.operation import Effect, Operation, Pause, Report
from motorbus.errors import MotorbusError, NoReply
from tests.bus.responder import LOCK, guarded, position, write
from tests.bus.several import Several, single
from tests.bus.test_pump import Interrupt, InterruptTwice


def run_interrupted(several: Several, operations: dict[str, Any], tracer: Interrupt) -> bool:
    """True when the interrupt fell inside the run."""
    before = sys.gettrace()
    gc.disable()  # giving back what an earlier run has left behind is no line of this one
    sys.settrace(tracer)
    try:
        several.concert.run(operations)
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(before)
        gc.enable()
    return tracer.count >= tracer.at


def check_usable(several: Several, at: int) -> None:
    """What follows is right on every bus, together and from another thread; every lock is closed."""
    locks = {name: responder.memory[1][LOCK] for name, responder in several.responders.items()}
    assert set(locks.values()) == {1}, f"interrupted at line {at}: open at {locks}"
    asked = {name: single(2) for name in several.buses}
    assert set(several.concert.run(asked).values()) == {2}, f"interrupted at line {at}"
    others: list[int] = []

    def ask() -> None:
        others.extend(bus.run(position(3)) for bus in several.buses.values())

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join(20)
    assert others == [3] * len(asked), f"interrupted at line {at}: a lock is still held"
    several.close()


@pytest.mark.parametrize(
    ("virtual", "make", "stride"),
    [
        ((True, True), position, 1),
        ((True, True), lambda node: guarded(node, 9), 3),
        ((False, False), lambda node: guarded(node, 9), 7),
        ((True, False), lambda node: guarded(node, 9), 11),
    ],
)
def test_an_interrupt_at_any_line_leaves_every_bus_usable(
    virtual: tuple[bool, ...], make: Any, stride: int
) -> None:
    at, inside = 1, True
    while inside:
        several = Several(*virtual)
        inside = run_interrupted(several, {name: make(1) for name in several.buses}, Interrupt(at))
        check_usable(several, at)
        at += stride
    assert at > 300, "the whole path was walked"


@pytest.mark.parametrize("later", [1, 2, 3, 5, 8, 13, 34, 89, 233])
def test_a_second_interrupt_skips_no_clean_up(later: int) -> None:
    for at in range(1, 1000, 31):
        several = Several(True, True)
        run_interrupted(several, {name: guarded(1, 9) for name in several.buses}, InterruptTwice(at, later))
        check_usable(several, at)


def stumble() -> Operation[None]:
    """Waits until the others are under way, and fails for a reason that is not ours."""
    yield from Pause(0.05)
    raise LookupError("a mistake of the caller's")


def held(done: list[str]) -> Operation[None]:
    """Opens the lock and waits for ever; closes it when it is cut off."""
    try:
        yield from write(1, LOCK, 0, Effect.PERSISTENT)
        yield from Pause(1000.0)
    except BaseException as error:
        done.append(type(error).__name__)
        raise
    finally:
        yield from write(1, LOCK, 1, Effect.PERSISTENT)


@pytest.mark.parametrize("virtual", [(True, True, True), (False, False, False), (True, False, True)])
def test_an_error_that_is_not_ours_interrupts_the_others_and_is_raised_when_they_have_cleaned_up(
    virtual: tuple[bool, ...],
) -> None:
    several = Several(*virtual)
    done: list[str] = []
    with pytest.raises(LookupError, match="a mistake of the caller's") as caught:
        several.concert.run({"a": held(done), "b": stumble(), "c": held(done)})
    assert done == ["LookupError", "LookupError"]
    assert not hasattr(caught.value, "__notes__")
    check_usable(several, 0)


def test_what_the_cleaning_up_failed_with_goes_along_as_a_note() -> None:
    several = Several(True, True)

    def unlucky() -> Operation[None]:
        try:
            yield from Pause(1000.0)
        finally:
            several.responders["a"].dead = {1}
            yield from write(1, LOCK, 1, Effect.PERSISTENT)

    with pytest.raises(LookupError) as caught:
        several.concert.run({"a": unlucky(), "b": stumble()})
    assert any("node 1" in note or "1" in note for note in caught.value.__notes__)


def test_an_error_of_ours_in_one_lets_the_others_end() -> None:
    several = Several(True, True)
    several.responders["a"].dead = {1}
    told = several.concert.run({"a": guarded(1, 9), "b": iter(Pause(100.0))})
    assert isinstance(told["a"], NoReply)
    assert told["b"] == pytest.approx(several.buses["b"].link.now(), abs=0.01)


def test_a_listener_that_fails_cuts_nobody_off_but_its_own() -> None:
    """What it raises belongs to the operation that reported; if that does not mind it, nobody does."""
    several = Several(True, True)

    def refuse(event: object) -> None:
        raise MotorbusError("the disk is full")

    several.buses["a"].report = refuse

    def tell() -> Operation[int]:
        yield from Report("now")
        return 1

    told = several.concert.run({"a": tell(), "b": single(2)})
    assert isinstance(told["a"], MotorbusError)
    assert told["b"] == 2


def test_clean_ups_have_a_deadline_on_every_bus() -> None:
    several = Several(True, True)

    def stubborn() -> Operation[None]:
        try:
            yield from Pause(1000.0)
        finally:
            yield from Pause(500.0)

    with pytest.raises(LookupError):
        several.concert.run({"a": stubborn(), "b": stumble()})
    assert several.buses["a"].link.now() - several.origins["a"] == pytest.approx(2.05, abs=0.01)
