"""That a project was started and may still run is written down: the next program to open this line cannot ask.

A busy controller acknowledges a start and ignores it, and its notice does not say whose end it tells. So a run whose
end is not known must not be forgotten with the program that began it. It stands in the journal of the bus until its
notice has come or a stop was accepted; until then the next run is refused there, and so is whatever edits a project.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.steps import INTENT, OUTCOME, READABLE, Emit, JournalEntry, catch
from motorbus.errors import LinkError
from motorbus.families.stepper.driver.node import Node

RUN: Final = "run"
"""What a project that was started is called in the journal."""


class Unrecorded(NamedTuple):
    """An event: a run is over, `how` says in which way, and the journal goes on saying that it may not be."""

    how: str
    why: str


async def owed(node: Node, project: int) -> None:
    """It is about to be started. Raises RequestError while something else is unfinished on this bus."""
    facts = {
        "node": node.node,
        "project": project,
        "what": f"the run of project {project}",
        "cause": "it was started, and nothing has told that it has ended",
        "advice": "`motorbus stop {bus}` ends it",
        READABLE: True,
    }
    node.memory.owed = True  # before it is written down: another run that ends now does not settle this one
    try:
        await Emit(JournalEntry(RUN, INTENT, facts))
    except BaseException:
        node.memory.owed = False
        raise


async def settled(node: Node, how: str) -> None:
    """It runs no longer, or never did. Reports `Unrecorded` where the journal cannot be written.

    Where there is no journal, or that has another change open, there is nothing to do.
    """
    node.memory.owed = False
    told = await catch(Emit(JournalEntry(RUN, OUTCOME, {"outcome": how})))
    if isinstance(told, LinkError):
        await catch(Emit(Unrecorded(how, told.summary)))
