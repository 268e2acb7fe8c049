"""A simulated controller in virtual time, and the requests that it has received."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from motorbus.core.request import Data, Effect
from motorbus.families.stepper.protocol import decode_request
from motorbus.simulation.named import Simulation


class Line(NamedTuple):
    """A simulated controller, and every request since `line_of`."""

    simulation: Simulation
    requests: list[bytes]

    @property
    def url(self) -> str:
        """Its bus."""
        return self.simulation.url

    def orders(self) -> list[str]:
        """The names of the commands that do more than read, in order."""
        found = [decode_request(data) for data in self.requests]
        return [one[0].name for one in found if one and one[0].effect is not Effect.NONE]


def line_of(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> Line:
    """From here on, every request that this simulated controller receives."""
    requests: list[bytes] = []
    receive = simulation.simulator.receive

    def received(data: Data, at: float) -> None:
        assert isinstance(data, bytes)
        requests.append(data)
        receive(data, at)

    monkeypatch.setattr(simulation.simulator, "receive", received)
    return Line(simulation, requests)
