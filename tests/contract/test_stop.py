"""An emergency stop reaches the wire at once while the bus is busy, from wherever it is asked for."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, Final

import pytest

import motorbus
from motorbus import feetech, kst
from tests.support.processes import LATENCY, LIMIT, Simulator, simulator
from tests.support.processes import motorbus as shell

TORQUE_OFF: Final = bytes.fromhex("FF FF FE 04 03 28 00 D2")
"""WRITE torque_enable 0 to all servos: the first frame of a stop."""
LATER: Final = 1_000
"""Requests of a busy caller that may leave between the call of a stop and its first frame: tens of ms of switching
threads on a busy computer. A caller sends requests without end where a stop waits behind them."""


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulator]:
    """Three servos in another process, and a state folder of these tests' own."""
    folder = tmp_path_factory.mktemp("stop")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        with simulator(folder / "bus", "feetech", "--ids", "1-3") as simulated:
            yield simulated


def sent(records: Any) -> list[bytes]:
    """The requests in a trace."""
    return [record.data for record in records if record.direction == "tx"]


def check_stopped(bus: Any, servos: list[Any]) -> None:
    """Torque is off, reads pass, motion and torque are refused until `reset`."""
    assert bus.latched
    for servo in servos:
        assert not servo.read("torque_enable")["torque_enable"]
        for order in (servo.enable_torque, lambda servo=servo: servo.move(1.0, wait=False)):
            with pytest.raises(motorbus.Interrupted):
                order()
        assert not servo.read("torque_enable")["torque_enable"]
    bus.reset()
    servos[0].enable_torque()
    assert servos[0].read("torque_enable")["torque_enable"]


class Busy:
    """Reads servos in a tight loop and keeps every request that leaves; `asked` is how many had left by then."""

    def __init__(self, bus: Any, nodes: tuple[int, ...] = (1, 2, 3)) -> None:
        self.bus = bus
        self.servos = [feetech.Servo(bus, node) for node in nodes]
        for servo in self.servos:
            servo.enable_torque()
        self.requests: list[bytes] = []
        self.asked = -1
        self.ended = 0
        self._trace = bus.trace.subscribe(100_000)

    def ask(self) -> None:
        """Ask for a stop and wait for its outcome."""
        self.asked = len(self.requests)
        assert set(self.bus.estop().acknowledged) == {1, 2, 3}

    def trigger(self, *_: object) -> None:
        """Ask for a stop from a signal handler."""
        self.asked = len(self.requests)
        self.bus.trigger_estop()

    def read(self, index: int) -> None:
        """Read one servo; the one read that the stop meets may end with it."""
        try:
            self.servos[index % 3].position()
        except motorbus.Interrupted:
            self.ended += 1

    def until_stopped(self, begin: Callable[[], object]) -> int:
        """Read, call `begin` in the middle, read on; how many requests left between the stop was asked for and sent."""
        end = time.monotonic() + LIMIT
        for index in count():
            self.read(index)
            self.requests += sent(self._trace)
            if index == 200:
                begin()
            if TORQUE_OFF in self.requests:
                break
            assert time.monotonic() < end, "no stop"
        while not self.bus.latched or index < 400:
            self.read(index)
            index += 1
        assert self.ended <= 1
        return self.requests.index(TORQUE_OFF) - self.asked


def test_from_another_thread(running: Simulator) -> None:
    with motorbus.open(running.address) as bus:
        busy = Busy(bus)
        other = threading.Thread(target=busy.ask)
        assert busy.until_stopped(other.start) <= LATER
        other.join(LIMIT)
        assert not other.is_alive()
        check_stopped(bus, busy.servos)


def test_from_a_signal_handler(running: Simulator) -> None:
    with motorbus.open(running.address) as bus:
        busy = Busy(bus)
        before = signal.signal(signal.SIGUSR1, busy.trigger)
        try:
            other = threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGUSR1))
            assert busy.until_stopped(other.start) <= LATER
            other.join(LIMIT)
        finally:
            signal.signal(signal.SIGUSR1, before)
        bus.estop()  # returns when the one before has ended
        check_stopped(bus, busy.servos)


def test_from_another_process(running: Simulator) -> None:
    with motorbus.open(running.address) as bus:
        busy = Busy(bus)
        outcome: list[tuple[int, dict[str, Any]]] = []
        other = threading.Thread(target=lambda: outcome.append(shell("estop", running.address)))
        busy.until_stopped(other.start)
        other.join(LIMIT)
        ((code, document),) = outcome
        assert code == 0, document
        check_stopped(bus, busy.servos)


def test_while_a_caller_waits_for_a_silent_node(running: Simulator) -> None:
    """The stop leaves before the caller's time-out of a second, and the caller sends nothing more before it."""
    with motorbus.open(running.address.replace(LATENCY, ",latency=1")) as bus:
        busy, failed = Busy(bus), []
        trace = bus.trace.subscribe(100_000)

        def read() -> None:
            try:
                feetech.Servo(bus, 9).position()
            except motorbus.MotorbusError as error:
                failed.append(error)

        other = threading.Thread(target=read)
        other.start()
        requests: list[bytes] = []
        while not any(request[2] == 9 for request in requests):
            requests += sent(trace)
            os.sched_yield()
        assert set(bus.estop().acknowledged) == {1, 2, 3}
        requests += sent(trace)
        assert [request[2] for request in requests[: requests.index(TORQUE_OFF)]] == [9]
        other.join(LIMIT)
        assert len(failed) == 1
        check_stopped(bus, busy.servos)


@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_among_64_tasks_in_virtual_time(family: str) -> None:
    """The frames of the stop are the next ones on the wire, and they are over within 20 ms of bus time."""
    kinds: dict[str, Any] = {"feetech": feetech.AsyncServo, "kst": kst.AsyncServo}

    async def main() -> None:
        with motorbus.simulate(family, ids="1-3") as sim:
            sim.pace = True
            async with motorbus.open_async(sim.url) as bus:
                servos = [kinds[family](bus, node) for node in (1, 2, 3)]
                await asyncio.gather(*(servo.identify() for servo in servos))
                if family == "feetech":
                    await asyncio.gather(*(servo.enable_torque() for servo in servos))
                for servo in servos:
                    await servo.move(0.5, wait=False)
                readers = [asyncio.create_task(servos[who % 3].position()) for who in range(64)]
                await asyncio.sleep(0)
                begun, trace = sim.now, bus.trace.subscribe(100_000)
                assert set(bus.estop().acknowledged) == {1, 2, 3}
                requests = sent(trace)
                assert sim.now - begun < 0.02
                assert len(requests) <= 12, requests
                if family == "feetech":
                    assert requests[0] == TORQUE_OFF
                await asyncio.gather(*readers)
                with pytest.raises(motorbus.Interrupted):
                    await servos[0].move(0.1, wait=False)
                sim.wait(sim.now + 1.0)
                assert not any(sim[node].status()["moving"] for node in (1, 2, 3))
                bus.reset()
                assert isinstance(await servos[0].position(), float)

    asyncio.run(main())
