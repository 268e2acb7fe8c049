"""What an order says is told by its marks, and not found out from its numbers."""

from __future__ import annotations

from motorbus.core.goal import Goal, Later, Stays, torque_on


def test_a_goal_goes_somewhere_unless_it_was_said_that_it_stays() -> None:
    assert Goal(1, "position", 0.5, 0.5, 0.5).stays is None
    assert torque_on(7) == Goal(7, "torque", 1.0, 1.0, 1.0, Stays.ON)


def test_what_is_handed_over_is_not_known_to_have_arrived() -> None:
    assert (Later(3).node, Later(3).begins, Later(3).done) == (3, False, False)
    assert (Later(None, begins=True).node, Later(None, begins=True).begins) == (None, True)
