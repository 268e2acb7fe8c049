"""A move that is interrupted or cancelled stops the device, which holds; one that is not waited for goes on."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import pytest

import motorbus
from motorbus.link.base import PerfectLine
from motorbus.simulation.named import Simulation


class Kind(NamedTuple):
    """A simulated device, and a move of it that takes more than a second."""

    family: str
    options: dict[str, Any]
    way: float
    bounds: dict[str, float]


KINDS = [
    Kind("feetech", {"model": "sts3215"}, -1.0, {"velocity": 0.6}),
    Kind("feetech", {"model": "hls3925"}, -1.0, {"velocity": 0.6}),
    Kind("feetech", {"model": "scs0009"}, -1.0, {"velocity": 0.6}),
    Kind("kst", {}, 0.7, {}),
]
EVERY = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.options.get("model", kind.family))


def simulated(kind: Kind) -> Simulation:
    """This device; the speed of a KST servo is no option."""
    sim = motorbus.simulate(kind.family, **kind.options)
    if kind.family == "kst":
        for node in sim.simulator.nodes:
            sim[node].speed = 0.5
    return sim


class Line(PerfectLine):
    """Calls `act` once, at the first frame of `number` or the first one from the moment `at` (s) on."""

    def __init__(self, act: Callable[[], object], *, number: int = 0, at: float = 0.0) -> None:
        self.act, self.number, self.at = act, number, at
        self.done, self.frames = False, 0

    def carry(self, *frame: Any) -> Any:
        self.frames += 1
        if not self.done and self.frames >= self.number and frame[2] >= self.at:
            self.done = True
            self.act()
        return super().carry(*frame)


def interrupt() -> None:
    raise KeyboardInterrupt


def device(bus: Any, kind: Kind, awaited: bool = False) -> Any:
    name = "AsyncServo" if awaited else "Servo"
    return getattr(getattr(motorbus, kind.family), name)(bus, 1)


@contextmanager
def opened(kind: Kind) -> Iterator[tuple[Simulation, Any, float]]:
    """The simulation, its device on an open bus with torque on where it has a switch, and its goal."""
    with simulated(kind) as sim, motorbus.open(sim.url) as bus:
        servo = device(bus, kind)
        if hasattr(servo, "enable_torque"):
            servo.enable_torque()
        yield sim, servo, servo.position() + kind.way


def notes(error: BaseException) -> str:
    return "\n".join(getattr(error, "__notes__", ()))


def told_place(text: str) -> float:
    """The position (rad) at which a note says that device 1 holds."""
    found = re.fullmatch(r"#1: holds at (-?\d+\.\d+) rad \(.*°\)", text)
    assert found, text
    return float(found[1])


def assert_holds(sim: Simulation, servo: Any, goal: float, place: float | None = None) -> None:
    """It stands off its goal, where it was said to stand, and stays there."""
    here = servo.position()
    assert place is None or here == pytest.approx(place, abs=0.002)
    assert abs(here - goal) > 0.1
    sim.wait(sim.now + 3)
    assert servo.position() == pytest.approx(here, abs=0.002)


@EVERY
def test_ctrl_c_stops_it_and_says_where_it_holds(kind: Kind) -> None:
    with opened(kind) as (sim, servo, goal):
        sim.line = Line(interrupt, at=sim.now + 0.4)
        with pytest.raises(KeyboardInterrupt) as caught:
            servo.move(goal, **kind.bounds)
        assert_holds(sim, servo, goal, told_place(notes(caught.value)))
        servo.move(goal, **kind.bounds)
        assert servo.position() == pytest.approx(goal, abs=0.05)


@EVERY
@pytest.mark.parametrize("number", [*range(1, 24), 40, 41])
def test_ctrl_c_at_any_frame_leaves_nothing_moving(kind: Kind, number: int) -> None:
    with opened(kind) as (sim, servo, goal):
        sim.line = Line(interrupt, number=number)
        with pytest.raises(KeyboardInterrupt):
            servo.move(goal, **kind.bounds)
        assert_holds(sim, servo, goal)


@EVERY
@pytest.mark.parametrize("how", ["cancel", "timeout", "close"])
def test_what_ends_a_task_stops_its_move_and_a_closed_coroutine_sends_nothing(kind: Kind, how: str) -> None:
    async def ended(sim: Simulation, servo: Any, goal: float) -> BaseException | None:
        moving = servo.move(goal, **kind.bounds)
        task = asyncio.create_task(moving)
        if how == "close":
            while sim.now < 0.4:
                await asyncio.sleep(0)
            sim.line = Line(lambda: pytest.fail("sent by a closed coroutine"))
            moving.close()
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError, RuntimeError):  # its coroutine is closed
                await task
            sim.line = PerfectLine()
            return None
        try:
            async with asyncio.timeout(None) as limit:
                loop = asyncio.get_running_loop()
                stop = task.cancel if how == "cancel" else lambda: limit.reschedule(loop.time())
                sim.line = Line(lambda: loop.call_soon(stop), at=sim.now + 0.4)
                await task
        except (TimeoutError, asyncio.CancelledError) as error:
            return error.__cause__ if how == "timeout" else error
        raise AssertionError("it was not ended")

    async def main() -> None:
        with simulated(kind) as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo = device(bus, kind, awaited=True)
                goal = await servo.position() + kind.way
                error = await ended(sim, servo, goal)
                place = None if error is None else told_place(notes(error))
            with motorbus.open(sim.url) as blocking:
                if place is not None:
                    assert_holds(sim, device(blocking, kind), goal, place)
                    return
                sim.wait(sim.now + 3)
                assert device(blocking, kind).position() == pytest.approx(goal, abs=0.05)

    asyncio.run(main())


@EVERY
def test_without_waiting_it_goes_on(kind: Kind) -> None:
    with opened(kind) as (sim, servo, goal):
        servo.move(goal, wait=False, **kind.bounds)
        sim.line = Line(interrupt)
        with pytest.raises(KeyboardInterrupt):
            servo.position()
        sim.line = PerfectLine()
        sim.wait(sim.now + 3)
        assert servo.position() == pytest.approx(goal, abs=0.05)


@EVERY
@pytest.mark.parametrize("wait", [True, False])
def test_a_newer_move_survives_the_end_of_the_older(kind: Kind, wait: bool) -> None:
    async def main() -> None:
        with simulated(kind) as sim:
            async with motorbus.open_async(sim.url) as bus:
                servo = device(bus, kind, awaited=True)
                start = await servo.position()
                task = asyncio.create_task(servo.move(start + kind.way, **kind.bounds))
                while abs(await servo.position() - start) < 0.1:
                    pass
                task.cancel()
                await servo.move(start, wait=wait, **kind.bounds)
                with pytest.raises(asyncio.CancelledError):
                    await task
                sim.wait(sim.now + 3)
                assert await servo.position() == pytest.approx(start, abs=0.05)

    asyncio.run(main())


@EVERY
def test_a_device_that_does_not_answer_its_stop_is_named_with_the_command(kind: Kind) -> None:
    with opened(kind) as (sim, servo, goal):

        def cut() -> None:
            sim[1].unplug()
            raise KeyboardInterrupt

        sim.line = Line(cut, at=sim.now + 0.4)
        with pytest.raises(KeyboardInterrupt) as caught:
            servo.move(goal, **kind.bounds)
        said = notes(caught.value)
        assert said.startswith("#1 may still be moving: node 1 did not answer")
        assert said.endswith("`motorbus stop BUS#1` stops it")


def test_a_servo_that_was_made_limp_meanwhile_stays_limp() -> None:
    with opened(KINDS[0]) as (sim, servo, goal):

        def limp() -> None:
            sim[1].memory["torque_enable"] = 0
            raise KeyboardInterrupt

        sim.line = Line(limp, at=sim.now + 0.4)
        with pytest.raises(KeyboardInterrupt) as caught:
            servo.move(goal, velocity=0.6)
        assert notes(caught.value).startswith("#1: its torque is off at ")
        assert servo.read("torque_enable") == {"torque_enable": False}


def test_an_interrupted_step_ends_with_torque_off() -> None:
    """A servo in step mode cannot be stopped: it finishes its steps as long as it has torque."""
    with opened(KINDS[0]) as (sim, servo, _):
        servo.set_mode("step")
        sim.line = Line(interrupt, at=sim.now + 0.4)
        with pytest.raises(KeyboardInterrupt) as caught:
            servo.step(1.0, velocity=0.6)
        assert notes(caught.value).startswith("#1: torque off accepted")
        assert servo.read("torque_enable") == {"torque_enable": False}
