"""The feedback registers, one by one, against figures worked out by hand."""

from __future__ import annotations

import pytest

from tests.simulators.feetech.host import READ, Host, packet, word


def test_telemetry_at_rest_in_one_read() -> None:
    # position 2048, velocity 0, load 0, 7.4 V, 30 °C, none pending, no alarm, at rest, goal 0, current 0
    assert Host().say(packet(1, READ, 56, 15)) == [
        "FF FF 01 11 00 00 08 00 00 00 00 4A 1E 00 00 00 00 00 00 00 7D"
    ]


def test_telemetry_on_the_way() -> None:
    host = Host(position=0)
    host.write(1, 42, *word(4000), 0, 0, *word(1700))
    host.wait(1.0)
    assert host.read(1, 58) == 1700
    assert host.read(1, 60) == 500  # half of what it could do without load
    assert host.read(1, 66, 1) == 1
    assert host.read(1, 67) == 4000
    assert host.read(1, 69) == 23  # 150 mA in 6.5 mA


def test_signs_are_bit_15_and_for_load_bit_10() -> None:
    host = Host(position=4000)
    host.write(1, 42, *word(0), 0, 0, *word(1700))
    host.wait(1.0)
    assert host.read(1, 58) == 1700 | 0x8000
    assert host.read(1, 60) == 500 | 0x0400
    assert host.read(1, 69) == 23 | 0x8000


@pytest.mark.parametrize(("torque", "load", "current"), [(0.2, 200, 100), (-0.2, 200 | 0x0400, 100 | 0x8000)])
def test_holding_a_burden_shows_in_load_and_current(torque: float, load: int, current: int) -> None:
    host = Host(goal_at_power_up="present")
    host.write(1, 40, 1)
    host.bus.nodes[1].torque = torque  # of 3.25 A at stall
    assert (host.read(1, 60), host.read(1, 69)) == (load, current)


def test_a_limp_servo_carries_nothing() -> None:
    host = Host()
    host.bus.nodes[1].torque = 0.5
    assert (host.read(1, 60), host.read(1, 69)) == (0, 0)


def test_phase_bit_5_means_no_current_feedback() -> None:
    host = Host(goal_at_power_up="present")
    host.write(1, 40, 1)
    host.bus.nodes[1].torque = 0.5
    host.write(1, 18, 12 + 32)
    assert (host.read(1, 60), host.read(1, 69)) == (500, 0)
