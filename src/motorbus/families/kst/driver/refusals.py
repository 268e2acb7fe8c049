"""Refusals made before anything is sent: what a profile lacks, with who has it, and times that would never end."""

from __future__ import annotations

from math import inf

from motorbus.errors import RequestError
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.table import PROFILES


def lacking(node: Node, what: str, row: str) -> RequestError:
    """The error for what the profile of this node lacks; `row` is what those have who can do it."""
    having = [profile.name for profile in PROFILES.values() if row in profile.table]
    manual = "the KST CAN protocol manual does not have it; newer firmware and other makers do"
    return RequestError(
        f"node {node.node}: the profile {node.profile.name} has no {what}",
        expected=f"a servo of the profile {' or '.join(having)}",
        cause=manual if node.profile.name == "kst" else "no source says that these servos have it",
        advice=f"if this servo has it, choose its profile, as in kst:PORT,profile={having[0]}; nothing was sent",
        node=node.node,
    )


def above_zero(name: str, value: object, unit: str, *, node: int | None = None) -> None:
    """Raises RequestError unless this is a finite number above 0: what waits for NaN seconds waits for ever."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < inf:
        raise RequestError(
            f"{name} {value!r} is not a finite number above 0",
            advice=f"give it in {unit}; nothing was sent",
            node=node,
        )
