"""Open a bus by its address, blocking and async, and give the port back when that fails."""

from __future__ import annotations

import asyncio
import subprocess
import sys

import pytest

from motorbus.session import buses


def test_options_may_stand_beside_the_address() -> None:
    with buses.simulate("feetech", ids="1-2") as sim, buses.open(sim.url, baud=500_000) as bus:
        assert bus.rate == 500_000


def test_ids_may_be_text_or_numbers() -> None:
    for ids in ("1-3", (1, 2, 3)):
        with buses.simulate("feetech", ids=ids) as sim:
            assert sorted(sim.simulator.nodes) == [1, 2, 3]


def test_a_bus_that_blocks_needs_no_asyncio() -> None:
    program = """
import sys, motorbus
with motorbus.simulate("feetech") as sim, motorbus.open(sim.url) as bus:
    motorbus.feetech.Servo(bus, 1).position()
print(*{"argparse", "asyncio", "numpy", "serial", "serialx"} & set(sys.modules))
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == ""


def test_an_async_bus_that_was_cancelled_while_it_was_entered_gives_its_port_back() -> None:
    async def entered(url: str) -> None:
        async with buses.open_async(url):
            raise AssertionError("it was cancelled before")

    async def main() -> None:
        with buses.simulate("feetech") as sim:
            task = asyncio.create_task(entered(sim.url))
            await asyncio.sleep(0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            async with buses.open_async(sim.url) as bus:
                assert bus.simulated

    asyncio.run(main())
