"""The outputs by hand, and what is left of them in memory: no controller tells which of its outputs are on.

What is remembered is what was commanded last and nothing more. It is forgotten where something that nobody can see may
have switched them: a project that runs, or a command of which it is not known whether it was heard.
"""

from __future__ import annotations

from motorbus.errors import RequestError
from motorbus.families.stepper.driver import commands
from motorbus.families.stepper.driver.memory import ports_of
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.table import OutputPort


async def set_output(node: Node, port: int, active: bool) -> None:
    """Switch outputs: 1 to 3, 4 for all three, 5 for both LEDs; active is pulled low (item 23).

    `last_commanded` remembers it. Raises RequestError for another port or level, OutcomeUnknown when the
    acknowledgement does not come: then it is not known how these outputs are.
    """
    if not isinstance(active, bool | int) or active not in (False, True):
        raise RequestError(f"{active!r} is no level", expected="True or False", advice="nothing was sent")
    if not isinstance(port, int) or isinstance(port, bool):
        raise RequestError(f"{port!r} is no output", expected="1 to 5", advice="nothing was sent")
    said = commands.set_output(node, port, int(active))
    ports = ports_of(port)
    node.memory.commanded(ports, None)
    await said
    node.memory.commanded(ports, bool(active))


def last_commanded(node: Node) -> dict[int, bool | None]:
    """What each output, 1 to 3 and 5 for the LEDs, was last commanded to be on this bus; None: not known.

    It is a memory and no reading: a button, another host or a power cycle changes outputs without a word.
    """
    return dict(node.memory.outputs)


def forget(node: Node) -> None:
    """A project begins: its steps may switch outputs 1 to 3, and nobody knows whether its end does too."""
    node.memory.commanded(ports_of(OutputPort.ALL), None)
