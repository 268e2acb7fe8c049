"""Inputs as they are read: believed at the second reading that agrees, watched at the rate that the line gives."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import motorbus
from motorbus.errors import FramingError, NoReply, RequestError
from motorbus.families.stepper import AsyncController, Controller
from motorbus.families.stepper.driver import InputChanged
from motorbus.families.stepper.driver.inputs import Levels, checked
from tests.families.stepper.bench import Tampering, bench


class Flipping(Tampering):
    """Changes the level of each so-many-th reading of an input."""

    def __init__(self, every: int) -> None:
        super().__init__()
        self.every, self.seen = every, 0

    def change(self, data: bytes, number: int) -> bytes:
        if data[2:4] != b"\x00\x0b":
            return data
        self.seen += 1
        return data[:5] + bytes((data[5] ^ 1,)) if self.seen % self.every == 0 else data


def test_each_input_is_read_twice() -> None:
    with bench() as there:
        there.simulated.set_input(2, True)
        there.simulated.set_input(5, True)
        there.device.ping()
        there.sent()
        assert there.device.inputs() == {1: False, 2: True, 3: False, 4: False, 5: True}
        assert len(there.sent()) == 10
        assert there.device.inputs((5, 1, 5)) == {5: True, 1: False}
        assert there.device.inputs(()) == {}


@pytest.mark.parametrize("every", [2, 3, 4])
def test_a_reading_that_nothing_confirms_is_not_believed(every: int) -> None:
    with bench(line=Flipping(every)) as there:
        there.simulated.set_input(2, True)
        if every == 2:
            with pytest.raises(FramingError, match="another one each of 5 times"):
                there.device.inputs((2,))
        else:
            assert there.device.inputs((2,)) == {2: True}


def test_changes_are_reported_when_they_are_believed() -> None:
    with bench() as there:
        there.device.ping()
        now = there.link.now()
        there.simulator.press(1, True, now + 1.0)
        there.simulator.press(3, True, now + 1.5)
        there.simulator.press(1, False, now + 2.0)
        watched = there.device.watch_inputs((1, 3), 3.0)
    told = [event for event in there.events if isinstance(event, InputChanged)]
    assert tuple(told) == watched.changes
    assert [(one.port, one.active) for one in told] == [(1, True), (3, True), (1, False)]
    assert [one.at - now for one in told] == pytest.approx([1.0, 1.5, 2.0], abs=0.01)
    assert watched.levels == {1: False, 3: True}
    assert watched.seconds == pytest.approx(3.0, abs=0.01)


def test_what_is_active_at_first_is_no_change() -> None:
    with bench() as there:
        there.simulated.set_input(4, True)
        watched = there.device.watch_inputs((4,), 0.5)
        assert (watched.changes, watched.levels) == ((), {4: True})


def test_one_wrong_reading_is_no_change() -> None:
    with bench(line=Flipping(7)) as there:
        watched = there.device.watch_inputs((1,), 2.0)
        assert watched.rounds > 100
        assert (watched.changes, watched.levels) == ((), {1: False})


@pytest.mark.parametrize(("ports", "rate"), [((1,), 1000 / 19.7083), ((1, 2, 3, 4, 5), 1000 / 19.7083 / 5)])
def test_the_rate_is_what_the_line_gives(ports: tuple[int, ...], rate: float) -> None:
    """17.7 ms of line and 2 ms of thinking for each reading."""
    with motorbus.simulate("stepper") as simulation:
        simulation.pace = True
        with motorbus.open(simulation.url) as bus:
            watched = Controller(bus).watch_inputs(ports, 20.0)
    assert watched.rate == pytest.approx(rate, rel=0.01)
    assert watched.rounds == pytest.approx(rate * 20, rel=0.01)


def test_a_stop_goes_between_two_readings() -> None:
    with bench() as there:
        stopped: list[object] = []

        def stop(event: object) -> None:
            if isinstance(event, InputChanged):
                stopped.append(there.device.stop())

        there.simulator.press(1, True, 1.0)
        there.bus.report = stop
        watched = there.device.watch_inputs((1,), 2.0)
        assert len(stopped) == len(watched.changes) == 1


def test_silence_is_no_level() -> None:
    with bench() as there:
        there.device.ping()
        there.simulated.unplug()
        with pytest.raises(NoReply):
            there.device.watch_inputs((1,), 1.0)


@pytest.mark.parametrize("ports", [(0,), (6,), (1, 7), (True,), ("1",), (1.0,), 3.5, None, "12", (None,)])
def test_an_input_that_there_is_not_is_refused(ports: Any) -> None:
    with bench() as there:
        looks: tuple[Callable[[], object], ...] = (
            lambda: there.device.inputs(ports),
            lambda: there.device.watch_inputs(ports, 1.0),
            lambda: there.device.run(1, watch=ports),
        )
        for look in looks:
            with pytest.raises(RequestError, match=r"there is no input.*|nothing was sent"):
                look()
        assert there.sent() == []


@pytest.mark.parametrize("seconds", [0, -1, float("nan"), float("inf"), "5", None, True])
def test_a_time_that_is_none_is_refused(seconds: Any) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="seconds: "):
            there.device.watch_inputs((1,), seconds)
        with pytest.raises(RequestError, match="no input is named"):
            there.device.watch_inputs((), 1.0)
        assert there.sent() == []


def test_a_single_number_is_one_input() -> None:
    single: Any = 2
    assert checked(single) == (2,)
    assert checked([3, 1, 3]) == (3, 1)


def test_a_level_is_believed_at_the_second_reading_in_a_row() -> None:
    levels = Levels({1: False})
    assert levels.take(1, True, 1.0) is None
    assert levels.take(1, False, 2.0) is None
    assert levels.take(1, True, 3.0) is None
    assert levels.take(1, True, 4.0) == InputChanged(1, True, 3.0)
    assert levels.take(1, True, 5.0) is None
    assert levels.believed == {1: True}


def test_watching_can_be_awaited() -> None:
    async def looked() -> tuple[dict[int, bool], int]:
        with motorbus.simulate("stepper") as simulation:
            async with motorbus.open_async(simulation.url) as bus:
                one = AsyncController(bus)
                return await one.inputs((1, 2)), (await one.watch_inputs((1,), 0.5)).rounds

    levels, rounds = asyncio.run(looked())
    assert levels == {1: False, 2: False}
    assert rounds > 100
