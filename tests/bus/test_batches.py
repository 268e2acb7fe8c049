"""Batches of a control loop: goals and questions of one bus and of several."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

import motorbus
from motorbus import feetech
from motorbus.bus.blocking import Bus, exchange_on, run_on
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Request, Response
from motorbus.errors import MotorbusError, RequestError
from motorbus.simulation.named import Simulation
from tests.bus.adapter import Engine
from tests.bus.frames import Servos, can_read, can_value

COUNT = 6.283185307179586 / 4096
NOISY = "seed 3; 2%: drop; 2%: corrupt; 1%: delay 0.001-0.05"


class Arm:
    """Three simulated FEETECH servos with torque; `batch` orders a goal of each (rad) and asks for all positions."""

    def __init__(self, stack: ExitStack, clock: str = "virtual") -> None:
        self.sim: Simulation = stack.enter_context(motorbus.simulate("feetech", ids="1-3", clock=clock))
        self.bus: Bus = stack.enter_context(motorbus.open(self.sim.url))
        servos = [feetech.Servo(self.bus, node) for node in (1, 2, 3)]
        for servo in servos:
            servo.prepare()
            servo.enable_torque()
        self._write = feetech.ServoGroup(servos).write("goal_position")
        self._read = feetech.ServoGroup(servos).positions

    def batch(self, goal: float = 3.0) -> list[Any]:
        return [self._write([goal] * 3), self._read]


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as made:
        yield made


@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_a_batch_orders_and_reads(stack: ExitStack, clock: str) -> None:
    arm = Arm(stack, clock)
    for _ in range(20):
        nothing, found = arm.bus.exchange(arm.batch())
        assert (nothing, found.missing) == (None, ())
    assert arm.sim[1].memory["goal_position"] == round(3.0 / COUNT)


def test_every_value_is_that_of_its_own_cycle_on_a_noisy_line(stack: ExitStack) -> None:
    arm, right = Arm(stack), 0
    arm.sim.faults = NOISY
    for number in range(400):
        place = 100 + 37 * number % 900
        for node in (1, 2, 3):
            arm.sim[node].raw_position = place
        _, found = arm.bus.exchange(arm.batch(place * COUNT), (MotorbusError,))
        if not isinstance(found, MotorbusError):
            assert all(abs(value - place * COUNT) < COUNT for value in found.values.values()), number
            right += len(found.values)
    assert right > 800


def test_buses_with_a_silent_one_among_them(stack: ExitStack) -> None:
    arms = [Arm(stack) for _ in range(3)]
    arms[1].bus.link.unplug()  # type: ignore[attr-defined]
    found = exchange_on({arm.bus: arm.batch() for arm in arms})
    assert isinstance(found[arms[1].bus], MotorbusError)
    for arm in (arms[0], arms[2]):
        assert found[arm.bus][1].missing == ()
        assert arm.bus.exchange(arm.batch())[1].missing == ()


def test_an_order_that_is_refused_is_raised_and_leaves_the_bus_usable(stack: ExitStack) -> None:
    arm = Arm(stack)
    arm.bus.exchange(arm.batch())
    arm.bus.estop()
    with pytest.raises(motorbus.Interrupted):
        arm.bus.exchange(arm.batch())
    arm.bus.reset()
    feetech.Servo(arm.bus, 1).position()


def test_what_is_no_request_is_refused(stack: ExitStack) -> None:
    arm = Arm(stack)
    with pytest.raises(RequestError, match="is not a request"):
        arm.bus.exchange([feetech.Servo(arm.bus, 1).position])  # type: ignore[list-item]
    assert arm.bus.exchange([]) == []


def test_a_batch_that_is_torn_off_leaves_every_bus_free(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other threads use both buses at once, a signal is raised at once, and no old reply is taken."""
    arms = [Arm(stack, "real") for _ in range(2)]
    work = {arm.bus: arm.batch() for arm in arms}
    for _ in range(3):
        exchange_on(work)

    def tear(until: float) -> Any:
        raise KeyboardInterrupt

    for arm in arms:
        with monkeypatch.context() as patched:
            receive = arm.bus.link.read
            patched.setattr(
                arm.bus.link,
                "read",
                lambda until, receive=receive: tear(until) if until > 0 else receive(until),
            )
            with pytest.raises(KeyboardInterrupt):
                exchange_on(work)
        for one in arms:
            one.sim[1].raw_position = place = one.sim[1].raw_position + 400
            found: list[float] = []
            read = feetech.Servo(one.bus, 1).position
            thread = threading.Thread(target=lambda read=read, found=found: found.append(read()), daemon=True)
            thread.start()
            thread.join(10)
            assert found == [pytest.approx(place * COUNT, abs=100 * COUNT)]  # it moves back to its goal
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_the_value_of_an_order_is_the_same_on_an_idle_and_a_busy_bus(stack: ExitStack) -> None:
    arm = Arm(stack)
    order, read = arm.batch()
    order = Request(order.wire, decode=lambda answer: "sent")
    for _ in range(4):
        assert arm.bus.exchange([order, read])[0] == "sent"
    plain: Request[Any] = Request(order.wire)
    for _ in range(2):
        assert isinstance(arm.bus.exchange([plain, read])[0], Response)


def test_can_frames_of_a_batch_are_written_one_by_one() -> None:
    can = Engine("kst")
    can.wire.answer = lambda frame: Servos()(frame) if frame.id > 0x600 else []
    order: Request[Any] = Request(CanFrame(0x123, b"\1"))
    read = can_read(1)
    read.decode_exact = lambda frame, at: can_value([frame.data])
    for _ in range(3):
        assert can.bus.exchange([order, read])[1] == 100
    assert can.sent() == [order.wire, read.wire] * 3


def test_reads_of_tasks_on_a_real_clock_are_fresh_also_after_a_cancellation() -> None:
    async def read(sim: Simulation, servo: Any, count: int) -> int:
        right = 0
        for number in range(count):
            sim[servo.node].raw_position = place = 100 + 37 * number % 900
            try:
                value = await asyncio.wait_for(servo.position(), None if number % 10 else 0.0005)
            except (MotorbusError, TimeoutError):
                continue
            assert abs(value - place * COUNT) < COUNT, number
            right += 1
        return right

    async def main() -> None:
        with motorbus.simulate("feetech", ids="1-3", clock="real") as sim:
            async with motorbus.open_async(sim.url) as bus:
                servos = [feetech.AsyncServo(bus, node) for node in (1, 2, 3)]
                assert await read(sim, servos[0], 60) > 40
                sim.faults = NOISY
                found = await asyncio.gather(*(read(sim, servo, 60) for servo in servos))
                assert sum(found) > 100

    asyncio.run(main())


def test_a_read_after_one_that_was_torn_off_is_fresh(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A handler of the program may raise while a reply is awaited; that reply then answers no later request."""
    arm = Arm(stack)
    servo, link = feetech.Servo(arm.bus, 1), arm.bus.link
    for read in (servo.position, lambda: arm.bus.exchange(arm.batch())[1].values[1]):
        for _ in range(3):
            read()
        with monkeypatch.context() as patched:
            receive = link.read

            def tear(until: float, receive: Any = receive) -> Any:
                if until > link.now():
                    raise KeyboardInterrupt
                return receive(until)

            patched.setattr(link, "read", tear)
            with pytest.raises(KeyboardInterrupt):
                read()
        for place in (500, 700, 900):
            arm.sim[1].raw_position = place
            assert abs(read() - place * COUNT) < COUNT


def test_virtual_and_real_time_do_not_mix(stack: ExitStack) -> None:
    arms = [Arm(stack), Arm(stack, "real")]
    with pytest.raises(RequestError, match="virtual time"):
        run_on({arm.bus: arm.batch()[1] for arm in arms})
