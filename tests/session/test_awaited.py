"""An async bus is open when its `async with` is entered: the echo is known, or the port is given back."""

from __future__ import annotations

import asyncio

import pytest

from motorbus.session import buses
from motorbus.session.awaited import OpenAsyncBus


def test_it_is_what_is_opened_for_asyncio() -> None:
    async def main() -> None:
        with buses.simulate("feetech") as sim:
            async with buses.open_async(sim.url) as bus:
                assert type(bus) is OpenAsyncBus

    asyncio.run(main())


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


def test_the_async_bus_finds_out_about_echo_when_it_is_entered() -> None:
    async def main() -> None:
        with buses.simulate("feetech") as sim:
            bus = buses.open_async(sim.url)
            assert not bus.echoes
            async with bus:
                assert not bus.echoes

    asyncio.run(main())
