"""What dumps tell by themselves: what is edited is compared with what is shown, and nothing has to move for it.

A dump shows what is edited or what is stored, with the lowest or the highest byte of a number first. An edit that can
be seen tells both, and what becomes of it when another project is selected. Where edits cannot be seen, one run tells
what selecting does: it takes the pause that was edited before, or the one that is stored.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from motorbus.errors import VerificationFailed
from motorbus.families.stepper.driver import reading
from motorbus.families.stepper.driver.characterising.experiments import SLACK, SLACK_PART, Act
from motorbus.families.stepper.driver.characterising.findings import Case
from motorbus.families.stepper.driver.characterising.listening import FLAGS, listened, told, write
from motorbus.families.stepper.driver.characterising.trials import controls
from motorbus.families.stepper.table import (
    STEPS,
    TABLE,
    Edit,
    Order,
    Project,
    Step,
    decode_image,
    differences,
)

ORDERS: Final[tuple[Order, Order]] = ("little", "big")
_STOP_MODE: Final = TABLE["stop_mode"].address
_FLAG_PLACES: Final = tuple(TABLE[name].address for name in ("stop_mode", "mode4", "power_on_home"))
MARGIN: Final = 1.0
"""s that are waited beyond the longest of them."""
_LONGEST: Final = 5.0
"""s of a stored pause that are waited for."""


async def view(case: Case) -> Project:
    """Write a project and look whether it is shown, and in which order; gives that project.

    Raises VerificationFailed when what is shown is neither that nor what was there before.
    """
    before = case.stored[case.scratch]
    project = next(
        one.project
        for one in controls(case.motor, case.scratch)
        if not any(shows(before, one.project, order) for order in ORDERS)
    )
    await write(case.node, project)
    image = await reading.image(case.node, case.scratch)
    orders = [order for order in ORDERS if shows(image, project, order)]
    if len(orders) == 1:
        case.found.settle("read_view", "working", "a project that was edited and not saved reads as edited")
        case.found.settle("dump_order", orders[0], "numbers of two different bytes that were edited read so")
        case.reads(orders[0])
    elif image == before:
        why = "what is edited is not shown, so no number is known that a dump could be compared with"
        case.found.leave("dump_order", why)
    else:
        raise VerificationFailed(
            f"project {case.scratch} was edited and reads neither as edited nor as before",
            received=image,
            expected="one of the two",
            cause="something else edits it, or it does not take one of these values",
            advice="nothing was saved: a power cycle brings back what is stored",
            node=case.node.node,
        )
    return project


def shows(image: bytes, project: Project, order: Order) -> bool:
    """Whether an image has what was written of a project: its steps, and its own numbers but for the flags."""
    shown = decode_image(image, order)
    return not any(
        step <= project.total_steps and f"set_{name}" not in FLAGS
        for name, step, _, _ in differences(project, shown)
    )


async def flags(case: Case) -> None:
    """Set the stop mode of the lent project, look whether another one shows it, and set it back."""
    other, mine = case.other, case.stored[case.scratch][_STOP_MODE]
    before = case.stored[other]
    if before[_STOP_MODE] not in (0, 1):
        case.found.leave("flags_scope", f"project {other} has a stop mode that is none")
        return
    mode = 1 - before[_STOP_MODE]
    await told(case.node, Edit("set_stop_mode", {"stop_mode": mode}))
    theirs = await reading.image(case.node, other)
    own = await reading.image(case.node, case.scratch)
    device = theirs[_STOP_MODE] == mode
    await told(case.node, Edit("set_stop_mode", {"stop_mode": before[_STOP_MODE] if device else mine & 1}))
    if not device and theirs != before:
        case.found.leave(
            "flags_scope", f"project {other} reads otherwise than before, and not by its stop mode"
        )
    elif case.seen and own[_STOP_MODE] != mode:
        case.found.leave("flags_scope", "a stop mode that was set is not shown")
    else:
        shown = "shows it too" if device else "does not show it"
        why = f"the stop mode of project {case.scratch} was set, and project {other} {shown}"
        case.found.settle("flags_scope", "device" if device else "project", why)


async def select(case: Case, edited: Project) -> None:
    """Select another project and see what is edited then; `edited` is what was until now."""
    other = case.other
    count = max(1, min(case.stored[other][1], STEPS))
    await told(case.node, _selection(other, count))
    image = await reading.image(case.node, other)
    loaded = _without_flags(bytes((other, count)) + case.stored[other][2:])
    case.found.leave("select", f"project {other}, selected, reads neither as stored nor as what was edited")
    if _without_flags(image) == loaded:
        why = f"project {other} was selected and reads as it is stored, not as what was edited before"
        case.found.settle("select", "load", why)
    elif shows(
        image[:1] + bytes((edited.total_steps,)) + image[2:], replace(edited, number=other), case.node.order
    ):
        why = f"project {other} was selected and reads as what was edited of project {case.scratch}"
        case.found.settle("select", "relabel", why)


def _selection(number: int, count: int) -> Edit:
    return Edit("select_project", {"project": number, "total_steps": count})


def _without_flags(image: bytes) -> bytes:
    return bytes(0 if at in _FLAG_PLACES else byte for at, byte in enumerate(image))


async def select_unseen(case: Case, offset: float, clock: float) -> None:
    """The same where a dump does not show what is edited: a run takes the pause edited before, or the stored one.

    With luck it tells the order of bytes too: the stored pause is known in both.
    """
    stored = {order: decode_image(case.stored[case.scratch], order).step(1).delay / 1000 for order in ORDERS}
    mine = next(
        one for one in (300, 700, 1100) if all(abs(one / 1000 - each) > 0.2 for each in stored.values())
    )
    project = case.motor.project(case.scratch, case.motor.step(1, mine))
    ways: dict[tuple[str, Any], float] = {("relabel", None): mine / 1000}
    ways |= {("load", order): pause for order, pause in stored.items() if pause <= _LONGEST}
    await write(case.node, project)
    await told(case.node, _selection(case.other, max(1, min(case.stored[case.other][1], STEPS))))
    await write(case.node, project, leave="set_step_delay")
    agreed = set(ways)
    for _ in range(2):
        heard = await listened(
            case.node, case.watch, project, (Act(0.0, "start_project"),), max(ways.values()) + MARGIN
        )
        start = heard.answered[0]
        ends = [(one - start - offset) / clock for one in heard.notices] if start is not None else []
        agreed = {way for way in agreed if ends and _fits(ends[0], ways[way] + _move(project))}
    _say_select(case, agreed, stored)


def _move(project: Project) -> float:
    step: Step = project.step(1)
    return 60.0 / float(step.speed * (project.pulses_per_turn or 1))


def _fits(seen: float, expected: float) -> bool:
    return abs(seen - expected) <= SLACK + SLACK_PART * expected


def _say_select(case: Case, agreed: set[tuple[str, Any]], stored: dict[Order, float]) -> None:
    readings = {name for name, _ in agreed}
    if len(readings) != 1:
        case.found.leave("select", "a run took neither the pause edited before nor the one that is stored")
        return
    reading = readings.pop()
    pause = "edited before" if reading == "relabel" else "that is stored"
    case.found.settle("select", reading, f"selected again, project {case.scratch} took the pause {pause}")
    orders = {order for _, order in agreed}
    if reading == "load" and len(orders) == 1:
        order = orders.pop()
        why = f"the stored pause of step 1 takes {stored[order]:g} s, which its dump says in this order only"
        case.found.settle("dump_order", order, why)
        case.reads(order)
