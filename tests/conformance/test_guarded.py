"""A lock that was opened is always closed again: whatever step a guarded write is cut at, and however.

The sequence is cut at every step it yields, before the step and after it (the answer is lost then), once and once
more during the clean-up; and from outside, by Ctrl-C at every call of the link and by cancelling a task at every
turn of the event loop.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from motorbus.core.family import Family
from motorbus.core.register import Register
from motorbus.core.request import Data
from motorbus.errors import MotorbusError
from motorbus.link.memory import MemoryLink
from tests.support.world import IDS, Cut, Steps, World, closed, kept, locks, said, samples, world

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


@pytest.mark.parametrize("error", [Cut, KeyboardInterrupt, asyncio.CancelledError], ids=lambda e: e.__name__)
@pytest.mark.parametrize("before", [True, False], ids=["before", "after"])
def test_cut_at_any_step_it_closes_the_lock(
    lockable: Family, before: bool, error: type[BaseException]
) -> None:
    for number in range(MOST):
        with world(lockable) as there:
            steps = Steps(there.bus, cut_at=number, before=before, error=error)
            operation = guarded(there)
            try:
                steps.run(operation)
            except error:
                assert steps.cuts
            assert_closed_and_usable(there, number)
            if not steps.cuts:
                break
    assert number >= 4  # unlock, write, verify, lock


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


class Interrupting(MemoryLink):
    """Presses Ctrl-C at one call of `read` or `write`, before it or after it; what a cut `read` took is lost."""

    countdown = 0
    after = False
    pressed = False

    def write(self, data: Data) -> None:
        self._count(False)
        super().write(data)
        self._count(True)

    def read(self, until: float) -> list[Data]:
        self._count(False)
        arrived = super().read(until)
        self._count(True)
        return arrived

    def _count(self, after: bool) -> None:
        if after is self.after and self.countdown:
            self.countdown -= 1
            if not self.countdown:
                self.pressed = True
                raise KeyboardInterrupt


@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
def test_interrupted_at_any_call_of_the_link_it_closes_the_lock(lockable: Family, after: bool) -> None:
    for number in range(1, MOST):
        with world(lockable, link=Interrupting) as there:
            operation = guarded(there)
            link: Any = there.link
            link.after, link.countdown = after, number
            try:
                there.bus.run(operation)
            except KeyboardInterrupt:
                assert link.pressed
            link.countdown = 0
            assert_closed_and_usable(there, number)
            if not link.pressed:
                break
    assert number > 8  # each of four requests is a write and a read at least


def test_cancelled_at_any_turn_of_the_loop_it_closes_the_lock(lockable: Family) -> None:
    async def cancelled_at(number: int) -> bool:
        with world(lockable) as there:
            operation = guarded(there)
            bus = there.async_bus()
            task = asyncio.ensure_future(bus.run(operation))
            for _ in range(number):
                await asyncio.sleep(0)
            over = task.done()
            task.cancel()
            await asyncio.wait([task])
            assert over or task.cancelled()
            assert_closed_and_usable(there, number)
            await bus.close()
        return over

    for number in range(MOST):
        if asyncio.run(cancelled_at(number)):
            break
    assert number > 4
