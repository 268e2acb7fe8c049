"""Buses that several threads, signals and event loops use: no call blocks for ever, and no stop is overtaken."""

from __future__ import annotations

import asyncio
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

import motorbus
from motorbus import feetech, stepper
from motorbus.bus.blocking import exchange_on, run_on
from motorbus.bus.turn import Wake
from motorbus.core.request import Effect, Request
from motorbus.core.steps import Exclusive, Sleep, catch, gather
from motorbus.errors import Interrupted, LinkLost
from motorbus.families.feetech.driver.group import disable_torque_everyone
from motorbus.link.memory import MemoryLink
from tests.bus.test_batches import Arm
from tests.support.subjects import FAMILIES
from tests.support.world import make_bus

LIMIT = 8.0
"""s after which a call counts as blocked."""


@pytest.fixture
def arms() -> Iterator[list[Arm]]:
    with ExitStack() as made:
        yield [Arm(made, "real"), Arm(made, "real")]


def started(work: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


async def carried_out(order: Request[Any]) -> None:
    await order


async def reading(arm: Arm, times: int, pause: float = 0.0) -> None:
    for _ in range(times):
        await arm.batch()[1]
        await Sleep(pause)


@pytest.mark.parametrize("kind", ["exchange", "run"])
def test_threads_that_use_two_buses_in_any_order_do_not_block_each_other(arms: list[Arm], kind: str) -> None:
    def work(order: list[Arm]) -> None:
        for _ in range(30):
            if kind == "exchange":
                exchange_on({arm.bus: arm.batch() for arm in order})
            else:
                run_on({arm.bus: reading(arm, 3) for arm in order})

    threads = [started(lambda order=order: work(order)) for order in (arms, arms[::-1])]  # type: ignore[misc]
    for thread in threads:
        thread.join(LIMIT)
        assert not thread.is_alive()


def test_a_bus_whose_procedure_has_ended_is_free_while_others_run(arms: list[Arm]) -> None:
    first, second = arms
    work = started(lambda: run_on({first.bus: reading(first, 1), second.bus: reading(second, 10, 0.2)}))
    time.sleep(0.2)
    begun = time.monotonic()
    assert first.bus.estop().acknowledged == (1, 2, 3)
    assert time.monotonic() - begun < 1.0
    assert work.is_alive()
    work.join(LIMIT)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_a_stop_of_another_thread_goes_between_the_steps_of_an_exclusive_procedure(family: str) -> None:
    kind = FAMILIES[family]
    link = MemoryLink(kind.simulator((1,)), rate=kind.link.rate, virtual=False)
    with make_bus(link, kind.open()) as bus:
        begun, ended, is_read = (threading.Event() for _ in range(3))
        order: list[str] = []

        async def motion() -> None:
            begun.set()
            while not ended.is_set():
                await Sleep(0.01)
            order.append("motion")

        def read() -> None:
            bus.run(bus.driver.probe(1, 0))
            order.append("read")
            is_read.set()

        threads = [started(lambda: bus.run(Exclusive(motion())))]
        assert begun.wait(LIMIT)
        threads.append(started(read))
        stops = started(lambda: bus.run(gather(*bus.driver.stop({1: None}).requests)))
        stops.join(LIMIT)
        assert not stops.is_alive()
        assert not is_read.is_set()  # any other request waits for the end of the procedure
        ended.set()
        for thread in threads:
            thread.join(LIMIT)
        assert order == ["motion", "read"]


def test_a_stepper_that_jogs_is_stopped_by_another_thread() -> None:
    with motorbus.simulate("stepper", clock="real") as sim, motorbus.open(sim.url) as bus:
        motor = stepper.Controller(bus)
        simulator: Any = sim.simulator
        machine = simulator.controller.machine
        before = machine.position(bus.now())
        jog = started(lambda: bus.run(catch(stepper.Controller.jog.function(motor, 1.0, 2 * LIMIT))))
        while machine.position(bus.now()) == before:
            assert jog.is_alive()
            time.sleep(0.01)
        begun = time.monotonic()
        motor.stop()
        assert time.monotonic() - begun < LIMIT / 4


@pytest.mark.parametrize("stop", ["torque off", "batch"])
@pytest.mark.parametrize("kind", ["run", "exchange", "procedure"])
def test_an_order_that_waited_for_the_bus_does_not_leave_after_a_torque_off(
    arms: list[Arm], kind: str, stop: str
) -> None:
    arm, errors = arms[0], []
    order, read = arm.batch(1.0)
    calls: dict[str, Callable[[], object]] = {
        "run": lambda: arm.bus.run(order),
        "exchange": lambda: arm.bus.exchange([order, read]),
        "procedure": lambda: arm.bus.run(carried_out(order)),
    }

    def call() -> None:
        try:
            calls[kind]()
        except Interrupted as error:
            errors.append(error)

    arm.bus.exchange(arm.batch(3.0))
    with arm.bus.turn:
        waiting = started(call)
        time.sleep(0.1)
        if stop == "torque off":
            for node in (1, 2, 3):
                feetech.Servo(arm.bus, node).disable_torque()
        else:
            arm.bus.exchange([disable_torque_everyone(), read])
    waiting.join(LIMIT)
    assert len(errors) == 1
    assert arm.sim[1].memory["torque_enable"] == 0


@pytest.mark.parametrize("kind", ["run", "exchange"])
def test_a_handler_that_raises_while_a_call_waits_for_the_bus_loses_nothing(
    arms: list[Arm], kind: str
) -> None:
    arm, held, values = arms[0], threading.Event(), []
    servo = feetech.Servo(arm.bus, 1)

    def hold() -> None:
        with arm.bus.turn:
            held.set()
            time.sleep(0.5)

    def strike(number: int, frame: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, strike)
    try:
        holder = started(hold)
        assert held.wait(LIMIT)
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(TimeoutError):
            servo.position() if kind == "run" else arm.bus.exchange(arm.batch())
    finally:
        signal.signal(signal.SIGALRM, before)
    holder.join(LIMIT)
    other = started(lambda: values.append(servo.position()))
    other.join(LIMIT)
    assert len(values) == 1


@pytest.mark.parametrize("where", ["request", "pause"])
def test_a_second_signal_does_not_take_the_clean_up_away(arms: list[Arm], where: str) -> None:
    arm, cleaned = arms[0], []

    async def work() -> None:
        try:
            if where == "request":
                await arm.batch()[1]
                signal.raise_signal(signal.SIGINT)
            while True:
                await Sleep(0.5)
        finally:
            signal.raise_signal(signal.SIGINT)
            await arm.batch()[1]
            cleaned.append(True)

    if where == "pause":
        threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        arm.bus.run(work())
    assert cleaned


@pytest.mark.parametrize("call", ["position", "telemetry"])
def test_closing_an_asyncio_bus_ends_the_calls_that_wait(call: str) -> None:
    async def main() -> None:
        with motorbus.simulate("feetech", clock="real") as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo: Any = feetech.AsyncServo(bus, 1)
                for _ in range(3):
                    await servo.position()
                sim.faults = "100%: delay 0.3"
                task = asyncio.create_task(getattr(servo, call)())
                await asyncio.sleep(0.003)
            with pytest.raises(LinkLost, match="closed"):
                await asyncio.wait_for(task, LIMIT)

    asyncio.run(main())


def test_a_cancelled_read_of_a_silent_servo_leaves_the_bus_usable() -> None:
    async def cancelled() -> list[float]:
        with motorbus.simulate("feetech", ids="1-2", clock="real") as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo = feetech.AsyncServo(bus, 1)
                await servo.position()
                sim[1].unplug()
                with pytest.raises(TimeoutError):
                    await asyncio.wait_for(servo.position(), 0.005)
                await asyncio.sleep(0.5)
                sim[1].plug()
                return [await servo.position() for _ in range(3)]

    assert len(set(asyncio.run(cancelled()))) == 1


def test_an_emergency_stop_ends_the_calls_of_a_loop_that_is_closed() -> None:
    with motorbus.simulate("feetech", ids="1", clock="real") as sim:
        bus = motorbus.open_async(sim.url)
        loop = asyncio.new_event_loop()
        pending: list[asyncio.Task[float]] = []

        async def begin() -> None:
            await bus.run(feetech.Servo.position.function(feetech.AsyncServo(bus, 1)))
            pending.append(loop.create_task(bus.run(Sleep(60.0))))
            await asyncio.sleep(0.05)

        loop.run_until_complete(begin())
        loop.close()
        assert bus.estop().acknowledged == (1,)
        bus._close_port()


@pytest.mark.parametrize("fault", [SystemExit(3), ValueError("in the clean-up")])
def test_a_clean_up_that_raises_leaves_no_call_of_a_worker_waiting(fault: BaseException) -> None:
    async def stubborn() -> None:
        try:
            await Sleep(60.0)
        finally:
            raise fault

    async def main() -> None:
        with motorbus.simulate("feetech", clock="real") as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo = feetech.AsyncServo(bus, 1)
                raising = asyncio.create_task(bus.run(stubborn()))
                other = asyncio.create_task(bus.run(Sleep(0.3)))
                await asyncio.sleep(0.05)
                raising.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await asyncio.wait_for(raising, LIMIT)
                await asyncio.wait_for(other, LIMIT)
                assert await asyncio.wait_for(servo.ping(), LIMIT)

    asyncio.run(main())


@pytest.mark.parametrize("where", ["send", "receive", "link"])
def test_a_fault_of_the_bus_ends_every_call_of_a_worker(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*given: Any, **named: Any) -> Any:
        raise RuntimeError("a fault of the bus")

    async def main() -> None:
        with motorbus.simulate("feetech", clock="real") as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo = feetech.AsyncServo(bus, 1)
                await servo.position()
                with monkeypatch.context() as patch:
                    target: Any = bus.link if where == "link" else bus
                    patch.setattr(target, "read" if where == "link" else where, fail)
                    calls = [asyncio.create_task(servo.position()) for _ in range(3)]
                    for call in calls:
                        with pytest.raises(RuntimeError, match="a fault of the bus"):
                            await asyncio.wait_for(call, LIMIT)
                await asyncio.wait_for(servo.position(), LIMIT)

    asyncio.run(main())


def test_a_latch_counts_before_it_gets_the_turn(arms: list[Arm]) -> None:
    arm = arms[0]
    servo = feetech.Servo(arm.bus, 1)
    assert arm.batch()[0].effect is Effect.MOTION
    with arm.bus.turn:
        latching = started(arm.bus.latch)
        while not arm.bus.latched:
            assert latching.is_alive()
            time.sleep(0.001)
        with pytest.raises(Interrupted, match="in this process"):
            arm.bus.exchange(arm.batch())
        assert latching.is_alive()
    latching.join(LIMIT)
    assert servo.position() is not None  # reads still work
    arm.bus.reset()
    arm.bus.exchange(arm.batch())


def test_a_call_of_a_loop_that_is_closed_cleans_up_and_frees_the_bus() -> None:
    with motorbus.simulate("feetech", ids="1", clock="real") as sim:
        bus = motorbus.open_async(sim.url)
        servo = feetech.AsyncServo(bus, 1)
        cleaned = threading.Event()
        pending: list[asyncio.Task[None]] = []

        async def work() -> None:
            try:
                await Exclusive(Sleep(60.0))
            finally:
                cleaned.set()

        async def begin() -> None:
            pending.append(asyncio.get_running_loop().create_task(bus.run(work())))
            await asyncio.sleep(0.05)

        loop = asyncio.new_event_loop()
        loop.run_until_complete(begin())
        loop.close()
        assert cleaned.wait(LIMIT)

        async def again() -> bool:
            async with bus:
                return await asyncio.wait_for(servo.ping(), LIMIT) is not None

        assert asyncio.run(again())


@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_two_loops_in_two_threads_use_two_buses(clock: str) -> None:
    right: list[int] = []

    async def main(turn: int) -> None:
        with motorbus.simulate("feetech", ids="1-3", clock=clock) as sim:
            async with motorbus.open_async(sim.url) as bus:
                servos = [feetech.AsyncServo(bus, node) for node in (1, 2, 3)]
                for index in range(50):
                    for node in (1, 2, 3):
                        sim[node].raw_position = 1_000 * turn + 10 * index + node
                    found = await asyncio.gather(*(servo.position() for servo in servos))
                    counts = [round(place * 4096 / math.tau) for place in found]
                    assert counts == [1_000 * turn + 10 * index + node for node in (1, 2, 3)]
                right.append(turn)

    threads = [started(lambda turn=turn: asyncio.run(main(turn))) for turn in (1, 2)]  # type: ignore[misc]
    for thread in threads:
        thread.join(2 * LIMIT)
    assert sorted(right) == [1, 2]


def test_a_sleep_of_a_microsecond_ends() -> None:
    """The time-out may pass before the thread waits; a SimpleQueue of CPython 3.11 and 3.12 then waits for ever."""
    for seconds in (3e-7, 1e-6, 2e-6):
        for _ in range(5_000):
            wake = Wake()
            wake.set()
            wake.set()
            wake.wait()
            wake.wait(seconds)
