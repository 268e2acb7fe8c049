"""A simulated controller in virtual time for the commands of this family, and what it has heard."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import motorbus
from motorbus.core.request import Data, Effect
from motorbus.families.stepper import wire
from motorbus.families.stepper.table import ORDERS
from motorbus.simulation.named import Simulation

EXAMPLE = str(Path(__file__).resolve().parents[3] / "examples" / "pick_and_place.toml")


class Line(NamedTuple):
    """A simulated controller in virtual time, and every request that it has heard since it was made."""

    simulation: Simulation
    heard: list[bytes]

    @property
    def url(self) -> str:
        """Its bus."""
        return self.simulation.url

    def commands(self) -> list[str]:
        """The names of the commands that came, in order."""
        found = [wire.decode_request(data) for data in self.heard]
        return [one.command.name for one in found if one is not None]

    def orders(self) -> list[str]:
        """The same without those that only read."""
        return [name for name in self.commands() if ORDERS[name].effect is not Effect.NONE]


def line_of(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> Line:
    """From here on, every request that this simulated controller hears."""
    heard: list[bytes] = []
    receive = simulation.simulator.receive

    def overheard(data: Data, at: float) -> None:
        assert isinstance(data, bytes)
        heard.append(data)
        receive(data, at)

    monkeypatch.setattr(simulation.simulator, "receive", overheard)
    return Line(simulation, heard)


def press(simulation: Simulation, script: str) -> None:
    """What happens at the inputs of this controller, as `0.5 1 on` in lines."""
    controller: Any = simulation.simulator
    controller.script(script)


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Iterator[Line]:
    """A controller as it is shipped."""
    with motorbus.simulate("stepper") as simulation:
        yield line_of(simulation, monkeypatch)
