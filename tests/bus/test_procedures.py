"""Procedures of several steps: values, errors and clean-up go where they belong, and what is cancelled closes up."""

from __future__ import annotations

import asyncio
import gc
from threading import Thread
from typing import Any

import pytest

import motorbus
from motorbus.core.steps import (
    Emit,
    Exclusive,
    JournalEntry,
    Procedure,
    Progress,
    SetBitrate,
    Sleep,
    catch,
    gather,
    with_cleanup,
)
from motorbus.errors import LinkError, NoReply, RequestError
from tests.bus.adapter import Cancelled, Effect, Engine
from tests.bus.frames import Servos, can_move, can_read, read, read_frame, write, write_frame

LOCK = 55


@pytest.fixture
def engine() -> Engine:
    engine = Engine(answer=Servos())
    engine.wire.answer = Servos()
    return engine


@pytest.fixture
def can() -> Engine:
    engine = Engine("kst")
    engine.wire.answer = Servos()
    return engine


def lock(node: int, closed: int) -> Any:
    return write(node, closed, address=LOCK, effect=Effect.PERSISTENT, repeatable=True)


def guarded(node: int, work: Any = None) -> Procedure[None]:
    """Open the lock, change something, close the lock whatever happens."""

    async def change() -> None:
        await lock(node, 0)
        await (work or write(node, 9, repeatable=True))

    return with_cleanup(change(), lambda: lock(node, 1))


async def turning(*rests: float) -> None:
    """Wait for ever; then wait for something to come to rest, and write."""
    try:
        await Sleep(1e9)
    finally:
        for rest in rests:
            await catch(Sleep(rest))
        await catch(write(1, 9))


def test_each_step_gives_its_value(engine: Engine) -> None:
    async def everything() -> list[Any]:
        values: list[Any] = [await read(1)]
        values += await gather(read(2), read(3))
        none: list[Any] = []
        values.append(await gather(*none))
        values.append(await Sleep(3600.0) > 3600.0)
        values += [await SetBitrate(500_000), await SetBitrate(0), await read(4)]
        return values

    assert engine.run(everything()) == [100, 200, 300, (), True, 1_000_000, 500_000, 400]
    assert engine.bus.rate == engine.wire.rate == 500_000


def test_one_failure_of_several_stops_none_of_the_others(engine: Engine) -> None:
    engine.wire.answer = servos = Servos()
    servos.silent = {2, 4}

    async def several() -> list[Any]:
        return list(await gather(*[read(node) for node in (1, 2, 3, 4)]))

    with pytest.raises(NoReply, match="node 2") as caught:
        engine.run(several())
    assert "node 4" in "".join(caught.value.__notes__)
    assert {frame[2] for frame in engine.sent()} == {1, 2, 3, 4}


def test_reports_are_handed_over_before_the_next_step_and_what_they_raise_comes_back(engine: Engine) -> None:
    seen: list[tuple[object, int]] = []

    async def work() -> None:
        try:
            for done in range(2):
                await Emit(Progress(done, 2))
                await read(1)
        finally:
            await lock(1, 1)

    engine.bus.run(work(), report=lambda event: seen.append((event, len(engine.wire.sent))))
    assert seen == [(Progress(0, 2), 0), (Progress(1, 2), 1)]
    engine.sent()

    def full(event: object) -> None:
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        engine.bus.run(work(), report=full)
    assert engine.sent() == [write_frame(1, LOCK, 1)]


def test_without_a_journal_a_guarded_change_is_refused_before_it_begins(engine: Engine) -> None:
    async def change() -> None:
        await Emit(JournalEntry("set_id", "begun", {}))
        await write(1, 2, address=5)

    with pytest.raises(RequestError, match="keeps no journal"):
        engine.run(change())
    assert engine.sent() == []


@pytest.mark.parametrize("after", [0.0, 0.0005, 0.001, 0.0015])
def test_a_cancelled_change_closes_its_lock_at_every_step(engine: Engine, after: float) -> None:
    async def both() -> Any:
        return await gather(*[guarded(node, Sleep(0.001)) for node in (1, 2)])

    engine.submit("a", both())
    engine.advance(after)
    engine.cancel("a")
    engine.advance(1.0)
    assert isinstance(engine.result("a"), Cancelled)
    sent = engine.sent()
    for node in (1, 2):
        if write_frame(node, LOCK, 0) in sent:
            assert [frame for frame in sent if frame[2] == node][-1] == write_frame(node, LOCK, 1)
    assert engine.run(read(1)) == 100


@pytest.mark.parametrize(("rest", "reached"), [(0.4, True), (5.0, True), (29.0, True), (31.0, False)])
def test_a_clean_up_gets_its_time_to_come_to_rest(engine: Engine, rest: float, reached: bool) -> None:
    engine.submit("a", turning(rest))
    engine.cancel("a")
    engine.advance(40.0)
    assert isinstance(engine.result("a"), Cancelled)
    assert (write_frame(1, 20, 9) in engine.sent()) is reached


def test_a_clean_up_that_does_not_end_is_given_up_and_a_second_cancel_shortens_it(engine: Engine) -> None:
    begun = engine.now
    engine.submit("a", turning(*[1.0] * 1000))
    engine.submit("b", turning(20.0))
    for name in ("a", "b", "b"):
        engine.cancel(name)
    engine.advance(0.3)
    assert isinstance(engine.result("b"), Cancelled)
    engine.advance(100.0)
    assert isinstance(engine.result("a"), Cancelled)
    assert engine.now - begun < 101
    assert engine.run(read(1)) == 100


def test_what_a_clean_up_failed_with_goes_with_the_cancellation_once(engine: Engine) -> None:
    async def failing(text: str) -> None:
        try:
            await Sleep(1e9)
        finally:
            raise RequestError(text)

    async def several() -> Any:
        return await gather(failing("it may turn"), failing("it may turn"), failing("so may this"))

    engine.submit("a", several())
    engine.cancel("a")
    engine.advance(1.0)
    assert engine.result("a").__notes__ == ["it may turn", "so may this"]


def test_a_rate_that_the_link_refuses_fails_the_change_only(
    can: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(rate: int) -> None:
        raise LinkError("this adapter cannot")

    monkeypatch.setattr(can.link, "tune", refuse)
    with pytest.raises(LinkError, match="cannot"):
        can.run(SetBitrate(125_000))
    assert can.bus.rate == 500_000
    assert can.run(can_read(1)) == 100


def test_a_stop_is_sent_at_the_rate_at_which_nodes_answered(can: Engine) -> None:
    can.run(can_read(1, reports_position=True))
    can.run(SetBitrate(125_000))
    assert can.estop().acknowledged == (1,)
    assert can.bus.rate == can.wire.rate == 500_000


def test_after_a_motion_order_a_stop_asks_where_the_node_is(can: Engine) -> None:
    for node in (1, 2):
        can.run(can_read(node, reports_position=True))
    can.run(can_move(1, 500))
    can.wire.answer = servos = Servos(lambda node: 333)
    servos.silent = {3}
    can.sent()
    assert sorted(can.estop().acknowledged) == [1, 2]
    goals = {frame.id: frame.data[4:6] for frame in can.sent() if frame.data[0] == 0x22}
    assert goals == {0x601: (333).to_bytes(2, "little"), 0x602: (200).to_bytes(2, "little")}


def test_a_procedure_that_awaits_no_step_raises_an_error_that_names_the_steps(engine: Engine) -> None:
    async def foreign() -> None:
        await asyncio.sleep(0)

    with pytest.raises(RequestError, match="which is no step") as caught:
        engine.run(foreign())
    assert "asyncio.sleep" in caught.value.cause
    assert engine.run(read(1)) == 100


def test_a_step_awaited_outside_of_a_procedure_names_run() -> None:
    async def awaits_a_step() -> None:
        await Sleep(0.1)

    with pytest.raises(RequestError, match="Sleep was awaited outside of a procedure") as caught:
        asyncio.run(awaits_a_step())
    assert "await bus.run(...)" in caught.value.advice


def test_a_bus_called_inside_of_a_procedure_sends_nothing_and_names_the_driver_function(
    engine: Engine,
) -> None:
    async def nested() -> Any:
        return await read(2) + engine.bus.run(guarded(1, read(1)))

    with pytest.raises(RequestError, match="inside of a procedure") as caught:
        engine.run(nested())
    assert "Servo.position.function(servo)" in caught.value.expected
    assert engine.sent() == [read_frame(2)]


@pytest.mark.parametrize("wrong", [0.5, None, print, [1]])
def test_what_is_neither_procedure_nor_step_is_refused(engine: Engine, wrong: Any) -> None:
    with pytest.raises(RequestError, match="neither a procedure nor a step"):
        engine.bus.run(wrong)
    with pytest.raises(RequestError, match="neither a procedure nor a step"):
        engine.bus.run(gather(read(1), wrong))
    assert engine.run(read(1)) == 100


@pytest.mark.parametrize("call", ["run", "exchange"])
def test_a_blocking_call_inside_a_procedure_is_refused(engine: Engine, call: str) -> None:
    """It would wait for the procedure that it stops."""

    async def inside() -> Any:
        return engine.bus.run(read(1)) if call == "run" else engine.bus.exchange([read(1)])

    for procedure in (inside, lambda: Exclusive(inside())):
        with pytest.raises(RequestError, match="called inside of a procedure"):
            engine.run(procedure())
        assert engine.run(read(1)) == 100


def test_what_a_bus_refuses_is_closed() -> None:
    """A coroutine that never starts would be reported as a warning, which is an error here."""

    async def never() -> None:
        raise AssertionError

    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        assert motorbus.feetech.Servo(bus, 1).ping()
        with pytest.raises(RequestError):
            bus.exchange([never()])  # type: ignore[list-item]
        errors: list[BaseException] = []

        def use() -> None:
            try:
                bus.run(never())
            except RequestError as error:
                errors.append(error)

        thread = Thread(target=use)
        thread.start()
        thread.join()
        assert len(errors) == 1
    gc.collect()
