"""Who is at fault, who clears it, and whom a change that was cut off has left in doubt."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import motorbus
from motorbus.bus.base import BaseBus
from motorbus.core.steps import INTENT, OUTCOME, READABLE, JournalEntry
from motorbus.errors import Refused
from motorbus.motion.machine import Machine
from motorbus.motion.safety import restarts
from motorbus.session.robot import AsyncRobot, Robot
from motorbus.simulation.named import Simulation
from tests.support.machines import listened, machine, said

CHANGE = {"node": 2, "new": 3}


def noted(bus: BaseBus, event: JournalEntry) -> None:
    """It stands in the journal of this bus."""
    assert bus.journal is not None
    bus.journal(event)


@contextmanager
def cut_off(**facts: object) -> Iterator[tuple[Machine, dict[str, Simulation]]]:
    """A machine of four servos, on whose bus the change of the second one was cut off."""
    with machine(arm="1-4") as (made, sims):
        with motorbus.open(sims["arm"].url) as bus:
            noted(bus, JournalEntry("set_id", INTENT, {**CHANGE, **facts}))
        yield made, sims


def test_a_device_whose_change_was_cut_off_is_untrusted_by_either_id_until_recover_has_ended_it() -> None:
    with cut_off() as (made, sims):
        with Robot.of(made) as robot:
            assert set(robot.faults) == {"a2", "a3"}
            assert robot.faults["a2"].startswith("untrusted: set_id() of arm#2 is unfinished")
            assert "motorbus recover feetech:sim" in robot.faults["a2"]
            listened(sims)
            for name in ("a2", "a3"):
                with pytest.raises(Refused, match=f"{name} is at fault: untrusted") as refused:
                    robot.move({name: 0.2, "a1": 0.2})
                assert refused.value.reason == "fault"
                with pytest.raises(Refused, match="untrusted"):
                    robot[name].enable_torque()
                with pytest.raises(Refused, match="is untrusted: .*recover"):
                    robot.clear_fault(name)
            assert said(sims) == []
            assert robot["a2"].stop() is not None
            robot.disable_torque()
            robot.move({"a1": 0.2, "a4": 0.2})
        with motorbus.open(sims["arm"].url) as bus:
            noted(bus, JournalEntry("set_id", OUTCOME, {"outcome": "taken back"}))
        with Robot.of(made) as robot:
            assert robot.faults == {}
            robot.move({"a2": 0.2})


def test_it_can_be_cleared_where_the_change_has_ended_meanwhile() -> None:
    with cut_off() as (made, _), Robot.of(made) as robot:
        noted(robot.buses["arm"], JournalEntry("set_id", OUTCOME, {"outcome": "taken back"}))
        robot.clear_fault(["a2", "a3"])
        assert robot.faults == {}


def test_what_leaves_readings_true_leaves_trust() -> None:
    with cut_off(**{READABLE: True}) as (made, _), Robot.of(made) as robot:
        assert robot.faults == {}


def test_opening_a_machine_in_doubt_sends_nothing_but_questions_and_leaving_it_neither() -> None:
    with cut_off() as (made, sims):
        listened(sims)
        with Robot.of(made):
            pass
        assert said(sims)
        assert not [one for one in said(sims) if "WRITE" in one]


def test_an_async_robot_has_the_same_doubt() -> None:
    async def run() -> set[str]:
        with cut_off() as (made, _):
            async with AsyncRobot.of(made) as robot:
                return set(robot.faults)

    assert asyncio.run(run()) == {"a2", "a3"}


def test_one_that_cannot_be_cleared_keeps_all_from_being_cleared() -> None:
    with cut_off() as (made, _), Robot.of(made) as robot:
        restarts.fault(robot["a1"], "it was seen to smoke")
        with pytest.raises(Refused, match="nothing was cleared"):
            robot.clear_fault()
        assert set(robot.faults) == {"a1", "a2", "a3"}
        robot.clear_fault("a1")
        assert set(robot.faults) == {"a2", "a3"}
