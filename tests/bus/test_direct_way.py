"""A single request on an idle bus leaves without a task; what follows then is as with one."""

from __future__ import annotations

import asyncio
import contextlib
import time
from typing import Any

import pytest

import motorbus
from motorbus import feetech, kst
from motorbus.bus.blocking import exchange_on
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data, Effect, Request
from motorbus.core.steps import Emit, Sleep, gather
from motorbus.errors import LinkError, LinkFull, LinkLost, MotorbusError, UnexpectedReply
from motorbus.link.base import Delivery, Side

BEAT = CanFrame(0x702, b"\x05")


class Line:
    """Delivers each reply as `shape` says."""

    def __init__(self, shape: Any) -> None:
        self.shape = shape

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        to = Side.DEVICE if sender is Side.HOST else Side.HOST
        parts = [(0.0, data)] if to is Side.DEVICE else self.shape(data)
        return [Delivery(at + later, to, part) for later, part in parts]


@pytest.mark.parametrize(
    "shape", [lambda data: [(0.0, BEAT), (0.0, data)], lambda data: [(0.0, data), (0.0, BEAT)]]
)
def test_a_notice_beside_a_reply_loses_neither(shape: Any) -> None:
    with motorbus.simulate("kst", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        servo = kst.Servo(bus, 1)
        here = servo.position()
        notices, begun = bus.notices.subscribe(), bus.now()
        sim.line = Line(shape)
        for _ in range(5):
            assert servo.position() == here
        assert bus.now() - begun < 0.01
        assert len(notices) == 5


def test_a_doubled_reply_on_can_is_no_answer() -> None:
    with motorbus.simulate("kst", ids="1") as sim, motorbus.open(sim.url) as bus:
        servo = kst.Servo(bus, 1)
        servo.position()
        sim.line = Line(lambda data: [(0.0, data), (0.0, data)])
        with pytest.raises(UnexpectedReply):
            servo.position()


def test_a_byte_behind_each_reply_ends_a_call() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        servo = feetech.Servo(bus, 1)
        servo.position()
        sim.line = Line(lambda data: [(0.0, data), (3e-5, b"\0")])
        for _ in range(5):
            begun = bus.now()
            with contextlib.suppress(MotorbusError):
                servo.position()
            assert bus.now() - begun < 1.0


def test_a_kept_request_of_a_task_may_be_run_meanwhile() -> None:
    with motorbus.simulate("feetech", ids="1-3") as sim, motorbus.open(sim.url) as bus:
        servos = [feetech.Servo(bus, node) for node in (1, 2, 3)]
        for servo in servos:
            servo.prepare()
        read = feetech.ServoGroup(servos).positions
        seen: list[Any] = []

        async def both() -> Any:
            async def emit() -> None:
                await Emit("look")

            return await gather(read, emit())

        bus.run(read)
        bus.run(both(), lambda event: seen.append(bus.run(read)))
        assert len(seen[0].values) == 3


def test_a_position_that_did_not_come_with_a_group_counts_no_more() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        servos = [feetech.Servo(bus, node) for node in (1, 2)]
        for servo in servos:
            servo.prepare()
        read = feetech.ServoGroup(servos).positions
        bus.run(read)
        bus.run(read)
        assert set(bus.positions) == {1, 2}
        sim[2].unplug()
        assert bus.run(read).missing == (2,)
        assert set(bus.positions) == {1}


def _with_goals(sim: Any, bus: Any) -> list[Any]:
    servos = [feetech.Servo(bus, node) for node in (1, 2, 3)]
    for servo in servos:
        servo.prepare()
        servo.enable_torque()
    goals = feetech.ServoGroup(servos).write("goal_position")
    return [goals([3.1] * 3), feetech.ServoGroup(servos).positions]


@pytest.mark.parametrize("several", [False, True])
def test_an_order_that_left_in_part_is_not_sent_again(several: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech", ids="1-3", clock="real") as sim, motorbus.open(sim.url) as bus:
        batch = _with_goals(sim, bus)
        sent: list[Data] = []

        def write(data: Data) -> None:
            sent.append(data)
            raise LinkError("6 of 40 bytes went out")

        monkeypatch.setattr(bus.link, "write", write)
        if several:
            assert isinstance(exchange_on({bus: batch})[bus], LinkError)
        else:
            with pytest.raises(LinkError, match="6 of 40"):
                bus.exchange(batch)
        assert len(sent) == 1


def test_a_lost_port_is_noted_where_its_error_is_tolerated(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech", ids="1-3", clock="real") as sim, motorbus.open(sim.url) as bus:
        batch = _with_goals(sim, bus)
        read = bus.link.read

        def lose(until: float) -> list[Data]:
            if until > 0:
                raise LinkLost("gone")
            return read(until)

        monkeypatch.setattr(bus.link, "read", lose)
        _, error = bus.exchange(batch, (MotorbusError,))
        assert isinstance(error, LinkLost)
        assert bus.engine.losses == 1


def test_a_kept_request_waits_for_a_full_link_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech", ids="1", clock="real") as sim, motorbus.open(sim.url) as bus:
        servo = feetech.Servo(bus, 1)
        here, write, full = servo.position(), bus.link.write, list[bool]()

        def fill(data: Data) -> None:
            if full:
                full.pop()
                raise LinkFull("full")
            write(data)

        monkeypatch.setattr(bus.link, "write", fill)
        for times in (2, 1, 1):
            full += [True] * times
            assert servo.position() == here


def test_replies_that_wait_for_a_late_host_are_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech", ids="1-6", clock="real") as sim, motorbus.open(sim.url) as bus:
        servos = [feetech.Servo(bus, node) for node in range(1, 7)]
        for servo in servos:
            servo.prepare()
        read, write = feetech.ServoGroup(servos).positions, bus.link.write
        bus.run(read)

        def stall(data: Data) -> None:
            write(data)
            time.sleep(0.06)

        monkeypatch.setattr(bus.link, "write", stall)

        async def task() -> Any:
            return await read

        for _ in range(3):
            assert bus.run(read).missing == ()
            assert bus.run(task()).missing == ()
        assert bus.statistics.other["late"] == 0


# -- the worker of an asyncio bus ------------------------------------------------------------------------------


@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_a_task_that_polls_ends_when_it_is_cancelled(clock: str) -> None:
    async def main() -> None:
        with motorbus.simulate("feetech", ids="1", clock=clock) as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo = feetech.AsyncServo(bus, 1)
                await servo.position()

                async def poll() -> None:
                    while True:
                        await servo.position()

                for _ in range(20):
                    task = asyncio.create_task(poll())
                    await asyncio.sleep(0.002)
                    task.cancel()
                    with pytest.raises(asyncio.CancelledError):
                        await asyncio.wait_for(asyncio.shield(task), 5)

    asyncio.run(main())


@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_an_error_of_one_call_ends_no_other_one(clock: str) -> None:
    def refuse(stops: object) -> MotorbusError | None:
        raise ValueError("of the driver")

    async def other() -> str:
        await Sleep(0.05)
        return "value"

    async def main() -> None:
        with motorbus.simulate("feetech", ids="1", clock=clock) as sim:
            async with motorbus.open_async(sim.url) as bus:
                bus.interlock = _Admit()
                order: Request[Any] = Request(
                    b"\xff\xff\x01\x04\x03\x28\x00\xcf", (), effect=Effect.TORQUE, precondition=refuse
                )
                waiting = asyncio.create_task(bus.run(other()))
                await asyncio.sleep(0)
                with pytest.raises(ValueError, match="of the driver"):
                    await bus.run(order)
                assert await asyncio.wait_for(waiting, 5) == "value"
                assert await feetech.AsyncServo(bus, 1).ping()

    asyncio.run(main())


class _Admit:
    def check(self, request: Request[Any], now: float) -> None: ...

    def stopped(self, nodes: object) -> None: ...
