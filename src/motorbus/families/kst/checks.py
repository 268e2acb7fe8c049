"""Checks of a KST servo: pending id, heat, objects that its profile expects. Reads only."""

from __future__ import annotations

from typing import Final

from motorbus.core.findings import Check, Subject
from motorbus.families.kst.driver import feedback
from motorbus.families.kst.profiles import DEFAULT_NODE

FACTORY_ID: Final = DEFAULT_NODE
HOT: Final = 80.0  # °C; no source gives a limit # assumption


async def check(subject: Subject) -> None:
    """All checks of one servo."""
    node, pending = subject.device.node, subject.identity.details.get("reads_back_id")
    if pending not in (None, node):
        subject.add("can-id-pending", f"answers as {node:#x}, reads back {pending:#x}")
    state = await feedback.telemetry(subject.device)
    if state.refused:
        cause = f"its firmware or maker is not that of the profile {subject.identity.table}"
        fix = "open the bus with another profile, as kst:PORT,profile=kst"
        subject.add("model-unknown", state.refused[0], cause, fix)
    if state.temperature is not None and state.temperature > HOT:
        subject.add("too-hot", f"{state.temperature:.0f} °C, limit {HOT:.0f} °C", action="cut its supply")
    for name in state.alarm:
        subject.add("alarm", f"alarm {name} is set")


CHECKS: Final[tuple[Check, ...]] = (check,)
