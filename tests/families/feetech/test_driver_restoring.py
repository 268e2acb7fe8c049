"""Back to the factory's values: torque off first, then the order, then looked for wherever it may be now."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.core.operation import Effect, Rank, Timeout
from motorbus.errors import NoReply, OutcomeUnknown
from motorbus.families.feetech.driver import factory_restore
from motorbus.families.feetech.driver.restoring import DEAF
from motorbus.simulation.named import Simulation
from tests.families.feetech.driver_script import Line, packet, play, prepared, reads, unheard, watch, writes

OFF = writes(3, 40, 0)
RESET = Line(packet(3, 6), packet(3, 0))
HEAD = reads(3, 0, 3, 10, 0, 9, 3)


def ping(id: int) -> Line:
    return Line(packet(id, 1), packet(id, 0))


NOBODY = unheard(ping(1))
WHOLE = (NOBODY, OFF, RESET, ping(3), NOBODY, NOBODY, HEAD)


def test_torque_goes_off_and_nobody_else_is_on_the_bus() -> None:
    played = watch(factory_restore(prepared()), *WHOLE)
    assert played.alone == 1
    assert played.exchanges[2].effect is Effect.PERSISTENT
    assert played.exchanges[2].rank is Rank.CONFIGURATION
    assert played.exchanges[2].timeout is Timeout.STORE
    assert not played.exchanges[2].repeatable


def test_it_is_told_where_it_is_now() -> None:
    found = play(factory_restore(prepared()), *WHOLE)
    assert found.node == 3
    assert found.identity is not None


def test_what_was_known_of_it_is_forgotten() -> None:
    node = prepared()
    play(factory_restore(node), *WHOLE)
    assert node.settings is None


def test_without_an_acknowledgement_the_outcome_is_unknown() -> None:
    lines = (NOBODY, OFF, unheard(RESET), *WHOLE[3:])
    with pytest.raises(OutcomeUnknown, match="has not acknowledged"):
        play(factory_restore(prepared()), *lines)


def test_one_that_does_not_come_back_is_told() -> None:
    lines = (NOBODY, OFF, RESET, *(unheard(ping(id)) for id in (3, 1, 3, 1)))
    with pytest.raises(NoReply, match="does not answer after"):
        play(factory_restore(prepared()), *lines)


def test_another_servo_with_the_id_as_shipped_is_not_taken_for_it() -> None:
    found = play(factory_restore(prepared()), ping(1), OFF, RESET, ping(3), HEAD)
    assert found.node == 3
    with pytest.raises(NoReply, match="the id of another servo"):
        play(factory_restore(prepared()), ping(1), OFF, RESET, unheard(ping(3)), unheard(ping(3)))


def restored(simulation: Simulation) -> tuple[int, int]:
    with motorbus.open(simulation.url) as bus:
        servo = motorbus.feetech.Servo(bus, 3)
        servo.write(max_temperature=60)
        began = bus.link.now()
        found = servo.factory_restore()
        assert bus.link.now() - began > DEAF
    return found.node, simulation[found.node].memory["max_temperature"]


def test_a_simulated_servo_is_as_shipped_and_keeps_its_id() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        assert restored(simulation) == (3, 70)


def test_one_that_forgets_its_id_is_found_as_1() -> None:
    with motorbus.simulate("feetech", ids="3", restore_id="default") as simulation:
        assert restored(simulation) == (1, 70)


def test_a_model_without_it_leaves_the_outcome_open() -> None:
    with (
        motorbus.simulate("feetech", ids="3", factory_restore="no") as simulation,
        pytest.raises(OutcomeUnknown),
    ):
        restored(simulation)
