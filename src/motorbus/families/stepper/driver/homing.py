"""Homing that ends: the controller's own turns in reverse until input 5 is active, and for ever when that never comes.

It has no limit of travel, no limit of time and no notice of its end. So this host looks at input 5 before, and does not
begin when it is active; watches it meanwhile; and says stop when it is active, when the deadline has passed, when it
cannot be read, when the order was not acknowledged, and whatever else happens. A host that dies leaves it homing.

That the controller counts from 0 where it has met the switch, and that it stops there at once, are assumptions.
"""

from __future__ import annotations

from math import floor, inf, tau
from typing import Final, NamedTuple

from motorbus.core.steps import Emit, Progress, Sleep
from motorbus.errors import NotHomed
from motorbus.families.stepper.driver import commands, goals
from motorbus.families.stepper.driver.borrowing import borrowed
from motorbus.families.stepper.driver.jogging import grounded, paced, whole_rpm
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import read_input
from motorbus.families.stepper.driver.stopping import Promise
from motorbus.families.stepper.driver.turning import Watch, finite, honest, refuse_unless_turning, within
from motorbus.families.stepper.table import HOME_INPUT, Project

DEADLINE: Final = 30.0
"""s until homing is given up, when nobody says another time."""
LONGEST: Final = 600.0
"""s that anybody may say."""
READS: Final = 2
"""How often in a row input 5 must read active to be believed."""
EXACT: Final = 1e-9
"""Relative; a whole RPM that was said in rad/s and comes back a hair below itself still is that RPM."""
TOLD: Final = 0.25
"""s between two reports of progress."""


class Homed(NamedTuple):
    """Input 5 was seen active twice in a row, after so many `seconds` in reverse at this `velocity` (rad/s, reckoned
    from project 1), and the stop was accepted."""

    node: int
    seconds: float
    velocity: float
    promise: Promise

    def __str__(self) -> str:
        found = f"input {HOME_INPUT} was active after {self.seconds:.1f} s in reverse at {self.velocity:.4g} rad/s"
        return f"{found}; {self.promise.value}"


async def home(
    node: Node, *, deadline: float = DEADLINE, velocity: float | None = None, at_most: float | None = None
) -> Homed:
    """Turn in reverse until input 5 is active, at most for so long (s, up to 600), then stop: always.

    The speed is that of step 1 of project 1; with a `velocity` (rad/s, above 0, in whole RPM) project 1 is borrowed for
    it as for `move_by`. Where nobody says one and step 1 is faster than `at_most` (rad/s), project 1 is borrowed as
    well, for the greatest whole RPM that is not above it. Reports `Progress` in ms.

    When it returns the motor stands at the switch, *estimated*: that it stops there at once is an assumption, else it
    is beyond. An error that is `unmoved` has moved nothing; after any other nobody knows where it stands.

    Raises NotHomed, with the stop accepted, when input 5 is active before (nothing was moved: it stands at the switch,
    or the switch is stuck) or not active by the deadline; RequestError, before anything is moved, when there is no
    speed, and as `borrowed`; OutcomeUnknown when the order, or the stop, was not acknowledged: where the stop was not,
    the motor may be turning, and the error says so; whatever reading an input raises.
    """
    within(deadline, LONGEST, "deadline")
    said = None if velocity is None else whole_rpm(finite(velocity, "velocity"))
    most = inf if at_most is None else finite(at_most, "at_most")
    watch = Watch(node)

    async def wanted(project: Project) -> Project:
        await _refuse_active(node)
        rpm = said
        if rpm is None:
            refuse_unless_turning(node, project, "home")
            if project.step(1).speed * tau / 60 <= most:
                return project
            rpm = _not_above(most)
        return paced(await grounded(node, project, "home", rpm), rpm, None)

    async def motion(project: Project) -> Homed:
        return await _until_active(node, project, deadline, watch)

    return await honest(watch, borrowed(node, "home", wanted, motion))


def _not_above(most: float) -> int:
    """The greatest whole RPM that is not above this velocity (rad/s). Raises RequestError below 1 RPM."""
    rpm = floor(most * 60 / tau * (1 + EXACT))
    return rpm if rpm > 0 else whole_rpm(most)


async def _refuse_active(node: Node) -> None:
    """Raise NotHomed unless input 5 reads inactive each time."""
    for _ in range(READS):
        if await read_input(node, HOME_INPUT):
            raise NotHomed(
                f"input {HOME_INPUT} is active already, so homing is refused",
                expected="not active",
                cause="it stands at the home switch, the switch is stuck or wired to be active at rest, or its contact "
                "is bad",
                advice="move away from the switch first, forward; nothing was moved",
                node=node.node,
            )


async def _until_active(node: Node, project: Project, deadline: float, watch: Watch) -> Homed:
    await commands.motion(node, "home", goals.of_jog(node, project, -1), watch.refusal)
    began = now = told = await Sleep(0)
    row = 0
    while now - began < deadline:
        row = row + 1 if await read_input(node, HOME_INPUT) else 0
        watch.check()
        now = await Sleep(0)
        if row >= READS:
            velocity = project.step(1).speed * tau / 60
            return Homed(node.node, now - began, velocity, Promise.STOP_ACCEPTED)
        if now - told >= TOLD:
            told = now
            await Emit(Progress(round(1000 * (now - began)), round(1000 * deadline), "homing"))
    raise NotHomed(
        f"input {HOME_INPUT} was not active within {deadline:g} s, so homing was stopped",
        expected=f"input {HOME_INPUT} active",
        cause="the switch is farther away, its wire is broken, or the motor does not turn",
        advice=f"see input {HOME_INPUT} change by hand, then home again, with a longer deadline if it is far",
        node=node.node,
    )
