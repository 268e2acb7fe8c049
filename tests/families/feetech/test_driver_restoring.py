"""Back to the factory's values: torque off first, then the order, then looked for wherever it may be now."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.core.request import Effect, Priority, TimeoutClass
from motorbus.errors import ChecksumError, NoReply, OutcomeUnknown
from motorbus.families.feetech.driver import factory_restore
from motorbus.families.feetech.driver.restoring import DEAF, factory_rates
from motorbus.families.feetech.table import TABLES
from motorbus.simulation.named import Simulation
from tests.families.feetech.driver_script import (
    Line,
    Played,
    packet,
    play,
    prepared,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import met, simulated

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
    assert played.requests[2].effect is Effect.PERSISTENT
    assert played.requests[2].priority is Priority.CONFIGURATION
    assert played.requests[2].reply_within is TimeoutClass.STORE
    assert not played.requests[2].repeatable


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
    with pytest.raises(NoReply, match="the place of another servo"):
        play(factory_restore(prepared()), ping(1), OFF, RESET, unheard(ping(3)), unheard(ping(3)))


# -- at other rates and in other maps ------------------------------------------------------------------------


def test_it_is_looked_for_at_the_rate_its_series_ships_with() -> None:
    assert [factory_rates(TABLES[name]) for name in ("sts", "hls", "smbl", "smcl", "scs", "scs2")] == [
        *((1_000_000,), (1_000_000,), (115_200,), (115_200,)),
        *((1_000_000, 500_000), (1_000_000, 500_000)),
    ]


def test_who_is_there_at_the_other_rate_is_asked_beforehand() -> None:
    """SMS ship with 115200: whoever stands there already, with the same id or with 1, must not be taken for it."""
    off = Line(packet(3, 3, 40, 0), packet(3, 0))
    played = Played(
        [
            *(NOBODY, unheard(ping(3)), ping(1)),  # at 1 Mbaud, then twice at 115200
            *(off, RESET, unheard(ping(3)), NOBODY, unheard(ping(3)), NOBODY),
            *(ping(3), reads(3, 0, 2, 45, 0, 8, 44)),
        ]
    )
    found = played.run(factory_restore(met("smbl")))
    assert played.script == []
    assert (found.node, found.rate) == (3, 115_200)
    assert played.rates == [115_200, 1_000_000, 115_200, 1_000_000]


def test_garbled_answers_count_as_somebody() -> None:
    noise = Line(ping(1).sent, ChecksumError("two at once"))
    found = play(factory_restore(prepared()), noise, OFF, RESET, ping(3), HEAD)
    assert found.node == 3


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("restore_id", ["keep", "default"])
def test_a_simulated_servo_of_every_map_is_as_shipped_and_found(name: str, restore_id: str) -> None:
    with simulated(name, restore_id=restore_id) as (real, servo):
        shipped = real.memory["max_temperature"]
        servo.write(max_temperature=60)
        found = servo.factory_restore()
        assert found.node == real.id == (3 if restore_id == "keep" else 1)
        assert found.identity is not None
        assert real.memory["max_temperature"] == shipped
        assert real.memory["torque_enable"] == 0


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
