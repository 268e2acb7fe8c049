"""What a command that moves the motor orders, for the gate, which lets nothing through that does not say where to.

The controller tells no position and knows no limits of travel. So its goals have none either: what is finite and ends
passes, and how far that may be is for whoever knows the machine. Angles are of the motor, forward positive.
"""

from __future__ import annotations

from math import inf, nan, tau

from motorbus.core.operation import Goal
from motorbus.families.stepper import execution
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.table import Project


def of_project(node: Node, project: Project, how: Behaviour = USUAL) -> tuple[Goal, ...]:
    """Starting it: the farthest that one pass gets from where it begins, in rad, and its greatest speed in rad/s."""
    places = {place.step for place in execution.one_pass(project, how)}
    fastest = max((project.step(number).speed for number in places), default=0)
    return (_goal(node, "relative", _angle(project, _farthest(project, how))), _speed(node, fastest))


def of_move(node: Node, project: Project) -> tuple[Goal, ...]:
    """A single move, which takes distance, direction and speed from step 1."""
    step = project.step(1)
    return (_goal(node, "relative", _angle(project, step.sign * step.distance)), _speed(node, step.speed))


def of_jog(node: Node, project: Project, sign: int) -> tuple[Goal, ...]:
    """Jog and homing, which take their speed from step 1 and end when they are stopped."""
    return (_goal(node, "velocity", sign * project.step(1).speed * tau / 60),)


def _speed(node: Node, rpm: int) -> Goal:
    return _goal(node, "speed", rpm * tau / 60)


def _goal(node: Node, quantity: str, value: float) -> Goal:
    return Goal(node.node, quantity, value, -inf, inf)


def _angle(project: Project, units: int) -> float:
    """rad for so many user units; no number where the project does not say how many make a turn."""
    return units * tau / project.turn_distance if project.turn_distance else nan


def _farthest(project: Project, how: Behaviour) -> int:
    """User units, with their sign, at the farthest end of a step of one pass."""
    at, farthest = 0, 0
    for place in execution.one_pass(project, how):
        step = project.step(place.step)
        at += step.sign * step.distance
        farthest = max(at, farthest, key=abs)
    return farthest
