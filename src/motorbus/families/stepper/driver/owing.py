"""That a project was started and may still run is written down: the next program to open this line cannot ask.

A busy controller acknowledges a start and ignores it, and its notice does not say whose end it tells. So a run whose
end is not known must not be forgotten with the program that began it. It stands in the journal of the bus until its
notice has come or a stop was accepted; until then the next run is refused there, and so is whatever edits a project.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.operation import INTENT, OUTCOME, Journal, Operation, Report, outcome
from motorbus.families.stepper.driver.node import Node

RUN: Final = "run"
"""What a project that was started is called in the journal."""


def owed(node: Node, project: int) -> Operation[None]:
    """It is about to be started. Raises RequestError while something else is unfinished on this bus."""
    facts = {
        "node": node.node,
        "project": project,
        "what": f"the run of project {project}",
        "cause": "it was started, and nothing has told that it has ended",
        "advice": "`motorbus stop {bus}` ends it",
    }
    yield from Report(Journal(RUN, INTENT, facts))
    node.memory.owed = True


def settled(node: Node, how: str) -> Operation[None]:
    """It runs no longer, or never did. Where there is no journal, or that has another change open, nothing is told."""
    node.memory.owed = False
    yield from outcome(iter(Report(Journal(RUN, OUTCOME, {"outcome": how}))))
