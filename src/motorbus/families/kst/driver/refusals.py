"""What a profile lacks is refused before anything is sent, and the refusal names who has it."""

from __future__ import annotations

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
