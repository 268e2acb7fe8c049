"""Whether a controller is there, and what can be said of it: little, for it has no identity.

All that is asked is to read project 1: harmless, and its answer of 226 bytes is no echo and no other device's. Frames
that begin with a motor number or with 00 are never sent to find something out: they would set registers of an
attitude sensor, which shares their header and their rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core.family import Identity
from motorbus.core.request import Request
from motorbus.errors import NoReply
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import dump_once
from motorbus.families.stepper.table import PROJECTS

MODEL: Final = "stepper controller"
UNKNOWN: Final = "not told"


async def ping(node: Node) -> bool:
    """Is it there? Silence is the answer False."""
    try:
        await dump_once(node, 1)
    except NoReply:
        return False
    return True


async def identify(node: Node) -> Identity:
    """What is known: that it answers as such a controller does. It tells no model, no version and no number."""
    await dump_once(node, 1)
    return Identity(node.node, MODEL, UNKNOWN, node.table.name, _details(node))


def _details(node: Node) -> Mapping[str, object]:
    return {"motor": node.motor, "projects": PROJECTS, "known_by": f"a dump of {wire.DUMP_LENGTH} bytes"}


def probe(node: Node, attempt: int) -> Request[bool]:
    """Read one of the four projects, in turn: all that can be asked without a frame that means something elsewhere."""
    project = attempt % PROJECTS + 1
    asked = dump_once(node, project)
    return Request(
        asked.wire,
        asked.expected,
        lambda answer: not wire.dump_fault(answer.replies[0].data, project),
        repeatable=True,
    )
