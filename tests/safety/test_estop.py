"""An emergency stop in the worst second: thousands of orders wait, a long reply is coming in, and the line is noisy.

In virtual time on wires that take bit time. What counts is the moment at which the first frame of the stop goes onto
the wire, from the call on. On CAN that may be the question where a servo is, for such a servo stops by being told to
stay at a place that is known: so the moment of the first target counts, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data, Effect, Request
from motorbus.core.setpoint import Setpoint
from motorbus.errors import MotorbusError
from motorbus.families.feetech import protocol as feetech
from motorbus.families.feetech.driver.requests import read_block
from motorbus.families.kst.driver.feedback import position
from motorbus.families.stepper import protocol as stepper
from tests.support.world import Bus, Queue

QUEUED = 3_000
NODES = {"feetech": (1, 2, 3), "kst": (0x25, 0x26), "stepper": (1,)}
MOST = {"feetech": 0.005, "kst": 0.001, "stepper": 0.025}
"""s from the call to the first byte: a FEETECH line at 1 Mbaud may have to end a reply of 4 ms first, a stepper's a
frame and its answer (2 x 11.46 ms), and on CAN nothing but a frame of 0.25 ms goes before."""


TARGET = 0.0015
"""s from the call to the first target of a CAN bus: behind a question, its answer and what was on the wire."""
AGAIN = 0.052
"""s that each further round may take, where a question or its answer was lost."""


@contextmanager
def busy(family: str, *, seed: int) -> Iterator[tuple[Bus, Queue]]:
    """A bus whose devices are known, with thousands of questions and orders in its queue, and one on the wire."""
    ids = "+".join(map(str, NODES[family]))
    with motorbus.simulate(family, ids=ids) as sim:
        sim.pace = True
        with motorbus.open(sim.url) as bus:
            for node in NODES[family]:
                bus.run(bus.driver.identify(node))
            sim.faults = f"seed {seed}; 20%: corrupt; 5%: drop; 100%: delay 0.0001-0.0002"
            queue = Queue(bus, requests(bus, NODES[family]))
            for _ in range(seed):
                queue.turn(0.0007)
            yield bus, queue


def question(bus: Bus, node: int) -> Request[Any]:
    """The longest reply that one of these gives, as a poll."""
    device = bus.family.devices.blocking(bus, node)
    if bus.family.name == "feetech":
        return read_block(device, 0, 200, bytes)
    if bus.family.name == "kst":
        return position(device)
    return bus.driver.probe(node, 0)


def order(bus: Bus, node: int) -> Request[Any]:
    """An order to move, by the manuals: a goal position (42), a target (6003), or a run of the project (03 0C)."""
    goal = Setpoint(node, "position", 0.5, -7.0, 7.0)
    request: Data
    if bus.family.name == "feetech":
        request = feetech.write(node, 42, (326).to_bytes(2, "little"))
    elif bus.family.name == "kst":
        request = CanFrame(0x600 + node, bytes.fromhex("2203600026010000"))
    else:
        request, goal = stepper.encode("run_once"), Setpoint(node, "relative", 0.5, -7.0, 7.0)
    return Request(request, (), lane=node, effect=Effect.MOTION, setpoints=(goal,))


def requests(bus: Any, nodes: tuple[int, ...]) -> list[Request[Any]]:
    """Thousands, of which every third would move something."""
    found: list[Request[Any]] = []
    for number in range(QUEUED):
        node = nodes[number % len(nodes)]
        found.append(order(bus, node) if number % 3 == 2 else question(bus, node))
    return found


def is_target(data: Data) -> bool:
    """A target (6003) of a CAN servo."""
    return isinstance(data, CanFrame) and data.data[0] & 0xE0 == 0x20 and data.data[1:3] == b"\x03\x60"


def is_stop(family: str, data: Data) -> bool:
    """By the manuals: torque (register 40) off, or, where one holds, limited; 5E or 03 0D; a target (6003), or the
    question where it is (6002) that must come before one."""
    if isinstance(data, CanFrame):
        return is_target(data) or data.data[:3] == b"\x40\x02\x60"
    if family == "feetech":
        return data[4] in (3, 0x83) and data[5] == 40
    return data[2] == 0x5E or data[2:4] == b"\x03\x0d"


@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize("family", NODES)
def test_the_first_byte_of_a_stop_leaves_in_time_whatever_waits(family: str, seed: int) -> None:
    with busy(family, seed=seed) as (bus, queue):
        records = bus.trace.subscribe(limit=100_000)
        asked = bus.link.now()
        outcome = bus.estop()
        sent = [(one.at, one.data) for one in records if one.direction == "tx"]
        assert all(is_stop(family, data) for _, data in sent), "nothing else leaves any more"
        assert sent[0][0] - asked <= MOST[family]
        assert bus.latched
        assert outcome.rounds <= 5
        orders = range(2, QUEUED, 3)
        while any(queue.outcomes[number] is None for number in orders):
            queue.turn(0.0007)
        refused = sum(isinstance(queue.outcomes[number], MotorbusError) for number in orders)
        assert refused > QUEUED / 4, "they were not sent"
        if family == "kst":
            first = next(at for at, data in sent if is_target(data))
            assert first - asked <= TARGET + (outcome.rounds - 1) * AGAIN
