"""Before when a project cannot have ended, whatever nobody knows of its controller: what tells a false end from a true.

The notice of an end is two bytes without a checksum, a project or a time. One that comes sooner than the project can be
through is not its end. So this is not an estimate, which is made under one reading, but a bound that holds under all.
"""

from __future__ import annotations

from math import floor, inf
from typing import Final

from motorbus.families.stepper import execution
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.table import Project, Step

FEWEST: Final = Behaviour(seg_loop="total", proj_loop="total")
"""The reading in which steps are carried out least often."""


def earliest(project: Project) -> float:
    """s from its start before which a project has not run to its end, in any behaviour; infinity if it never does.

    All its pauses, and all its pulses at full speed from the first to the last but one (with rounding=carry a step may
    send one less than it has), each step as often as it is carried out at least. A step with a stop input counts with
    its pause only, for its motion may be cut off at its beginning; a wait counts with nothing.
    """
    passes = execution.passes(project, FEWEST)
    if passes is None:
        return inf
    return passes * sum(
        _shortest(project, project.step(number)) * execution.times_in_a_pass(project, number, FEWEST)
        for number in range(1, execution.last_step(project) + 1)
    )


def _shortest(project: Project, step: Step) -> float:
    """s that one execution takes at least."""
    frequency = execution.frequency(project, step)
    if step.stop_input or not frequency:
        return step.delay / 1000
    pulses = max(0, floor(execution.exact_pulses(project, step)) - 1)
    return step.delay / 1000 + pulses / max(frequency, step.start_frequency)
