"""Many callers on one bus with a dead node: each call returns its own node's value, and nothing hangs."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import motorbus
from motorbus import feetech, kst
from tests.conftest import Rounds
from tests.support.processes import LIMIT, simulator

THREADS: Final = 16
TASKS: Final = 64
DEAD: Final = 8
GROUPS: Final = 2
"""Callers that read a group with the dead node in it, which holds the bus up for its time-outs."""
SERVOS: Final = tuple(node for node in range(1, THREADS + 1) if node != DEAD)


def test_16_threads_on_a_blocking_bus(tmp_path: Path, rounds: Rounds) -> None:
    """Thread K writes to servo K and reads back; a few also read a group that has the dead one in it."""
    total = rounds(500, 12)

    def reader(bus: Any, node: int) -> int:
        servo = feetech.Servo(bus, node)
        for index in range(total):
            number = 1.0 + (node + index) % 100 / 4
            servo.write(acceleration=number)
            assert abs(servo.read("acceleration")["acceleration"] - number) < 0.1, node
        if node <= GROUPS:
            group = bus.run(feetech.sync_read(["id"], [DEAD, 15, node]))
            assert {one: values["id"] for one, values in group.values.items()} == {15: 15, node: node}
            assert list(group.errors) == [DEAD]
        return total

    def caller_of_the_dead(bus: Any) -> int:
        failed = 0
        for _ in range(2):
            try:
                feetech.Servo(bus, DEAD).position()
            except motorbus.NoReply as error:
                failed += error.node == DEAD
        return failed

    ids = ",".join(map(str, SERVOS))
    with (
        simulator(tmp_path / "bus", "feetech", "--ids", ids) as simulated,
        motorbus.open(simulated.address) as bus,
        ThreadPoolExecutor(THREADS) as pool,
    ):
        dead = pool.submit(caller_of_the_dead, bus)
        readers = [pool.submit(reader, bus, node) for node in SERVOS]
        assert [one.result(LIMIT + total) for one in readers] == [total] * len(SERVOS)
        assert dead.result(LIMIT) == 2
        assert bus.statistics.of(DEAD).ok == 0


async def _task(servos: dict[int, Any], who: int, number: dict[int, int], total: int) -> int:
    """Read servos in turn, from the `who`th on; return the number of errors of the dead one."""
    failed, nodes = 0, list(servos)
    for index in range(total):
        node = nodes[(who + index) % len(nodes)]
        try:
            value = await servos[node].read_raw("present_position")
        except motorbus.NoReply as error:
            if error.node != DEAD:
                raise
            failed += 1
        else:
            assert value == {"present_position": number[node]}, node
    return failed


def test_64_tasks_on_an_async_bus(rounds: Rounds) -> None:
    """In virtual time, over servos that share one wire and over CAN, where several requests are under way at once."""
    total = rounds(2_000, 24)
    nodes = range(1, 9)
    kinds: tuple[tuple[str, Any], ...] = (("feetech", feetech.AsyncServo), ("kst", kst.AsyncServo))

    async def main(family: str, servo: Any) -> list[int]:
        with motorbus.simulate(family, ids=tuple(nodes)) as sim:
            for node in nodes:
                sim[node].raw_position = 10 + node
            async with motorbus.open_async(sim.url) as bus:
                servos = {node: servo(bus, node) for node in nodes}
                await asyncio.gather(*(one.identify() for one in servos.values()))
                sim[DEAD].unplug()
                number = {node: 10 + node for node in nodes}
                found = await asyncio.gather(*(_task(servos, who, number, total) for who in range(TASKS)))
                sim[DEAD].plug()
                assert await servos[DEAD].read_raw("present_position") == {"present_position": 10 + DEAD}
                return list(found)

    for family, servo in kinds:
        failed = asyncio.run(asyncio.wait_for(main(family, servo), LIMIT + total))
        assert failed == [total // len(nodes)] * TASKS, family


def test_64_tasks_on_a_real_port(tmp_path: Path, rounds: Rounds) -> None:
    """Reads, writes and groups; servo K belongs to the tasks K, K + 16, ..., which take turns at writing."""
    total = rounds(100, 2)

    async def task(bus: Any, who: int, turns: dict[int, asyncio.Lock]) -> None:
        node = SERVOS[who % len(SERVOS)]
        servo = feetech.AsyncServo(bus, node)
        for index in range(total):
            number = 1.0 + (who + index) % 100 / 4
            async with turns[node]:
                await servo.write(acceleration=number)
                assert abs((await servo.read("acceleration"))["acceleration"] - number) < 0.1, node
            if who < GROUPS:
                group = await bus.run(feetech.sync_read(["id"], [1, 2, 3, DEAD]))
                assert {one: values["id"] for one, values in group.values.items()} == {1: 1, 2: 2, 3: 3}

    async def main(address: str) -> None:
        turns = {node: asyncio.Lock() for node in SERVOS}
        async with motorbus.open_async(address) as bus:
            await asyncio.wait_for(
                asyncio.gather(*(task(bus, who, turns) for who in range(TASKS))), LIMIT + total
            )

    ids = ",".join(map(str, SERVOS))
    with simulator(tmp_path / "bus", "feetech", "--ids", ids) as simulated:
        asyncio.run(main(simulated.address))
