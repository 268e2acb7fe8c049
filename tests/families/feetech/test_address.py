"""Another id or rate: the requests, what is refused, and recovery; every cut is in tests/conformance/test_cuts.py."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from motorbus.core.family import IdChanged
from motorbus.core.steps import INTENT, OUTCOME, JournalEntry
from motorbus.errors import MotorbusError, NoReply, RequestError
from motorbus.families.feetech import FAMILY, Servo
from motorbus.families.feetech.registers import TABLES
from tests.conformance.cuts import Call, Command, violations
from tests.families.feetech.worlds import MODELS, RATES, later, traffic, world, writes
from tests.support.catalogue.cuts import feetech_address, feetech_contents


@pytest.mark.parametrize("name", TABLES)
def test_set_id_moves_the_servo_for_good(name: str) -> None:
    with world(name, ids="1,3") as (bus, servo, _):
        found = servo.set_id(7)
        assert (found.node, found.rate, found.identity.node) == (7, RATES.get(name, 1_000_000), 7)
        renamed = Servo(bus, 7)
        assert renamed.read("id", "lock") == {"id": 7, "lock": 1}
        assert not servo.ping()
        assert Servo(bus, 3).ping()


def test_set_id_takes_few_requests() -> None:
    with world() as (bus, servo, _):
        servo.prepare()
        with traffic(bus) as sent:
            servo.set_id(7)
        asked = [one for one in sent if one != "01 04 02 00 28"]  # the reads that show a second servo
        assert len(sent) - len(asked) == 12
        assert writes(asked) == ["01 04 03 37 00", "01 04 03 28 00", "01 04 03 05 07", "07 04 03 37 01"]
        assert len(asked) <= 12


def test_set_id_journals_before_the_first_write_and_after_the_last() -> None:
    with world() as (bus, servo, _):
        events: list[Any] = []
        bus.run(Servo.set_id.function(servo, 7), report=events.append)
        assert IdChanged(1, 7) in events
        states = [one.state for one in events if isinstance(one, JournalEntry)]
        assert states[-2:] in ([INTENT, OUTCOME], [])  # a bus may take journal entries for itself


def test_the_second_id_of_an_hls_follows() -> None:
    with world("hls") as (bus, servo, simulation):
        simulation[1].memory["second_id"] = 1
        servo.set_id(7)
        assert Servo(bus, 7).read("second_id") == {"second_id": 7}


def test_the_same_id_only_closes_the_lock() -> None:
    with world() as (bus, servo, simulation):
        servo.prepare()
        simulation[1].memory["lock"] = 0
        with traffic(bus) as sent:
            servo.set_id(1)
        assert writes(sent) == ["01 04 03 37 01"]


@pytest.mark.parametrize(
    ("method", "value"),
    [("set_id", 3), ("set_id", 254), ("set_id", -1), ("set_baud", 1234), ("set_baud", 4_800)],
)
def test_what_is_impossible_is_refused_and_nothing_written(method: str, value: int) -> None:
    with world(ids="1,3") as (bus, servo, _):
        servo.prepare()
        with traffic(bus) as sent, pytest.raises(RequestError):
            getattr(servo, method)(value)
        assert writes(sent) == []


def test_two_servos_with_one_id_are_not_renamed() -> None:
    with world() as (bus, servo, simulation):
        servo.prepare()
        simulation.simulator.duplicate(1)
        with traffic(bus) as sent, pytest.raises(MotorbusError):
            servo.set_id(7)
        assert writes(sent) == []


@pytest.mark.parametrize("name", TABLES)
def test_set_baud_moves_the_servo_and_leaves_the_bus(name: str) -> None:
    with world(name) as (bus, servo, simulation):
        found = servo.set_baud(500_000)
        assert (found.node, found.rate) == (1, 500_000)
        assert bus.rate == RATES.get(name, 1_000_000)
        assert not servo.ping()
        simulation[1].power_cycle()
        later(bus, 1.0)
        assert [one.rate for one in bus.run(bus.driver.scan((1,), (500_000, 1_000_000)))] == [500_000]


@pytest.mark.parametrize(
    "facts",
    [{}, {"node": 1}, {"node": 1, "rate": 1, "new": 2, "new_rate": 1, "registers": "00", "taken": []}],
)
def test_recover_refuses_other_facts(facts: dict[str, Any]) -> None:
    with world() as (bus, servo, _), traffic(bus) as sent:
        with pytest.raises(RequestError):
            servo.recover("set_id", facts)
        assert sent == []


def test_recover_says_where_to_look_when_the_servo_is_at_no_address() -> None:
    with world() as (_, servo, simulation):
        image = bytes(simulation[1].memory.stored[:40]).hex()
        facts = {
            "node": 1,
            "rate": 1_000_000,
            "new": 7,
            "new_rate": 1_000_000,
            "registers": image,
            "taken": [],
        }
        simulation[1].unplug()
        with pytest.raises(NoReply, match="neither"):
            servo.recover("set_id", facts)


@pytest.mark.parametrize(("method", "value"), [("set_id", 7), ("set_baud", 500_000)])
@pytest.mark.parametrize("name", ["sts", "hls"])
def test_a_change_that_is_cut_off_is_ended_by_the_next_host(name: str, method: str, value: int) -> None:
    """A choice of cuts, on this pair of driver and simulator."""
    rows = [row.name for row in TABLES[name].values() if row.storage.name == "EEPROM"]
    command = Command(
        name=f"{name}-{method}",
        subject=replace(FAMILY, registers={name: TABLES[name]}),
        ids=(3, 9),
        call=Call(method, (value,)),
        state=lambda device: [device.memory[row] for row in (*rows, "lock")],
        address=feetech_address,
        contents=feetech_contents,
        quirks={"model": MODELS[name]},
        journalled=True,
    )
    for cut in command.single_cuts()[::4]:
        assert violations(command, cut, then=True) == [], cut
