"""What a command that moves the motor orders, for the gate, which lets nothing through that does not say where to.

The controller tells no position and knows no limits of travel. So its goals have none either: what is finite and ends
passes, and how far that may be is for whoever knows the machine. Angles are of the motor, forward positive.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import inf, nan, tau
from typing import Final

from motorbus.core.setpoint import Setpoint
from motorbus.families.stepper import execution
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.table import Project

COUNTLESS: Final = 1_000_000
"""Passes for which an endless project is judged: what drifts in each leaves any travel in so many."""
_COUNTS: Final = ("total", "extra")
"""What a count of a loop may mean, in all or besides the first: nobody has settled it, so the farthest is judged."""


def of_project(node: Node, project: Project, how: Behaviour = USUAL) -> tuple[Setpoint, ...]:
    """Starting it: the farthest that it gets in each direction from where it begins, in rad, its greatest speed in
    rad/s, and that as a velocity where it never ends.

    All of its passes count, in the reading of its loops that leads farthest. An input that ends a step before its end
    is not reckoned with.
    """
    places = {place.step for place in execution.one_pass(project, how)}
    fastest = max((project.step(number).speed for number in places), default=0)
    ways = [_goal(node, "relative", _angle(project, units)) for units in _ends(project, how)]
    if _goes_on(project, how):
        ways.append(_goal(node, "velocity", fastest * tau / 60))
    return (*ways, _speed(node, fastest))


def of_move(node: Node, project: Project) -> tuple[Setpoint, ...]:
    """A single move, which takes distance, direction and speed from step 1."""
    step = project.step(1)
    return (_goal(node, "relative", _angle(project, step.sign * step.distance)), _speed(node, step.speed))


def of_jog(node: Node, project: Project, sign: int) -> tuple[Setpoint, ...]:
    """Jog and homing, which take their speed from step 1 and end when they are stopped."""
    return (_goal(node, "velocity", sign * project.step(1).speed * tau / 60),)


def _speed(node: Node, rpm: int) -> Setpoint:
    return _goal(node, "speed", rpm * tau / 60)


def _goal(node: Node, quantity: str, value: float) -> Setpoint:
    return Setpoint(node.node, quantity, value, -inf, inf)


def _angle(project: Project, units: int) -> float:
    """rad for so many user units; no number where the project does not say how many make a turn."""
    return units * tau / project.turn_distance if project.turn_distance else nan


def _ends(project: Project, how: Behaviour) -> Iterator[int]:
    """User units, with their sign, at the farthest ends of all its passes: one, or two where it goes both ways."""
    reached = [_reached(project, replace(how, seg_loop=count)) for count in _COUNTS]
    high, low = max(top for top, _ in reached), min(bottom for _, bottom in reached)
    if high or not low:
        yield high
    if low:
        yield low


def _reached(project: Project, how: Behaviour) -> tuple[int, int]:
    """The highest and the lowest place that an end of a step is at, in user units from where the first pass begins.

    What a pass leaves over adds up; so it is the first or the last pass that gets farthest.
    """
    at = high = low = 0
    for place in execution.one_pass(project, how):
        step = project.step(place.step)
        at += step.sign * step.distance if step.speed else 0
        high, low = max(high, at), min(low, at)
    counts = [execution.passes(project, replace(how, proj_loop=count)) or COUNTLESS for count in _COUNTS]
    drift = at * (max(counts) - 1)
    return max(high, high + drift), min(low, low + drift)


def _goes_on(project: Project, how: Behaviour) -> bool:
    """Whether only a stop ends it."""
    numbers = range(1, execution.last_step(project) + 1)
    still = any(not project.step(number).distance and project.step(number).speed for number in numbers)
    return project.is_endless or (still and how.zero_distance == "endless")
