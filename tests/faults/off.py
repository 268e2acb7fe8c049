"""Switches every fault off, so that it can be seen that no test of a fault passes without its fault.

What a line does to what it carries, a plug that is pulled, a supply that is cut and an interruption at a line: none of
it happens any more under `--faults-off`. Whatever else goes wrong in a test asks `are_off` before it does. Tests are
not changed; they have to fail by what they assert.
"""

from __future__ import annotations

import sys
from typing import Any

import pytest

from motorbus.core.operation import Data
from motorbus.families.feetech.simulator.servo import Servo as FeetechServo
from motorbus.families.kst.simulator.servo import Servo as KstServo
from motorbus.families.stepper.simulator.controller import Controller
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from motorbus.link.pty import PtyMaster
from motorbus.simulation.course import Course
from motorbus.simulation.faults import FaultyLine
from motorbus.simulation.mount import Mount

WIRE = PerfectLine()
faults_are_off = False
"""What a source of faults that is none of these asks before it does harm."""


def are_off() -> bool:
    """The same, for whoever imports a name."""
    return faults_are_off


def shared(node: int) -> tuple[int, ...]:
    """The ids of two devices that have one; of one alone while faults are off."""
    return (node,) if faults_are_off else (node, node)


class Carried:
    """A line of a test that is there, is told nothing, and does nothing; one that asks by itself is put in."""

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        return vars(owner).get("line", WIRE) if owner is not None else self

    def __set__(self, owner: Any, line: object) -> None:
        if getattr(line, "asks_by_itself", False):
            vars(owner)["line"] = line


def switch_off(patch: pytest.MonkeyPatch) -> None:
    """From here on nothing goes wrong any more."""
    patch.setattr(sys.modules[__name__], "faults_are_off", True)
    for place in (MemoryLink, Course):
        patch.setattr(place, "line", Carried(), raising=False)
    patch.setattr(FaultyLine, "carry", _carried)
    for plug in (MemoryLink, Mount, PtyMaster):
        patch.setattr(plug, "unplug", _nothing)
    for node in (FeetechServo, KstServo, Controller):
        for fault in ("unplug", "power_cycle", "restart", "brown_out"):
            patch.setattr(node, fault, _nothing, raising=False)
    patch.setattr(sys, "settrace", _nothing)


def _carried(line: FaultyLine, sender: Side, data: Data, at: float) -> list[Delivery]:
    """It counts what passes, and that is all."""
    line.exchange += sender is Side.HOST
    return WIRE.carry(sender, data, at)


def _nothing(*given: Any, **options: Any) -> None:
    """What would have gone wrong."""
