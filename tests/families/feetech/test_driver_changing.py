"""A change that is interrupted while the process lives ends at once: old or new, locked, and the journal closed."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import motorbus
from motorbus import session
from motorbus.bus.blocking import Bus
from motorbus.core.request import Data
from motorbus.core.steps import INTENT, Exclusive, JournalEntry
from motorbus.errors import LinkError, LinkLost, MotorbusError, NoReply, RequestError
from motorbus.families.feetech.driver import Node, prepare
from motorbus.families.feetech.driver.changing import guarded
from motorbus.families.feetech.driver.placing import called
from motorbus.journal import BusJournal
from motorbus.link.memory import MemoryLink
from motorbus.simulation.named import Simulation
from tests.families.feetech.cuts import NEVER, OLD, VERBS, Cut, Doomed, World


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


def refused(world: World, error: MotorbusError, *, kept: bool, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The change, when its intent is refused by this error; the packets that left."""
    record = BusJournal.__call__

    def refuse(journal: BusJournal, event: object) -> None:
        if isinstance(event, JournalEntry) and event.state == INTENT:
            if kept:
                record(journal, event)
            raise error
        record(journal, event)

    with monkeypatch.context() as patched:
        patched.setattr(BusJournal, "__call__", refuse)
        assert world.run(world.change) is error
    return world.link.sent


def test_an_intent_that_a_full_disk_refuses_has_begun_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World("set_id", {})
    assert refused(world, LinkError("the disk is full"), kept=False, monkeypatch=monkeypatch) == []
    assert world.faults(None) == []
    assert world.servo.memory.wear.total() == 0


def test_an_intent_that_is_on_the_disk_although_its_folder_was_not_synced_is_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = World("set_id", {})
    assert refused(world, LinkError("the folder cannot be synced"), kept=True, monkeypatch=monkeypatch) == []
    assert world.faults(None) == []


@pytest.mark.parametrize("interrupted", [False, True])
def test_the_journal_of_another_change_stays_open(interrupted: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two that one program begins at the same time, the first was cut off."""
    world = World("set_id", {})
    world.journal(JournalEntry("set_id", INTENT, {"node": 9, "new": 8}))
    if interrupted:
        error: BaseException = KeyboardInterrupt()
        monkeypatch.setattr("motorbus.journal._unfinished", lambda change: error)
        with pytest.raises(KeyboardInterrupt):
            world.run(world.change)
    else:
        error = world.run(world.change)
        assert isinstance(error, RequestError)
        assert world.link.sent == []
        assert not hasattr(error, "__notes__")
    change = world.journal.unfinished()
    assert change is not None
    assert change.facts["node"] == 9
    assert world.place == world.old
    assert world.servo.memory.wear.total() == 0


def meanwhile(simulation: Simulation, *changes: tuple[int, str, int]) -> list[Any]:
    """Several tasks of one program, each changing a servo (id, verb, value); what each of them ended with."""

    async def work() -> list[Any]:
        async with motorbus.open_async(simulation.url) as bus:
            asked = [
                getattr(motorbus.feetech.AsyncServo(bus, id), verb)(value, among=range(10))
                for id, verb, value in changes
            ]
            ends = await asyncio.gather(*asked, return_exceptions=True)
            assert session.unfinished(bus) is None
            return ends

    return asyncio.run(work())


@pytest.mark.parametrize("verb", VERBS)
def test_two_that_are_changed_at_once_do_not_meet(verb: str) -> None:
    """What was looked over before is looked at once more when nobody else has the bus."""
    with motorbus.simulate("feetech", ids="1+2+3") as simulation:
        simulation[1].raw_position, simulation[2].raw_position = 100, 3000
        first, second = simulation[1], simulation[2]
        if verb == "set_id":
            ends = meanwhile(simulation, (1, verb, 7), (2, verb, 7))
            assert first.id != second.id
        else:
            ends = meanwhile(simulation, (1, verb, 500_000), (1, verb, 115_200))
        (failed,) = [end for end in ends if isinstance(end, Exception)]
        assert isinstance(failed, RequestError)
        assert first.locked
        assert second.locked
        assert first.memory.wear.total() + second.memory.wear.total() == 1


def test_one_that_is_changed_twice_at_once_is_changed_once() -> None:
    with motorbus.simulate("feetech", ids="1+2") as simulation:
        ends = meanwhile(simulation, (1, "set_id", 7), (1, "set_id", 8))
        (failed,) = [end for end in ends if isinstance(end, Exception)]
        assert isinstance(failed, RequestError)
        assert "not what it was a moment ago" in failed.summary
        (one,) = [id for id in (7, 8) if id in simulation.simulator.nodes]
        assert simulation[one].memory.wear.total() == 1
        assert simulation[one].locked


def test_one_that_gets_the_id_as_shipped_meanwhile_is_noticed() -> None:
    """A servo whose id is torn would join it there."""
    with motorbus.simulate("feetech", ids="3+4") as simulation:
        ends = meanwhile(simulation, (4, "set_id", 1), (3, "set_id", 7))
        ids = sorted(simulation.simulator.nodes)
        failed = [end for end in ends if isinstance(end, Exception)]
        assert (len(failed), ids) in ((1, [1, 3]), (0, [1, 7]))


def test_an_interruption_when_all_is_over_says_that_it_is() -> None:
    world = World("set_id", {})
    done = world.job()
    operation = guarded(done, Node(OLD))
    step = operation.send(None)
    assert isinstance(step, Exclusive)

    def work(bus: Bus) -> None:
        bus.run(prepare(Node(OLD)))
        bus.run(step.runnable)

    world.run(work)
    with pytest.raises(KeyboardInterrupt) as caught:
        operation.throw(KeyboardInterrupt())
    assert caught.value.__notes__ == ["the servo is 7, and locked"]
    assert world.faults(None) == []
