"""Finding a servo again: the right one among others, never a wrong one, and said plainly when it cannot be known.

What happens at every cut is in `tests/conformance/test_cuts.py`; here are the buses on which something else is odd.
"""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus import session
from motorbus.core.steps import INTENT, JournalEntry
from motorbus.errors import LinkError, NoReply, OutcomeUnknown, RequestError
from motorbus.families.feetech.driver import Node, recover
from motorbus.families.feetech.driver.jobs import SET_BAUD, SET_ID, Job, Place
from motorbus.families.feetech.simulator import effects
from motorbus.simulation.named import Simulation

RATE, SLOW = 1_000_000, 500_000


def begin(
    simulation: Simulation, *reached: str, verb: str = SET_ID, new: int = 7, others: Any = (), number: int = 0
) -> None:
    """As a host that died: what it recorded of the change of the servo that comes first."""
    servo = simulation.simulator.servos[number]  # type: ignore[attr-defined]
    there = Place(new, RATE) if verb == SET_ID else Place(3, SLOW)
    job = Job(verb, Place(3, RATE), there, bytes(servo.memory.read(0, 40)), tuple(others))
    with motorbus.open(simulation.url) as bus:
        assert bus.journal is not None
        bus.journal(JournalEntry(verb, INTENT, job.facts()))
        for state in reached:
            bus.journal(JournalEntry(verb, state, {}))


def end(simulation: Simulation, **how: Any) -> str:
    """The next host recovers."""
    with motorbus.open(simulation.url) as bus:
        change = session.unfinished(bus)
        assert change is not None
        try:
            return motorbus.feetech.Servo(bus, change.node).recover(change.verb, change.facts, **how)
        finally:
            assert bus.rate == RATE


def is_open(simulation: Simulation) -> bool:
    with motorbus.open(simulation.url) as bus:
        return session.unfinished(bus) is not None


def test_one_that_is_where_it_was_is_locked_and_the_change_taken_back() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        begin(simulation)
        simulation[3].memory["lock"] = 0
        assert end(simulation) == "old"
        assert simulation[3].locked
        assert simulation[3].memory.wear.total() == 0
        assert not is_open(simulation)


def test_one_that_is_there_with_its_lock_open_is_only_locked() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        begin(simulation, "writing 7")
        simulation[3].memory["lock"] = 0
        effects.write(simulation[3], 5, b"\7", 0.0)
        assert end(simulation) == "new"
        assert simulation[7].memory.wear == {5: 1}
        assert simulation[7].locked


def test_one_that_met_a_closed_lock_is_written_again() -> None:
    """It answers under its new id, and would be back under the old one after the next power cycle."""
    with motorbus.simulate("feetech", ids="3") as simulation:
        begin(simulation, "writing 7")
        effects.write(simulation[3], 5, b"\7", 0.0)
        assert end(simulation) == "new"
        simulation[7].power_cycle()
        assert simulation[7].id == 7


def test_an_open_lock_proves_nothing_when_a_recovery_has_opened_it() -> None:
    """It met a closed lock, and the recovery that was about to write it again was cut off behind the unlock."""
    with motorbus.simulate("feetech", ids="3") as simulation:
        begin(simulation, "writing 7", "recovering", "again")
        effects.write(simulation[3], 5, b"\7", 0.0)
        simulation[7].memory["lock"] = 0
        assert end(simulation) == "new"
        simulation[7].power_cycle()
        assert simulation[7].id == 7


@pytest.mark.parametrize(("second", "wear"), [(3, {7: 1}), (7, {}), (255, {7: 1})])
def test_a_second_id_that_has_not_come_along_follows(second: int, wear: dict[int, int]) -> None:
    with motorbus.simulate("feetech", ids="3", model="hls3925") as simulation:
        begin(simulation, "writing 7", "written 7")
        servo = simulation[3]
        servo.memory.stored[5], servo.memory.stored[7] = 7, second
        servo.power_cycle()
        assert end(simulation) == "new"
        assert (servo.second_id, servo.locked, servo.memory.wear) == (7, True, wear)


def test_a_second_id_that_met_a_closed_lock_is_written_again() -> None:
    """It reads right, and would be the old one again after the next power cycle."""
    with motorbus.simulate("feetech", ids="3", model="hls3925") as simulation:
        begin(simulation, "writing 7", "written 7", "second 7")
        servo = simulation[3]
        servo.memory.stored[5] = 7
        servo.power_cycle()
        effects.write(servo, 7, b"\7", 0.0)
        assert end(simulation) == "new"
        servo.power_cycle()
        assert (servo.id, servo.second_id) == (7, 7)


def test_a_second_id_comes_back_with_the_old_id() -> None:
    """Its id was torn after its second id had gone ahead; what may have met a closed lock is written once more."""
    with motorbus.simulate("feetech", ids="3", model="hls3925") as simulation:
        begin(simulation, "writing 7", "written 7", "second 7")
        servo = simulation[3]
        servo.memory.stored[7] = 7
        servo.power_cycle()
        assert end(simulation) == "old"
        servo.power_cycle()
        assert (servo.id, servo.second_id) == (3, 3)


def test_one_as_shipped_gets_its_old_id_back() -> None:
    with motorbus.simulate("feetech", ids="3+9") as simulation:
        begin(simulation, "writing 7", others=[9])
        simulation[3].memory.stored[5] = 0xFF
        simulation[3].power_cycle()
        assert simulation[1].id == 1
        assert end(simulation) == "old"
        assert simulation[3].memory.stored[5] == 3


def test_another_servo_as_shipped_is_left_alone() -> None:
    """It was there before; one that looks just like it and cannot be seen is not looked for in its place."""
    with motorbus.simulate("feetech", ids="3+1") as simulation:
        begin(simulation, "writing 7", others=[1])
        simulation[3].unplug()
        with pytest.raises(NoReply, match="is nowhere"):
            end(simulation)
        assert simulation[1].memory.wear.total() == 0
        assert is_open(simulation)


def test_one_that_has_joined_another_as_shipped_is_said_to_be_there() -> None:
    with motorbus.simulate("feetech", ids="3+1") as simulation:
        begin(simulation, "writing 7", others=[1])
        simulation[1].raw_position = 700
        simulation[3].memory.stored[5] = 0xFF
        simulation[3].power_cycle()
        with pytest.raises(OutcomeUnknown, match="two servos seem to answer as 1") as caught:
            end(simulation)
        assert "connect the one that was to change alone" in caught.value.advice
        simulation.simulator.servos[1].unplug()  # type: ignore[attr-defined]
        assert end(simulation, alone=True) == "old"
        assert simulation[3].locked


def test_two_that_could_be_it_are_both_locked_and_neither_is_chosen() -> None:
    with motorbus.simulate("feetech", ids="3+7") as simulation:
        begin(simulation, "writing 7")
        simulation[3].memory["lock"] = simulation[7].memory["lock"] = 0
        with pytest.raises(OutcomeUnknown, match="which of them"):
            end(simulation)
        assert simulation[3].locked
        assert simulation[7].locked
        assert is_open(simulation)
        simulation[7].unplug()
        assert end(simulation) == "old"


@pytest.mark.parametrize("model", ["sts3215+scs0009", "sts3215+hls3925"])
def test_one_of_another_kind_is_somebody_else(model: str) -> None:
    with motorbus.simulate("feetech", ids="3+7", model=model) as simulation:
        begin(simulation, "writing 7")
        assert end(simulation) == "old"
        assert simulation[7].memory.wear.total() == 0


def test_one_with_other_settings_is_somebody_else_when_the_very_one_is_there() -> None:
    with motorbus.simulate("feetech", ids="3+7") as simulation:
        begin(simulation, "writing 7")
        simulation[7].memory["max_temperature"] = 60
        assert end(simulation) == "old"


def test_two_with_one_id_are_noticed() -> None:
    with motorbus.simulate("feetech", ids=(3, 3)) as simulation:
        begin(simulation)
        simulation.simulator.servos[1].memory["max_temperature"] = 60  # type: ignore[attr-defined]
        with pytest.raises(OutcomeUnknown, match="two servos seem to answer as 3"):
            end(simulation)


def test_a_rate_is_found_at_any_of_the_twelve() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        begin(simulation, "writing 1", verb=SET_BAUD)
        simulation[3].memory["baud_rate"] = simulation[3].memory.stored[6] = 7
        assert end(simulation) == "old"
        assert (simulation[3].baud_rate, simulation[3].memory.stored[6]) == (RATE, 0)


def test_a_rate_that_the_link_lacks_is_no_place_to_look(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        begin(simulation, "writing 1", verb=SET_BAUD)
        simulation[3].memory["baud_rate"] = simulation[3].memory.stored[6] = 7
        with motorbus.open(simulation.url) as bus:
            tune = bus.link.tune

            def unable(rate: int, listen_only: bool = False) -> None:
                if rate in (128_000, 76_800):
                    raise LinkError("not this one")
                tune(rate, listen_only)

            monkeypatch.setattr(bus.link, "tune", unable)
            change = session.unfinished(bus)
            assert change is not None
            assert bus.run(recover(Node(3), change.verb, change.facts)) == "old"


def test_it_is_found_by_facts_alone() -> None:
    """Without a journal, from what somebody has kept elsewhere: what is recorded then is its own course."""
    with motorbus.simulate("feetech", ids="3") as simulation:
        begin(simulation)
        with motorbus.open(simulation.url) as bus:
            change = session.unfinished(bus)
            assert change is not None
        with motorbus.simulate("feetech", ids="3") as other, motorbus.open(other.url) as bus:
            assert motorbus.feetech.Servo(bus, 3).recover(change.verb, change.facts) == "old"
            assert session.unfinished(bus) is None


def test_facts_of_something_else_are_refused_and_nothing_is_sent() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        with pytest.raises(RequestError, match="not the facts"):
            motorbus.feetech.Servo(bus, 3).recover(SET_ID, {"node": 3})
        assert 3 not in bus.statistics.nodes


@pytest.mark.parametrize("id", [1, 7])
def test_one_at_another_rate_is_somebody_else_when_an_id_was_changed(id: int) -> None:
    """Its rate is not touched by that, so it is not looked for at any other."""
    with motorbus.simulate("feetech", ids=f"3+{id}") as simulation:
        begin(simulation, "writing 7")
        other = simulation[id]
        other.memory["baud_rate"] = other.memory.stored[6] = 4
        simulation[3].unplug()
        with pytest.raises(NoReply, match="is nowhere"):
            end(simulation)
        assert (other.id, other.memory.wear.total()) == (id, 0)


def test_an_hls_servo_whose_second_id_would_follow_is_found_before_anything_is_written() -> None:
    with motorbus.simulate("feetech", ids="3+9", model="sts3215+hls3925") as simulation:
        begin(simulation, "writing 7", others=[9])
        simulation[9].memory["second_id"] = 1
        servo = simulation[3]
        servo.memory.stored[5] = 0xFF
        servo.power_cycle()
        with pytest.raises(RequestError, match="servo 9 has 1 as its second id"):
            end(simulation)
        assert (servo.id, simulation[9].id) == (1, 9)
        assert is_open(simulation)
        effects.write(simulation[9], 7, b"\x09", 0.0)
        assert end(simulation) == "old"
        assert (servo.id, simulation[9].id) == (3, 9)


def test_facts_on_a_bus_whose_journal_is_closed_are_kept_there_whole() -> None:
    """What fails there can be said again, and what was reached before is not forgotten."""
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.simulate("feetech", ids="4") as other:
        begin(simulation, "writing 7")
        with motorbus.open(simulation.url) as bus:
            change = session.unfinished(bus)
            assert change is not None
        with motorbus.open(other.url) as bus:
            with pytest.raises(NoReply):
                motorbus.feetech.Servo(bus, 3).recover(change.verb, change.facts)
            kept = session.unfinished(bus)
            assert kept is not None
            assert kept.facts == {**change.facts, "reached": [INTENT, "writing 7", "recovering"]}
        with pytest.raises(NoReply):
            end(other)


UNREACHABLE = {"torn": "erased", "torn_identity": "unreachable"}


def tear(simulation: Simulation, cell: int) -> Any:
    """The first servo restarts with an id or rate that was half written."""
    servo = simulation.simulator.servos[0]  # type: ignore[attr-defined]
    servo.memory.stored[cell] = 0xFF
    servo.power_cycle()
    return servo


@pytest.mark.parametrize(("verb", "cell"), [(SET_ID, 5), (SET_BAUD, 6)])
def test_recover_raises_for_servo_that_answers_nowhere(verb: str, cell: int) -> None:
    with motorbus.simulate("feetech", ids="3+9", **UNREACHABLE) as simulation:
        begin(simulation, "writing 7", verb=verb, others=[9])
        tear(simulation, cell)
        with pytest.raises(NoReply, match="is nowhere") as caught:
            end(simulation)
        assert ("by broadcast" in caught.value.advice) is (verb == SET_ID)
        assert is_open(simulation)


def test_recover_gives_servo_without_id_its_old_id_when_it_is_alone() -> None:
    with motorbus.simulate("feetech", ids="3+9", **UNREACHABLE) as simulation:
        begin(simulation, "writing 7", others=[9])
        servo = tear(simulation, 5)
        assert servo.id == 0xFF
        with pytest.raises(RequestError, match="the servo is not alone: "):
            end(simulation, alone=True)
        simulation[9].unplug()
        assert end(simulation, alone=True) == "old"
        servo.power_cycle()
        assert (servo.id, servo.locked) == (3, True)
