"""A change that is interrupted while the process lives ends at once: old or new, locked, and the journal closed."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Data
from motorbus.errors import LinkLost, NoReply
from motorbus.families.feetech.driver.placing import called
from motorbus.link.memory import MemoryLink
from tests.families.feetech.cuts import NEVER, VERBS, Cut, Doomed, World


def sent(verb: str) -> int:
    """How many packets a change sends."""
    world = World(verb, {})
    world.run(world.change)
    return len(world.link.sent)


class Interrupting:
    """Raises KeyboardInterrupt as soon as packet number `at` has left; twice in a row with `again`."""

    def __init__(self, at: int, again: int | None = None) -> None:
        self.left = {at, again}
        self.count = -2  # the servo is read before the change begins

    def __call__(self, link: Doomed, data: Data) -> None:
        MemoryLink.write(link, data)
        self.count += 1
        if self.count in self.left:
            raise KeyboardInterrupt


def interrupted(verb: str, interrupting: Interrupting, monkeypatch: pytest.MonkeyPatch) -> World:
    world = World(verb, {})
    with monkeypatch.context() as patched:
        patched.setattr(Doomed, "write", lambda link, data: interrupting(link, data))
        with pytest.raises(KeyboardInterrupt) as caught:
            world.run(world.change)
    world.notes = caught.value.__notes__
    return world


@pytest.mark.parametrize("verb", VERBS)
def test_ctrl_c_at_any_packet(verb: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for at in range(sent(verb)):
        world = interrupted(verb, Interrupting(at), monkeypatch)
        assert world.faults(None) == [], at
        assert world.link.rate == world.rate
        assert world.notes == [f"the servo is {called(world.job(), world.place)}, and locked"]


@pytest.mark.parametrize("verb", VERBS)
def test_ctrl_c_again_in_the_clean_up_is_ended_by_recovery(
    verb: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for at in range(sent(verb)):
        world = interrupted(verb, Interrupting(at, at + 1), monkeypatch)
        outcome = world.run(world.recovery)
        assert world.faults(outcome) == [], at


@pytest.mark.parametrize("verb", VERBS)
def test_a_servo_that_loses_its_supply_is_brought_to_an_end_at_once(verb: str) -> None:
    world = World(verb, {"torn": "erased"})
    error = world.run(world.change, Cut(moment=0.01, host=False, supply=True))
    assert "and locked" in error.__notes__[0]
    assert world.journal.unfinished() is None
    assert world.faults("old") == []


@pytest.mark.parametrize("verb", VERBS)
def test_a_servo_that_is_pulled_out_leaves_the_journal_open_and_says_so(
    verb: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = World(verb, {})
    with monkeypatch.context() as patched:
        patched.setattr(world.servo, "power_cycle", world.servo.unplug)
        error = world.run(world.change, Cut(record=1, kept=True, host=False, supply=True))
    assert "recover() ends it" in error.__notes__[0]
    assert world.journal.unfinished() is not None
    assert isinstance(world.run(world.recovery), NoReply)
    world.servo.plug()
    outcome = world.run(world.recovery, NEVER)
    assert world.faults(outcome) == []


def test_nothing_is_done_when_the_intent_cannot_be_recorded() -> None:
    world = World("set_id", {})
    error = world.run(world.change, Cut(record=0, host=True))
    assert isinstance(error, LinkLost)
    assert world.link.sent == []
    assert world.place == world.old
