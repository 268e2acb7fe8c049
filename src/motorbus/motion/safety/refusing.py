"""What the gate says when it refuses an order for what nobody knows or nobody would end."""

from __future__ import annotations

from motorbus.core.setpoint import Deferred, Setpoint
from motorbus.errors import Refused


def nobody_stops(goal: Setpoint) -> Refused:
    """The error for endless motion of what nobody would stop."""
    return Refused(
        f"node {goal.node}: goal {goal.quantity} has no end of its own, and it is no axis that is open",
        reason="unattended",
        cause="only axes that are open are stopped when the machine is left, or its lease is lost",
        advice="open the machine with it as an axis, or its bus by its address; nothing was sent",
        node=goal.node,
    )


def nothing_known(later: Deferred) -> Refused:
    """The error for letting begin what nobody here has handed over."""
    whom = "anybody on this bus" if later.node is None else f"node {later.node}"
    return Refused(
        f"nothing is known to wait in {whom}, so nobody can tell what would begin",
        reason="unknown",
        expected="something that was handed over since this bus was opened",
        cause="it was carried out already, or an earlier program handed it over",
        advice="hand it over again, which replaces what waits, then let it begin; nothing was sent",
        node=later.node,
    )


def stopped_since(node: int) -> Refused:
    """The error for letting begin what was handed over before a stop."""
    return Refused(
        f"node {node} was stopped after something had been handed over to it, which waits there still and would begin",
        reason="stopped",
        expected="no stop between the two",
        advice="hand it over again, which replaces what waits; nothing was sent",
        node=node,
    )
