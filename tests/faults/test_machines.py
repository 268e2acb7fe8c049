"""Anything called in any order while anything goes wrong: nothing told is false, nothing hangs, nothing stays behind.

`machine.py` says what is asserted and what is left out. A failure prints the steps and the faults as a script.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any

import pytest
from hypothesis import settings
from hypothesis.stateful import run_state_machine_as_test

from motorbus.errors import MotorbusError
from tests.conftest import Figures
from tests.faults.machine import Machine, walk
from tests.faults.machine_feetech import FeetechRig, FeetechSteps
from tests.faults.machine_kst import KstRig, KstSteps
from tests.faults.machine_stepper import StepperRig, StepperSteps

MACHINES = {"feetech": FeetechSteps, "kst": KstSteps, "stepper": StepperSteps}
RIGS: dict[str, Callable[[], Any]] = {"feetech": FeetechRig, "kst": KstRig, "stepper": StepperRig}
SHORT = settings(max_examples=20, stateful_step_count=40)
FEW = 1_200
"""Exchanges of a walk in which faults of nearly every kind strike."""


@pytest.mark.parametrize("family", MACHINES)
def test_whatever_is_called_and_whatever_strikes(family: str) -> None:
    machine: type[Machine] = MACHINES[family]
    before = machine.fired
    run_state_machine_as_test(machine, settings=SHORT)
    assert machine.fired > before


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("family", RIGS)
def test_a_long_walk_among_faults(family: str, rounds: Callable[[int], int], figures: Figures) -> None:
    total = rounds(1_000_000)
    rig, began = RIGS[family](), time.process_time()
    walk(rig, 7, total if total > 100_000 else FEW, often=0.05)
    fired = rig.line.count
    assert fired > rig.line.exchange / 100
    assert rig.untouched > rig.line.exchange / 20
    assert rig.oracle.judged > rig.line.exchange / 20
    figures(
        "L1-L11, L15, D3 stateful machine, every verb among faults of every kind",
        family=family,
        seed=7,
        exchanges=rig.line.exchange,
        calls=sum(rig.calls.values()),
        judged=rig.oracle.judged,
        faults=fired,
        untouched=rig.untouched,
        longest_s=round(rig.oracle.longest, 3),
        processor_s=round(time.process_time() - began),
        **{f"failed_{says.value.replace(' ', '_')}": count for says, count in rig.oracle.failed.items()},
    )


def test_a_walk_among_faults_where_a_line_takes_no_time() -> None:
    """What comes sooner than bits can travel is no sign there, so an echo must be told from an answer by itself."""
    rig = StepperRig(pace=False)
    walk(rig, 7, FEW // 2, often=0.2)
    assert rig.line.count > FEW / 50
    assert rig.oracle.judged > FEW / 20


def test_a_controller_that_has_still_to_answer_has_not_been_left_alone() -> None:
    """It deals with the copy of a request behind the first one, and what it says then comes in the next call."""
    rig = StepperRig()
    rig.line.extend(f"exchange {rig.line.exchange + 1} to device: duplicate")
    rig.call("set an output", 1)
    assert rig.troubled
    rig.rest()
    assert not rig.troubled


@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_two_devices_with_one_id_take_nothing_from_the_others(family: str) -> None:
    """What the two say together is nobody's word; every other device is as right as before, among their answers."""
    rig = RIGS[family]()
    doubled, random = min(rig.history.nodes), Random(7)
    rig.line.extend(f"exchange {rig.line.exchange + 1}: duplicate-id {doubled}")
    rig.spend()
    assert rig.line.counts["duplicate-id"] == 1
    others = {node: servo for node, servo in rig.servos.items() if node != doubled}
    for _ in range(60):
        rig.stir(random)
        with suppress(MotorbusError):
            rig.servos[doubled].position()
        node = random.choice([*others])
        with rig.oracle.call(rig.bound) as window:
            value = others[node].position()
        assert window.error is None
        rig.oracle.told(
            window, node, "present_position", others[node].raw(others[node].table["present_position"], value)
        )
    rig.sound()


@pytest.mark.parametrize("family", RIGS)
def test_every_fault_of_a_machine_fires(family: str) -> None:
    """One after the other, in the place where it strikes; nothing of what is listed is a word without a deed."""
    rig = RIGS[family]()
    for name in rig.faults:
        fired = rig.line.count
        for lot in range(40):
            rig.strike(name, lot)
            rig.spend()
            if rig.line.count > fired:
                break
        assert rig.line.count > fired, name
        rig.rest()


def test_a_value_that_is_old_is_found_out() -> None:
    """The judge itself: what the servo held before the call, and holds no more, is no answer."""
    rig = FeetechRig()
    servo = rig.simulator.servos[0]
    servo.raw_position = 1000
    with rig.oracle.call() as before:
        pass
    rig.oracle.told(before, 1, "present_position", 1000)
    servo.raw_position = 1001
    with rig.oracle.call() as after:
        rig.servos[1].position()
    with pytest.raises(AssertionError, match="was told to be 1000"):
        rig.oracle.told(after, 1, "present_position", 1000)
