"""A picture of a servo has in each row just what a host reads at that moment, moving or not, on every map."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.simulator import MODELS, simulate
from motorbus.families.feetech.simulator.feedback import FEEDBACK, read


@pytest.mark.parametrize("model", sorted(MODELS)[::4])
def test_it_shows_what_is_read(model: str) -> None:
    bus = simulate((1,), model)
    (servo,) = bus.servos
    servo.memory["torque_enable"] = 1
    for at, goal in enumerate((100, 900, 500), start=1):
        servo.memory["goal_position"] = goal
        bus.advance(float(at))
        servo.move(float(at))
        for later in (0.0, 0.05, 0.9):
            ((node, picture),) = bus.sight(at + later)
            assert node == 1
            for row in servo.memory.layout.table.values():
                told = row.decode(read(servo, row.address, row.size, at + later))
                assert bus.shown(picture, row.name) == told, row.name


def test_the_picture_of_a_servo_at_rest_is_the_same_until_something_changes() -> None:
    bus = simulate((1,))
    (servo,) = bus.servos

    def picture(at: float) -> object:
        ((_, seen),) = bus.sight(at)
        return seen

    first = picture(1.0)
    assert picture(2.0) is first
    for change in ("raw_position", "voltage", "temperature", "alarm", "pending"):
        setattr(servo, change, (41, b"\1") if change == "pending" else 4)
        assert picture(2.0) != first, change
        first = picture(2.0)
    assert set(FEEDBACK) >= {"present_position", "present_voltage"}
