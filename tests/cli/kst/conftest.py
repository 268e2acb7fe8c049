"""Simulated CAN servos: in this process, and in a process of their own behind a simulated slcan adapter."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import motorbus
from motorbus.cli.simulated import Simulated
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


@pytest.fixture
def on_slcan(tmp_path: Path, state_folder: Path, patient: None) -> Iterator[Simulated]:
    """Servos 37 and 38 in a process of their own, with a control socket."""
    control = str(tmp_path / "control")
    with Simulated("kst", ids="0x25+0x26", link=tmp_path / "can", control=control) as simulated:
        yield simulated
