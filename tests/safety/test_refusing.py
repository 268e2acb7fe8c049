"""What the gate says when it refuses: who, why, what to do, and that nothing was sent."""

from __future__ import annotations

from motorbus.core.goal import Later
from motorbus.core.operation import Goal
from motorbus.motion.safety.refusing import nobody_stops, nothing_known, stopped_since


def test_endless_motion_of_what_is_no_axis_names_node_quantity_and_reason() -> None:
    error = nobody_stops(Goal(4, "velocity", 1.0, -2.0, 2.0))
    assert (error.node, error.reason) == (4, "unattended")
    assert "goal velocity has no end of its own" in str(error)
    assert "nothing was sent" in error.advice


def test_what_nobody_knows_of_is_said_of_one_or_of_everybody() -> None:
    one, all_ = nothing_known(Later(4, begins=True)), nothing_known(Later(None, begins=True))
    assert (one.node, all_.node, one.reason, all_.reason) == (4, None, "unknown", "unknown")
    assert "wait in node 4" in str(one)
    assert "wait in anybody on this bus" in str(all_)
    assert "nothing was sent" in one.advice


def test_a_stop_after_the_handing_over_is_said() -> None:
    error = stopped_since(7)
    assert (error.node, error.reason, error.expected) == (7, "stopped", "no stop between the two")
    assert "node 7 was stopped" in str(error)
