"""How a servo fares: one READ of registers 40 to 70, in every map."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.family import Health
from motorbus.core.request import Request
from motorbus.families.feetech.driver import Node, health
from motorbus.families.feetech.driver.health import WHOLE
from tests.families.feetech.driver_script import play, prepared, prepares, reads
from tests.families.feetech.maps import MODELS, simulated

FEEDBACK = (0x18, 0x05, 0xE8, 0x83, 0x64, 0x04, 121, 42, 0, 0x20, 1, 0, 8, 0x0A, 0x80)


def block(torque: int, acceleration: int = 0, velocity: int = 0) -> tuple[int, ...]:
    """Registers 40 to 70 of an STS servo."""
    told = (torque, acceleration, 0, 8, 0, 0, velocity & 0xFF, velocity >> 8, 0xE8, 3, 0, 0, 0, 0, 0, 1)
    return (*told, *FEEDBACK)


def test_one_read_tells_the_torque_switch_and_everything_it_feels() -> None:
    assert WHOLE == len(block(1)) == 31
    node = prepared()
    found = play(health(node), reads(3, 40, *block(1, velocity=1000), error=0x20))
    assert isinstance(found, Health)
    assert (found.torque, found.blank, found.restarts) == (True, False, None)
    state = found.state
    assert [state.load, state.voltage, state.temperature] == pytest.approx([-0.1, 12.1, 42])
    assert (state.moving, state.alarm, state.at) == (True, ("overload",), node.at)


@pytest.mark.parametrize(("raw", "on"), [(0, False), (1, True), (2, False), (128, False)])
def test_only_1_is_torque(raw: int, on: bool) -> None:
    assert play(health(prepared()), reads(3, 40, *block(raw))).torque is on


@pytest.mark.parametrize(
    ("told", "blank"), [({}, True), ({"velocity": 1}, False), ({"acceleration": 5}, False)]
)
def test_it_is_blank_with_what_it_powers_up_with(told: dict[str, Any], blank: bool) -> None:
    assert play(health(prepared()), reads(3, 40, *block(1, **told))).blank is blank


def test_of_a_known_servo_it_is_one_exchange_and_a_new_one_is_asked_first() -> None:
    request = health(prepared())
    assert isinstance(request, Request)
    assert not request.reports_position  # the position is not at its beginning
    for _ in range(2):
        play(request, reads(3, 40, *block(1)))
    assert play(health(Node(3)), prepares(), reads(3, 40, *block(1))).torque is True


@pytest.mark.parametrize("name", MODELS)
def test_in_every_map_torque_and_a_restart_show(name: str) -> None:
    with simulated(name) as (sim, servo):
        first = servo.bus.run(health(servo))
        assert (first.torque, first.blank) == (False, True)
        assert first.state.voltage is not None
        assert first.state.temperature is not None
        servo.enable_torque()
        servo.move(servo.position() + 0.05, velocity=0.5)
        found = servo.bus.run(health(servo))
        assert (found.torque, found.blank) == (True, False)
        sim.power_cycle()
        after = servo.bus.run(health(servo))
        assert (after.torque, after.blank) == (False, True)
