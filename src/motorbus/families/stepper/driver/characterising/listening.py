"""One experiment carried out: what is edited for it, what is said, and at which moments answers and notices came.

All times are those of the host's link. The controller begins when it has heard the start; how much later that is
answered is the same each time, and comes out of runs whose time is known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from motorbus.core.request import Notification, Priority, Request
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Sleep, WaitFor, catch, gather
from motorbus.errors import Interrupted, MotorbusError
from motorbus.families.stepper.driver import goals
from motorbus.families.stepper.driver.characterising.experiments import Act
from motorbus.families.stepper.driver.commands import motion, nothing
from motorbus.families.stepper.driver.exchanges import command, timed
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import read_input
from motorbus.families.stepper.driver.stopping import ended
from motorbus.families.stepper.driver.turning import Watch
from motorbus.families.stepper.table import Edit, Project, edits

FLAGS: Final = ("set_stop_mode", "set_mode4", "set_power_on_home")
"""What may belong to the device and not to a project, so no experiment touches it unasked."""


QUIET: Final = 0.05
"""s without a word before a run. With the reading before it, nothing of what was said earlier delays the start: behind
a stop a bus makes sure first that the answers it gets are new.
"""


class Heard(NamedTuple):
    """What came: when each command was sent, when it was answered (None: it was not), and when notices came (s)."""

    sent: tuple[float, ...]
    answered: tuple[float | None, ...]
    notices: tuple[float, ...]


async def write(node: Node, project: Project, *, leave: str = "") -> None:
    """Edit every field that carrying out this project heeds, but none that may be the device's; nothing is saved.

    Which numbers were there before does not matter then. `leave` names a command that is left out.
    """
    for edit in edits(project):
        if edit.command not in FLAGS and edit.command != leave:
            await told(node, edit)


def told(node: Node, edit: Edit) -> Request[None]:
    """One command that sets parameters."""
    values: dict[str, Any] = dict(edit.values)
    return command(node, edit.command, nothing, priority=Priority.CONFIGURATION, **values)


async def listened(
    node: Node, watch: Watch, project: Project, acts: Sequence[Act], seconds: float, wanted: int = 1
) -> Heard:
    """Say these commands at their moments, and listen until so many notices have come, for `seconds` at most.

    What is not answered is no error here. In the end everything is stopped. Raises Interrupted when somebody else has
    stopped it meanwhile, or since `watch` was made; OutcomeUnknown when no stop is accepted.
    """
    notices: list[float] = []

    def heard(notice: Notification) -> bool:
        notices.append(notice.at)
        return len(notices) >= wanted

    await catch(read_input(node, 1))
    await Sleep(QUIET)
    node.memory.owed = True
    said, _ = await gather(_said(node, watch, project, acts), _listening(heard, seconds))
    if watch.overtaken:
        raise Interrupted(
            "somebody stopped the controller during an experiment",
            advice="characterise it again when nobody else uses it",
        )
    await ended(node)
    sent, answered = said
    return Heard(sent, answered, tuple(notices))


async def _listening(heard: Callable[[Notification], bool], seconds: float) -> Notification | None:
    return await WaitFor(heard, seconds)


async def _said(
    node: Node, watch: Watch, project: Project, acts: Sequence[Act]
) -> tuple[tuple[float, ...], tuple[float | None, ...]]:
    began = now = await Sleep(0.0)
    sent: list[float] = []
    answered: list[float | None] = []
    for act in acts:
        if (rest := began + act.at - now) > 0:
            await Sleep(rest)
        now = await Sleep(0.0)
        sent.append(now)
        came = await catch(timed(order(node, watch, project, act.command)))
        if isinstance(came, Interrupted):
            raise came
        answered.append(None if isinstance(came, MotorbusError) else came)
        if answered[0] is None:
            break
    return tuple(sent), tuple(answered)


def order(node: Node, watch: Watch, project: Project, name: str) -> Request[None]:
    """The exchange for one command of an experiment, with the goals of what it moves."""
    if name == "start_project":
        far = goals.of_project(node, project) if project.total_steps else (_nowhere(node),)
        return motion(node, name, far, watch.refusal, project=project.number)
    if name == "run_once":
        return motion(node, name, goals.of_move(node, project), watch.refusal)
    return command(node, name, nothing, priority=Priority.STOP)


def _nowhere(node: Node) -> Setpoint:
    return Setpoint(node.node, "relative", 0.0, -float("inf"), float("inf"))
