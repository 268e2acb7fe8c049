"""Every kind of fault by chance, on everything that is asked of a controller: nothing false is told, nothing hangs.

And what no fault touches is right at its first try. What is asked and what strikes comes from seeds; time is virtual.
"""

from __future__ import annotations

import pytest

from motorbus.errors import OutcomeUnknown
from motorbus.families.stepper.table import ORDERS
from tests.conftest import Rounds
from tests.support.lines import EVERYTHING, NOTICES, REPLIES, REQUESTS, Mischief
from tests.support.rigs.stepper import KEPT, MOTIONS, FalseWord, Rig


class Ledger:
    """How many calls went how, and how many of those that no fault touched did not go at once."""

    def __init__(self, rig: Rig, line: Mischief) -> None:
        self.rig = rig
        self.line = line
        self.failed_untouched = 0
        self.again_untouched = 0
        self.last: list[tuple[bool, bool]] = []

    def call(self) -> None:
        """One more."""
        faults, again = self.line.count, self.rig.tried_again
        waits = any(at > self.rig.link.now() + 1e-6 for at, *_ in self.rig.link._under_way)
        done = self.rig.anything()
        touched = waits or self.line.count > faults
        if not touched:
            self.failed_untouched += not done
            self.again_untouched += self.rig.tried_again > again

    def told(self, what: str) -> str:
        """A line for `make soak`."""
        rig, right = self.rig, sum(self.rig.right.values())
        sent = sum(ledger.sent for ledger in rig.bus.statistics.nodes.values())
        return (
            f"\n{rig.calls} calls, {sent} exchanges, {what}: {self.line.count} faults of "
            f"{len(self.line.fired)} kinds, 0 false, {right / rig.calls:.2%} succeeded, "
            f"{self.failed_untouched} untouched ones failed, {self.again_untouched} needed a second try, "
            f"the longest call took {rig.longest:.2f} s of its own time"
        )


ENOUGH = 5_000
"""Calls in which every kind of fault strikes, also where one in fifty is struck."""


@pytest.mark.timeout(900)
@pytest.mark.parametrize(("share", "pace"), [(0.02, True), (0.02, False), (0.2, True)])
def test_everything_at_once_tells_nothing_false_and_nothing_hangs(
    share: float, pace: bool, rounds: Rounds
) -> None:
    line = Mischief(11, share, *EVERYTHING, copy_after=None if pace else 0.0)
    ledger = Ledger(Rig(line, 12, pace=pace), line)
    ledger.rig.open()
    total = max(rounds(100_000, ENOUGH), ENOUGH)
    for _ in range(total):
        ledger.call()
    print(ledger.told(f"{share:.0%} of all that is said" + (", at 9600 baud" if pace else ", without pace")))
    assert line.count > total * share
    assert set(line.fired) >= set(REQUESTS) | set(REPLIES)
    assert (ledger.failed_untouched, ledger.again_untouched) == (0, 0)
    assert sum(ledger.rig.right.values()) > (0.95 if share < 0.1 else 0.6) * total


@pytest.mark.parametrize("kind", EVERYTHING)
def test_a_fault_of_each_kind_tells_nothing_false(kind: str) -> None:
    line = Mischief(3, 0.25, kind)
    ledger = Ledger(Rig(line, 4), line)
    ledger.rig.open()
    for _ in range(400):
        ledger.call()
    assert line.fired[kind] > (0 if kind in NOTICES else 20)
    assert (ledger.failed_untouched, ledger.again_untouched) == (0, 0)


@pytest.mark.parametrize("name", [*MOTIONS, *KEPT])
def test_what_may_not_be_said_twice_is_said_once_and_its_outcome_is_unknown(name: str) -> None:
    line = Mischief(5, 1.0, "lost")
    rig = Rig(line, 6)
    assert not (rig.motion(name) if name in MOTIONS else rig.keep(name))
    assert not ORDERS[name].repeatable
    assert len(line.heard) == 1, "said once"
    assert isinstance(rig.errors[-1], OutcomeUnknown)


def test_a_copy_that_something_hands_over_later_is_the_known_limit(rounds: Rounds) -> None:
    """Nothing in an acknowledgement tells it from an older one to the same command: see docs/explanation/taint.md.

    A line of 9600 baud that the bus knows to be one has carried a copy before it can be taken for anything. This
    measures what is left where the bus cannot know, behind a socket, and something holds the copy back.
    """
    total = rounds(100_000)
    line = Mischief(9, 0.02, "twice", "unheard", copy_after=0.006)
    rig = Rig(line, 9, pace=False)
    rig.open()
    false = 0
    for _ in range(total):
        try:
            rig.output()
        except FalseWord:
            false += 1
    print(
        f"\n{total} outputs, {line.fired['twice']} copies held back by 6 ms, {false} false acknowledgements"
    )
    assert line.fired["twice"] > total / 500
    assert false <= line.fired["twice"], "a copy is believed once and never shifts what is behind it"
