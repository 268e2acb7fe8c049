"""Ids are told as the users of a family write them."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.errors import RequestError
from motorbus.simulation.control import obey
from motorbus.simulation.faults import World, parse
from motorbus.simulation.named import Simulation
from motorbus.simulation.told import told


@pytest.mark.parametrize(
    ("family", "ids", "text"),
    [("feetech", (3, 1), "1, 3"), ("stepper", (1,), "1"), ("kst", (0x26, 0x05), "0x05 (5), 0x26 (38)")],
)
def test_ids_are_told_as_the_family_has_them(family: str, ids: tuple[int, ...], text: str) -> None:
    simulator = families.load(family).simulator(ids, "")
    assert told(simulator, simulator.nodes) == text
    assert told(World(simulator), simulator.nodes) == text


def test_whoever_misses_a_node_of_a_can_bus_is_told_in_hex_which_there_are() -> None:
    with Simulation(families.load("kst"), (0x25,)) as sim:
        with pytest.raises(RequestError, match=r"no node 0x01 \(1\)") as caught:
            sim.faults = parse("exchange 1: duplicate-id 1")
        assert caught.value.expected == "one of 0x25 (37)"
        with pytest.raises(RequestError, match=r"no node 0x01 \(1\)") as caught:
            sim[1]
        assert caught.value.expected == "one of 0x25 (37)"
        assert obey(sim.simulator, "unplug 1") == "error: there is no node 1; there are: 0x25 (37)"
