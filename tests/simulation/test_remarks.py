"""Remarks of simulated devices become lines, each once, and a flood of them becomes a number."""

from __future__ import annotations

from motorbus.families.feetech import simulator as feetech
from motorbus.families.stepper.simulator import StepperBus, simulate
from motorbus.simulation.remarks import MOST, Remarks


def used(at: float = 100.0) -> StepperBus:
    bus = simulate((1,))
    bus.advance(at)
    return bus


def test_each_is_one_line_with_its_moment_and_is_shown_once() -> None:
    bus = used()
    remarks = Remarks(bus)
    assert remarks.lines(0.0) == []
    bus.advance(112.25)
    bus.controller.remark("step 11 is out of range")
    assert remarks.lines(0.1) == ["   12.250 s  #1: step 11 is out of range"]
    assert remarks.lines(0.2) == []


def test_of_a_flood_the_first_are_shown_and_the_others_counted() -> None:
    bus = used()
    remarks = Remarks(bus)
    for number in range(1200):  # more than the controller keeps
        bus.controller.remark(f"again {number}")
    assert len(remarks.lines(5.0)) == MOST
    bus.controller.remark("once more")
    assert remarks.lines(5.5) == []
    bus.controller.remark("late")
    assert remarks.lines(6.0) == [f"… and {1201 - MOST} more", "    0.000 s  #1: late"]
    assert remarks.lines(8.0) == []


def test_what_is_repeated_does_not_hide_what_is_new() -> None:
    bus = used()
    remarks = Remarks(bus)
    for _ in range(100):
        bus.controller.remark("again")
    bus.controller.remark("new")
    assert [line.partition(": ")[2] for line in remarks.lines(5.0)] == ["again", "new"]


def test_what_was_not_shown_may_be_asked_for_at_the_end() -> None:
    bus = used()
    remarks = Remarks(bus)
    for _ in range(2):
        bus.controller.remark("again")
    assert len(remarks.lines(1.0)) == 1
    assert remarks.rest() == ["… and 1 more"]
    assert remarks.rest() == []


def test_devices_without_a_log_say_nothing() -> None:
    assert Remarks(feetech.simulate((1, 2))).lines(1.0) == []
