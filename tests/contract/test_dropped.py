"""A bus that is dropped without `close` gives back its port, its lock and its stop thread, with a warning."""

from __future__ import annotations

import asyncio
import gc
import threading
from collections.abc import Iterator

import pytest

import motorbus
from motorbus import feetech
from tests.support.processes import Simulator, simulator


@pytest.fixture
def running(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[Simulator]:
    folder = tmp_path_factory.mktemp("dropped")
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
    with simulator(folder / "bus", "feetech", "--ids", "1") as simulated:
        yield simulated


def stop_threads() -> int:
    return sum(thread.name == "motorbus stop" for thread in threading.enumerate())


def test_a_dropped_bus_frees_its_port(running: Simulator) -> None:
    before = stop_threads()
    for _ in range(2):
        bus = motorbus.open(running.address)
        servo = feetech.Servo(bus, 1)
        servo.enable_torque()
        assert stop_threads() == before + 1
        del bus, servo
        with pytest.warns(ResourceWarning, match=f"{running.port}.* was not closed"):
            gc.collect()
        assert stop_threads() == before


def test_a_dropped_async_bus_frees_its_port(running: Simulator) -> None:
    async def main() -> None:
        for _ in range(2):
            bus = motorbus.open_async(running.address)
            servo = feetech.AsyncServo(bus, 1)
            await servo.position()
            del bus, servo
            with pytest.warns(ResourceWarning, match="was not closed"):
                gc.collect()

    asyncio.run(main())
    motorbus.open(running.address).close()
