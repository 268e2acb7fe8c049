"""How a controller is brought to rest, and what that is worth.

Two commands, for nobody knows whether "stop project" ends a jog as well: 5E for the project, then 03 0D for the motor.
Both are harmless when nothing moves. What is acknowledged is that it was heard. Whether the motor slows down or stops
at once is its stop mode, and nothing tells that it rests.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from math import inf
from typing import Final

from motorbus.core.family import Stop
from motorbus.core.request import Priority, Request, Response
from motorbus.core.steps import catch
from motorbus.errors import Interrupted, LinkError, MotorbusError, OutcomeUnknown
from motorbus.families.stepper.driver.commands import nothing
from motorbus.families.stepper.driver.exchanges import command
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.owing import settled

STOPS: Final = ("stop_project", "stop_motor")
BY_HAND: Final = ("stop_motor", "stop_project")
"""The order for a motion by hand, which may heed the second only."""
TRIES: Final = 5
"""How often each is said until it is accepted; of a device that is silent that takes about 2 s."""
MAY_TURN: Final = "the motor may be turning"


class Promise(Enum):
    """What an acknowledged stop promises, and no more than that."""

    STOP_ACCEPTED = (
        "stop accepted: project and motor; it slows down or stops at once, as its stop mode says, and nothing tells "
        "when it rests"
    )


async def stop(node: Node) -> Promise:
    """End the project, then any other motion. Returns what was promised.

    Both are said, then each again that was not accepted, up to five times. From its first word on no motion and no
    project begins that was asked for before. Raises OutcomeUnknown when one of them never was accepted, for it may have
    been heard all the same, and the motor may be turning as well; LinkError when the port is gone.
    """
    node.memory.wanted += 1
    promise = await ended(node)
    await settled(node, "stopped")
    return promise


async def ended(node: Node, names: tuple[str, ...] = STOPS) -> Promise:
    """The same, as part of a longer work: what others have asked for meanwhile is not called off by it."""
    failures: dict[str, MotorbusError] = {}
    times = 0
    node.memory.stopping += 1  # a run that waits for its notice does not take one of this stop for it
    try:
        while times < TRIES:
            times += 1
            failures = await _said(node, tuple(failures) or names)
            if not failures or any(isinstance(told, LinkError | Interrupted) for told in failures.values()):
                break
        if failures:
            raise _not_accepted(node, failures, times)
        node.memory.stops += 1
        node.memory.owed = False
        node.memory.turning = -inf
    finally:
        node.memory.stopping -= 1
    return Promise.STOP_ACCEPTED


async def _said(node: Node, names: tuple[str, ...]) -> dict[str, MotorbusError]:
    """Say each of them once; what was told of those that were not accepted."""
    failures = {}
    for name in names:
        told = await catch(command(node, name, nothing, priority=Priority.STOP))
        if told is not None:
            failures[name] = told
    return failures


def _not_accepted(node: Node, failures: Mapping[str, MotorbusError], times: int) -> MotorbusError:
    """The error for a stop of which so much was not accepted; that of a port that is gone stays what it is."""
    for told in failures.values():
        if isinstance(told, LinkError):
            told.add_note(f"the stop was not accepted: {MAY_TURN}")
            return told
    first = next(iter(failures.values()))
    often = {1: "once", 2: "twice"}.get(times, f"{times} times")
    said = " and ".join(name.replace("_", " ") for name in STOPS if name in failures)
    return OutcomeUnknown(
        f"{said} {'was' if len(failures) == 1 else 'were'} not accepted, said {often}: {MAY_TURN}",
        sent=first.sent,
        received=first.received,
        expected=first.expected,
        cause=first.cause,
        advice="say stop again, or cut the power of the motor",
        node=node.node,
    )


def stop_all(nodes: Mapping[int, Response | None], motor: int) -> Stop:
    """Both commands; where nobody has answered yet, without waiting for an answer."""
    frames = tuple(
        Request[Response](
            said.wire,
            said.expected if nodes else (),
            priority=Priority.STOP,
            effect=said.effect,
            repeatable=True,
        )
        for said in (command(Node(motor=motor), name, nothing, priority=Priority.STOP) for name in STOPS)
    )
    return Stop(frames, Promise.STOP_ACCEPTED.value)
