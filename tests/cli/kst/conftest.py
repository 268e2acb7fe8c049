"""Simulated CAN servos in this process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import motorbus
from motorbus.simulation.named import Simulation


@pytest.fixture
def servos() -> Iterator[Simulation]:
    """Servos 37 and 38 as in the manual, in virtual time; `servos.url` is their bus."""
    with motorbus.simulate("kst", ids="0x25+0x26") as simulation:
        yield simulation


@pytest.fixture
def newer() -> Iterator[Simulation]:
    """Servo 37 with newer firmware."""
    with motorbus.simulate("kst", ids="0x25", profile="kst-ext") as simulation:
        yield simulation
