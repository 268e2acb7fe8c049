"""A change of id or rate beside a journal that fails, a servo that is pulled out, and other tasks of the program.

Cuts at every frame are in `tests/conformance/test_cuts.py`.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import motorbus
from motorbus import session
from motorbus.core.steps import INTENT, JournalEntry
from motorbus.errors import LinkError, NoReply, RequestError
from motorbus.simulation.named import Simulation

NEW = {"set_id": 7, "set_baud": 500_000}


@pytest.mark.parametrize("verb", NEW)
def test_servo_that_is_unplugged_during_change_is_recovered_later(verb: str) -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        servo = simulation[3]

        def unplug(event: object) -> None:
            if isinstance(event, JournalEntry) and event.state.startswith("writing"):
                servo.unplug()

        with motorbus.open(simulation.url, report=unplug) as bus:
            with pytest.raises(motorbus.MotorbusError) as caught:
                getattr(motorbus.feetech.Servo(bus, 3), verb)(NEW[verb], among=[3])
            assert "recover() ends it" in caught.value.__notes__[0]
        with motorbus.open(simulation.url) as bus:
            change = session.unfinished(bus)
            assert change is not None
            recover = motorbus.feetech.Servo(bus, change.node).recover
            with pytest.raises(NoReply):
                recover(change.verb, change.facts)
            servo.plug()
            assert recover(change.verb, change.facts) == "old"
            assert session.unfinished(bus) is None
        assert (servo.id, servo.baud_rate, servo.locked) == (3, 1_000_000, True)


@pytest.mark.parametrize("kept", [False, True], ids=["full disk", "folder not synced"])
def test_change_whose_intent_cannot_be_recorded_writes_nothing(kept: bool) -> None:
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        journal: Any = bus.journal

        def refuse(event: Any) -> None:
            if event.state != INTENT or kept:
                journal(event)
            if event.state == INTENT:
                raise LinkError("the disk is full")

        bus.journal = refuse
        with pytest.raises(LinkError, match="the disk is full"):
            motorbus.feetech.Servo(bus, 3).set_id(7, among=[3])
        assert journal.unfinished() is None
        assert simulation[3].locked
        assert simulation[3].memory.wear.total() == 0


def test_change_is_refused_while_another_one_is_unfinished() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        journal: Any = bus.journal
        journal(JournalEntry("set_id", INTENT, {"node": 9, "new": 8}))
        with pytest.raises(RequestError, match=r"set_id\(\) of #9, begun .* is unfinished"):
            motorbus.feetech.Servo(bus, 3).set_id(7, among=[3])
        change = journal.unfinished()
        assert change is not None
        assert change.node == 9
        assert 3 not in bus.statistics.nodes


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


@pytest.mark.parametrize("verb", NEW)
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
