"""A REG WRITE that waits is not carried out by an ACTION that comes after a stop of its servo."""

from __future__ import annotations

import pytest

import motorbus
from motorbus import RequestError
from motorbus.families.feetech import Servo


@pytest.mark.xfail(strict=True, reason="rebuild of feetech: ACTION is refused after a stop")
def test_action_after_a_stop_is_refused_and_moves_nothing() -> None:
    with motorbus.simulate("feetech", position=1800) as simulation, motorbus.open(simulation.url) as bus:
        servo = Servo(bus, 1)
        servo.enable_torque()
        servo.reg_write(goal_position=2.5)
        servo.stop()
        held = servo.position()
        with pytest.raises(RequestError):
            servo.action()
        simulation.wait(simulation.now + 2.0)
        assert servo.position() == pytest.approx(held, abs=0.01)
