"""An emergency stop in the worst second: thousands of orders wait, a long reply is coming in, and the line is noisy.

In virtual time on wires that take bit time. What counts is the moment at which the first frame of the stop goes onto
the wire, from the call on.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import motorbus
from motorbus.bus.crank import crank
from motorbus.bus.pump import Bus
from motorbus.bus.ticket import Flight
from motorbus.core.operation import CanFrame, Data, Exchange
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.kst.driver.feedback import position_exchange
from motorbus.link.memory import NoisyLine
from motorbus.simulation.named import Simulation

QUEUED = 10_000
NODES = {"feetech": (1, 2, 3), "kst": (0x25, 0x26), "stepper": (1,)}
MOST = {"feetech": 0.005, "kst": 0.001, "stepper": 0.025}
"""s from the call to the first byte: a FEETECH line at 1 Mbaud may have to end a reply of 4 ms first, a stepper's a
frame and its answer (2 x 11.46 ms), and on CAN nothing but a frame of 0.25 ms goes before."""


@contextmanager
def busy(family: str, *, seed: int) -> Iterator[tuple[Simulation, Bus]]:
    """A bus whose devices are known, with thousands of questions in its queue, and one of them on the wire."""
    ids = "+".join(map(str, NODES[family]))
    with motorbus.simulate(family, ids=ids) as sim:
        sim.pace = True
        with motorbus.open(sim.url) as bus:
            for node in NODES[family]:
                bus.run(bus.family.identify(node))
            sim.line = NoisyLine(seed, corrupt=0.2, loss=0.05, delay=0.0002)
            for number in range(QUEUED):
                node = NODES[family][number % len(NODES[family])]
                bus.turns.submit(Flight(question(bus, node)), bus.link.now())
            for _ in range(seed):
                crank(bus.link, bus.turns, bus.link.now() + 0.0007)
            yield sim, bus


def question(bus: Bus, node: int) -> Exchange[Any]:
    """The longest reply that one of these gives, as a poll."""
    device = bus.family.devices.blocking(bus, node)
    if bus.family.name == "feetech":
        return read_block(device, 0, 200, bytes)
    if bus.family.name == "kst":
        return position_exchange(device)
    return bus.family.probe(node, 0)


def is_stop(family: str, data: Data) -> bool:
    """By the manuals: torque off (register 40), a target (6003) or the question where it is, 5E or 03 0D."""
    if isinstance(data, CanFrame):
        return data.data[1:3] in (b"\x03\x60", b"\x02\x60")
    if family == "feetech":
        return data[4] in (3, 0x83) and data[5] == 40
    return data[2] == 0x5E or data[2:4] == b"\x03\x0d"


@pytest.mark.parametrize("seed", range(1, 13))
@pytest.mark.parametrize("family", NODES)
def test_the_first_byte_of_a_stop_leaves_in_time_whatever_waits(family: str, seed: int) -> None:
    with busy(family, seed=seed) as (_, bus):
        records = bus.trace.subscribe(limit=100_000)
        asked = bus.link.now()
        outcome = bus.estop()
        sent = [(one.at, one.data) for one in records if one.direction == "tx"]
        assert all(is_stop(family, data) for _, data in sent), "nothing else leaves any more"
        assert sent[0][0] - asked <= MOST[family]
        assert bus.turns.latched
        assert not bus.turns.waiting
        assert outcome.rounds <= 5
