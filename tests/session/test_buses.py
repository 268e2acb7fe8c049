"""Opening a bus: what is made of an address, blocking and async, and what is given back when it fails."""

from __future__ import annotations

import subprocess
import sys

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


def test_a_bus_that_blocks_needs_no_asyncio() -> None:
    program = """
import sys, motorbus
with motorbus.simulate("feetech") as sim, motorbus.open(sim.url) as bus:
    motorbus.feetech.Servo(bus, 1).position()
print(*{"argparse", "asyncio", "numpy", "serial", "serialx"} & set(sys.modules))
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == ""
