"""Simulated servos of every map behind a real bus in virtual time, and what is sent to them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import motorbus
from motorbus.core.steps import Sleep
from motorbus.families.feetech import Servo
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS, Mode

MODELS = {
    "sts": "sts3215",
    "smbl": "sm85blhv",
    "smcl": "sm60-360m",
    "scs": "scs0009",
    "scs2": "scs215-2",
    "hls": "hls3925",
}
RATES = {"smbl": 115_200, "smcl": 115_200}
"""bit/s at which servos of a map ship, where that is not 1000000."""
MODES = [(name, mode) for name in TABLES for mode in TRAITS[name].has if (name, mode) != ("hls", Mode.PWM)]


@contextmanager
def world(name: str = "sts", ids: str = "1", **options: Any) -> Iterator[tuple[Any, Any, Any]]:
    """A bus, a device object of servo 1, and the simulation."""
    options = {"ids": ids, "model": MODELS.get(name, name), **options}
    with (
        motorbus.simulate("feetech", **options) as simulation,
        motorbus.open(simulation.url, baud=RATES.get(name, 1_000_000)) as bus,
    ):
        yield bus, Servo(bus, 1), simulation


def later(bus: Any, seconds: float) -> None:
    bus.run(Sleep(seconds))


@contextmanager
def traffic(bus: Any) -> Iterator[list[str]]:
    """Fills with the requests that leave meanwhile, as hex without header and checksum."""
    sent: list[str] = []
    subscription = bus.trace.subscribe(limit=1_000_000)
    try:
        yield sent
    finally:
        bus.trace.unsubscribe(subscription)
        data = [one.data for one in subscription if one.direction == "tx"]
        sent += [one[2:-1].hex(" ") for one in data if isinstance(one, bytes)]


def writes(sent: list[str]) -> list[str]:
    """The requests that change something: no PING, READ or SYNC READ."""
    return [one for one in sent if one.split(" ")[2] not in ("01", "02", "82")]


def put_mode(servo: Any, mode: Mode) -> None:
    """Put a servo into a mode; an SCS needs limits for position mode."""
    if TRAITS[servo.identify().table].modes or mode is not Mode.POSITION:
        servo.set_mode(mode)
    else:
        servo.set_mode(mode, limits=(0.5, 4.0))
