"""What waits is what was handed over and not carried out yet, as far as acknowledgements tell."""

from __future__ import annotations

from motorbus.core.goal import Goal, Later
from motorbus.motion.safety.waiting import Waiting

ONE = Goal(1, "position", 0.5, -1.0, 1.0)
OTHER = ONE._replace(value=0.7)
SECOND = ONE._replace(node=2)


def handed(waiting: Waiting, *goals: Goal, node: int = 1, done: bool = True) -> Later:
    later = Later(node)
    waiting.take(later, goals, 0)
    later.done = done
    return later


def begun(waiting: Waiting, node: int | None = None, *, done: bool = True) -> None:
    later = Later(node, begins=True)
    waiting.begin(later)
    later.done = done


def goals(waiting: Waiting, node: int | None = None) -> list[Goal] | None:
    found = waiting.of(Later(node, begins=True))
    return None if found is None else [goal for one in found for goal in one.goals]


def test_of_what_nobody_has_seen_handed_over_nothing_is_known() -> None:
    assert goals(Waiting()) is goals(Waiting(), 1) is None


def test_it_waits_by_node_until_it_was_carried_out() -> None:
    waiting = Waiting()
    handed(waiting, ONE)
    handed(waiting, SECOND, node=2)
    assert (goals(waiting), goals(waiting, 1), goals(waiting, 2)) == ([ONE, SECOND], [ONE], [SECOND])
    begun(waiting, 1)
    assert (goals(waiting), goals(waiting, 1)) == ([SECOND], None)
    begun(waiting)
    assert goals(waiting) is None


def test_the_last_one_counts_once_it_is_known_to_have_arrived_and_both_before() -> None:
    waiting = Waiting()
    handed(waiting, ONE)
    later = handed(waiting, OTHER, done=False)
    assert goals(waiting, 1) == [ONE, OTHER]
    later.done = True
    assert goals(waiting, 1) == [OTHER]
    handed(waiting)
    assert goals(waiting, 1) == []


def test_what_was_told_to_begin_and_may_not_have_heard_waits_still() -> None:
    waiting = Waiting()
    handed(waiting, ONE)
    begun(waiting, 1, done=False)
    assert goals(waiting, 1) == [ONE]
    begun(waiting, 1)
    assert goals(waiting, 1) is None


def test_the_same_mark_may_be_used_again() -> None:
    waiting, again = Waiting(), Later(1, begins=True)
    for one in (ONE, OTHER):
        handed(waiting, one)
        waiting.begin(again)
        assert goals(waiting, 1) == [one]
        again.done = True
        assert goals(waiting, 1) is None


def test_what_has_begun_waits_no_more_when_the_same_mark_begins_once_more() -> None:
    waiting, again = Waiting(), Later(1, begins=True)
    handed(waiting, ONE)
    waiting.begin(again)
    again.done = True
    waiting.begin(again)
    assert goals(waiting, 1) is None


def test_a_copy_knows_what_is_known_by_then_and_tells_nobody() -> None:
    waiting = Waiting()
    handed(waiting, ONE)
    other = waiting.copy()
    handed(other, SECOND, node=2)
    begun(other, 1)
    assert (goals(waiting), goals(other)) == ([ONE], [SECOND])
