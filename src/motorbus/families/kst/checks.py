"""Checks of a KST servo: pending id, heat, objects that its profile expects. Reads only."""

from __future__ import annotations

from typing import Final

from motorbus.core.findings import Check, Subject
from motorbus.families.kst.driver import feedback
from motorbus.families.kst.profiles import DEFAULT_NODE

FACTORY_ID: Final = DEFAULT_NODE
HOT: Final = 80.0  # °C; no source gives a limit # assumption
OTHER_SETTINGS: Final = ({"id_format": "ext"}, {"id_format": "std"})
"""Settings of the bus with which a silent servo may answer."""


async def check(subject: Subject) -> None:
    """All checks of one servo."""
    pending = subject.identity.details.get("reads_back_id")
    node = subject.device.node
    if pending not in (None, node):
        evidence = f"answers as {node:#x}, reads back {pending:#x}"
        cause = "an id was written and is not in force before a save and a power cycle"
        subject.warn("can-id-pending", evidence, cause, f"`motorbus set-id {subject.where} {pending:#x}`")
    state = await feedback.telemetry(subject.device)
    if state.refused:
        cause = f"its firmware or maker is not that of the profile {subject.identity.table}"
        fix = "open the bus with another profile, as kst:PORT,profile=kst"
        subject.warn("model-unknown", state.refused[0], cause, fix)
    if state.temperature is not None and state.temperature > HOT:
        evidence = f"{state.temperature:.0f} °C, limit {HOT:.0f} °C"
        subject.error("too-hot", evidence, "it holds a load for too long", "cut its supply until it is cool")
    for name in state.alarm:
        subject.error("alarm", f"alarm {name}", "the servo reports it", "cut its supply for a moment")


CHECKS: Final[tuple[Check, ...]] = (check,)
