"""A guarded write opens the lock of its device and closes it again, whichever of its steps fails.

Interrupts, cancellations and losses of supply at every frame are in `test_cuts.py`.
"""

from __future__ import annotations

from typing import Any

from motorbus.core.family import Family
from motorbus.core.register import Register
from motorbus.errors import MotorbusError
from tests.support.world import IDS, Steps, World, closed, kept, locks, said, samples, world

NODE = IDS[0]
MOST = 2000


def change(there: World) -> tuple[Register, int]:
    """A row that is kept in EEPROM, and another value than it has; a number, for a choice may be how it answers."""
    row = next(row for row in kept(there.table(NODE)) if not row.choices)
    held = there.memory(NODE)[row.name]
    return row, next(raw for raw in samples(row) if raw != held)


def guarded(there: World) -> Any:
    """A guarded write, not yet begun."""
    row, raw = change(there)
    return said(there.device(NODE), "write", **{row.name: row.to_value(raw)})


def assert_closed_and_usable(there: World, context: object) -> None:
    lock = locks(there.family)[0]
    assert there.memory(NODE)["lock"] == closed(lock), context
    assert there.device(NODE).read("lock")["lock"] == closed(lock), context


def test_a_guarded_write_opens_the_lock_and_closes_it(lockable: Family) -> None:
    with world(lockable) as there:
        states: list[int] = []
        row, raw = change(there)
        steps = Steps(there.bus, seen=lambda: states.append(there.memory(NODE)["lock"]))
        steps.run(guarded(there))
        shut = closed(locks(lockable)[0])
        assert shut in states  # it was closed at first,
        assert len(set(states)) == 2  # open in between,
        assert states[-1] == shut  # and closed in the end
        assert there.memory(NODE)[row.name] == raw


def test_refused_or_unanswered_at_any_step_it_closes_the_lock(lockable: Family) -> None:
    for number in range(MOST):
        with world(lockable) as there:
            steps = Steps(there.bus, cut_at=number, error=lambda: MotorbusError("as if it had failed"))
            try:
                steps.run(guarded(there))
            except MotorbusError:
                assert steps.cuts
            assert_closed_and_usable(there, number)
            if not steps.cuts:
                break
