"""Opening a bus: what is made of an address, blocking and async, and what is given back when it fails."""

from __future__ import annotations

import asyncio

import pytest

import motorbus
from motorbus.session import buses


def test_the_names_of_the_package_are_these() -> None:
    assert motorbus.open is buses.open
    assert motorbus.open_async is buses.open_async
    assert motorbus.simulate is buses.simulate


def test_options_may_stand_beside_the_address() -> None:
    with buses.simulate("feetech", ids="1-2") as sim, buses.open(sim.url, baud=500_000) as bus:
        assert bus.rate == 500_000


def test_ids_may_be_text_or_numbers() -> None:
    for ids in ("1-3", (1, 2, 3)):
        with buses.simulate("feetech", ids=ids) as sim:
            assert sorted(sim.simulator.nodes) == [1, 2, 3]


@pytest.mark.parametrize("address", ["feetech:sim:nobody", "feetech:/dev/ttyNOTHING"])
def test_what_is_not_there_is_told_by_both(address: str) -> None:
    with pytest.raises(motorbus.PortNotFound):
        buses.open(address)
    with pytest.raises(motorbus.PortNotFound):
        buses.open_async(address)


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
            assert bus.turns.echo.present is None
            async with bus:
                assert bus.turns.echo.present is False

    asyncio.run(main())
