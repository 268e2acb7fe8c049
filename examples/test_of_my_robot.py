"""A test of your own code without hardware: a simulated arm on a virtual clock, and a servo that dies."""

from __future__ import annotations

import pytest

import motorbus


def test_arm_survives_a_dead_servo() -> None:
    with motorbus.simulate("feetech", ids="1-6") as arm, motorbus.open(arm.url) as bus:
        arm[3].unplug()
        with pytest.raises(motorbus.NoReply):
            motorbus.feetech.Servo(bus, 3).position()
        assert motorbus.feetech.Servo(bus, 4).ping()
