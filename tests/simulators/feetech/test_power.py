"""What a power-up loads, and what it forgets, in every map."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.simulator.power import LOADED
from motorbus.families.feetech.table import TABLES
from tests.simulators.feetech.host import REG_WRITE, packet
from tests.simulators.feetech.test_maps import LOCK, host_of

PAIRS = [(name, row, source) for name in TABLES for row, source in LOADED.items() if row in TABLES[name]]


def test_these_are_the_maps_that_load() -> None:
    loads = {name: {row for other, row, _ in PAIRS if other == name} for name in TABLES}
    assert loads == {
        "sts": {"torque_limit"},
        "smbl": {"torque_limit"},
        "smcl": set(),
        "scs": set(),
        "scs2": set(),
        "hls": {"torque_limit", "goal_torque", "live_p", "live_d", "live_i"},
    }


@pytest.mark.parametrize(("name", "row", "source"), PAIRS)
def test_a_register_is_loaded_from_another_at_power_up_and_not_before(
    name: str, row: str, source: str
) -> None:
    host = host_of(name)
    servo, table = host.bus.nodes[1], TABLES[name]
    assert servo.memory[row] == servo.memory[source]
    wanted = table[source].high // 3
    host.write(1, LOCK[name], 0)
    host.write(1, table[source].address, *table[source].encode(wanted))
    assert servo.memory[row] != wanted
    host.wait(1.0)
    servo.power_cycle()
    assert servo.memory[row] == wanted


@pytest.mark.parametrize("name", TABLES)
def test_a_power_cycle_forgets_goal_torque_and_what_was_pending(name: str) -> None:
    host = host_of(name)
    servo = host.bus.nodes[1]
    host.say(packet(1, REG_WRITE, 42, 1, 2))
    host.write(1, 42, 0, 9)
    host.write(1, 40, 1)
    assert host.read(1, 64, 1) == 1
    servo.power_cycle()
    assert (host.read(1, 64, 1), host.read(1, 42), host.read(1, 40, 1)) == (0, 0, 0)


@pytest.mark.parametrize("name", TABLES)
def test_switches_of_power_up_hold_for_every_map(name: str) -> None:
    host = host_of(name, torque_at_power_up="yes", lock_at_power_up="no", position=300)
    servo = host.bus.nodes[1]
    assert (servo.memory["torque_enable"], servo.locked, servo.memory["goal_position"]) == (1, False, 300)
    assert host.wait(2.0).bus.nodes[1].raw_position == 300
