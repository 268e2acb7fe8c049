"""Whatever is done to some servos in whatever order: time goes on, bounds hold, the same seed gives the same film."""

from __future__ import annotations

from math import isfinite
from random import Random

import pytest

from motorbus.families.feetech.simulator.servo import Servo
from tests.simulators.feetech.host import ALL, READ, RESTORE, SYNC_WRITE, Host, packet, word

MODELS = "sts3215+scs0009+hls3930+sm40blhv+sm60-360m"
OPTIONS: tuple[dict[str, object], ...] = (
    {},
    {
        "overpowered": "yields",
        "overload_clears": "torque_off",
        "overload_of": "duty",
        "backlash": 8,
        "droop": 50,
    },
    {"supply_resistance": 0.6, "brown_out": 5.0, "reply_jitter": 5e-6, "torque_at_power_up": "yes"},
    {"supply_resistance": 0.3, "brown_out": 6.0, "overpowered": "yields", "ambient": 60, "cool_down": 0.1},
)
EVENTS = 120


def poke(servo: Servo, dice: Random) -> None:
    """Something that the world does to it."""
    place = servo.motion.position(0.0)
    what = dice.randrange(9)
    if what < 4:
        servo.torque = dice.choice((0.0, 0.1, 0.5, -0.7, 0.9, -1.0))
    elif what == 4:
        servo.blocked = dice.choice((None, (place - 100, place + dice.randrange(500)), (0.0, 1000.0)))
    elif what == 5:
        servo.temperature = dice.uniform(20, 90)
    elif what == 6:
        servo.voltage = dice.choice((servo.model.voltage, servo.model.voltage, 5.5, 4.0))
    elif what == 7:
        servo.cut(dice.choice((0, 0.5, 1, 2.5)))
    else:
        servo.power_cycle()


def order(dice: Random) -> bytes:
    """Something that a host says."""
    id, what = dice.randrange(1, 6), dice.randrange(6)
    if what == 0:
        return packet(id, RESTORE)
    if what == 1:
        return packet(ALL, SYNC_WRITE, 40, 1, *(byte for one in range(1, 6) for byte in (one, 1)))
    if what == 2:
        return packet(id, 3, dice.choice((48, 55)), dice.randrange(2))
    if what == 3:
        return packet(id, 3, dice.randrange(9, 50), dice.randrange(256), dice.randrange(256))
    return packet(id, 3, 42, *word(dice.randrange(1024)), 0, 0, *word(dice.randrange(4000)))


def film(seed: int, options: dict[str, object]) -> list[tuple[float, ...]]:
    """What five servos show while chance has its way with them."""
    dice = Random(seed)
    host = Host((1, 2, 3, 4, 5), MODELS, seed=seed, servo_baud=1_000_000, **options)
    seen: list[tuple[float, ...]] = []
    for _ in range(EVENTS):
        host.wait(dice.choice((0.0, 0.001, 0.1, 3.0, 500.0)))
        servo = dice.choice(host.bus.servos)
        if dice.random() < 0.5:
            poke(servo, dice)
        host.say(order(dice))
        host.say(packet(servo.id if servo.id < 254 else ALL, READ, 56, 15))
        seen.append(
            (servo.motion.position(host.bus.now), servo.duty(host.bus.now), servo.temperature, servo.error)
        )
        assert all(map(isfinite, seen[-1]))
        assert abs(seen[-1][1]) <= 1.0
        assert servo.next >= host.bus.now - 1e-9
    return seen


@pytest.mark.parametrize("options", OPTIONS, ids=range(len(OPTIONS)))
@pytest.mark.parametrize("seed", range(3))
def test_time_goes_on_whatever_happens(seed: int, options: dict[str, object]) -> None:
    assert film(seed, options) == film(seed, options)
