"""No value that a call returns is older than the call, whatever a line does to the replies."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, Final

import pytest

import motorbus
from motorbus import feetech, kst, stepper
from tests.conftest import Rounds
from tests.support.processes import simulator

LATE: Final = "seed 7; 1%: delay 0.001-0.5"
LOST: Final = f"{LATE}; 1%: drop; 1%: corrupt"
ANY: Final = f"{LOST}; 1%: duplicate"
ECHO: Final = f"{ANY}; 100%: echo"
ANGLE: Final = {"feetech": math.tau / 4096, "kst": math.radians(0.1)}
"""rad of one count of the position register."""
IDS: Final = {"feetech": (1, 2, 3), "kst": (0x21, 0x22, 0x23), "stepper": (1,)}
SERVO: Final[dict[str, Callable[[Any, int], Any]]] = {"feetech": feetech.Servo, "kst": kst.Servo}
ASYNC_SERVO: Final[dict[str, Callable[[Any, int], Any]]] = {
    "feetech": feetech.AsyncServo,
    "kst": kst.AsyncServo,
}


class Oracle:
    """Gives each servo of these simulations a new position before a call, and judges what the call returns."""

    def __init__(self, *sims: Any) -> None:
        self.nodes = [(sim, node) for sim in sims for node in IDS[sim.family.name]]
        self.calls = self.right = self.failed = 0

    def change(self, which: int) -> float:
        """Turn one servo to a place where it was not lately; return the place (rad)."""
        sim, node = self.nodes[which]
        self.calls += 1
        sim[node].raw_position = raw = 11 + 131 * self.calls % 400
        return float(raw * ANGLE[sim.family.name])

    def change_all(self) -> list[float]:
        """Turn all servos."""
        return [self.change(which) for which in range(len(self.nodes))]

    def judge(self, expected: Sequence[float], values: Iterable[object]) -> None:
        """Judge a result for each servo."""
        for which, (place, value) in enumerate(zip(expected, values, strict=True)):
            self.judge_one(which, place, value)

    def judge_one(self, which: int, expected: float, value: object) -> None:
        """Judge the result of one call, to half a count; it may be an error."""
        if isinstance(value, motorbus.MotorbusError):
            self.failed += 1
            return
        sim, _ = self.nodes[which]
        assert isinstance(value, float)
        assert abs(expected - value) < ANGLE[sim.family.name] / 2, (
            sim.url,
            which,
            expected,
            value,
            self.calls,
        )
        self.right += 1

    def check(self, *sims: Any) -> None:
        """Faults struck on every bus, and most calls still returned a value."""
        for sim in sims:
            kinds = {fired.fault.kind for fired in sim.faults.fired}
            assert kinds == {fault.kind for fault in sim.faults.script.faults}, kinds
            assert sim.faults.count >= self.calls / len(self.nodes) / 200
        assert self.right > 0.5 * self.calls


def attempt(call: Callable[[], Any]) -> Any:
    """What the call returns, or the error that it raises."""
    try:
        return call()
    except motorbus.MotorbusError as error:
        return error


@pytest.mark.parametrize(
    ("family", "faults"),
    [("feetech", LATE), ("feetech", ANY), ("feetech", ECHO), ("kst", LATE), ("kst", LOST)],
)
def test_blocking_reads_of_one_bus(family: str, faults: str, rounds: Rounds) -> None:
    opened = "100%: echo" if "echo" in faults else ""
    with motorbus.simulate(family, ids=IDS[family], faults=opened) as sim, motorbus.open(sim.url) as bus:
        servos = [SERVO[family](bus, node) for node in IDS[family]]
        sim.faults = faults
        oracle = Oracle(sim)
        for index in range(rounds(200_000, 2_500)):
            which = index // 50 % len(servos)
            expected = oracle.change(which)
            oracle.judge_one(which, expected, attempt(servos[which].position))
        oracle.check(sim)


def test_an_echo_that_comes_and_goes() -> None:
    """Found at open it costs no request; while it differs from then reads fail, and none has a wrong value."""
    with (
        motorbus.simulate("feetech", ids=IDS["feetech"], faults="100%: echo") as sim,
        motorbus.open(sim.url) as bus,
    ):
        servo, oracle = feetech.Servo(bus, 1), Oracle(sim)
        servo.position()
        assert bus.echoes
        trace = bus.trace.subscribe(1_000)
        for script in ("100%: echo", "", "100%: echo", ""):
            sim.faults = script
            for _ in range(50):
                expected = oracle.change(0)
                oracle.judge_one(0, expected, attempt(servo.position))
                requests = sum(record.direction == "tx" for record in trace)
                assert requests == 1 or oracle.calls > 50
        assert oracle.right > 90


@pytest.mark.parametrize("faults", [LATE, f"{LATE}; 1%: drop"])
def test_blocking_reads_of_a_stepper(faults: str, rounds: Rounds) -> None:
    """A stepper reply has no checksum, so nothing is damaged here; a level is right by chance every other time."""
    random, wrong, right, total = Random(3), 0, 0, rounds(200_000, 2_000)
    with motorbus.simulate("stepper") as sim, motorbus.open(sim.url) as bus:
        controller = stepper.Controller(bus)
        sim.faults = faults
        for _ in range(total):
            level = random.random() < 0.5
            sim[1].set_input(2, level)
            value = attempt(lambda: controller.read_input(2))
            if not isinstance(value, motorbus.MotorbusError):
                right += bool(value) is level
                wrong += bool(value) is not level
        assert sim.faults.count > total / 200
    assert wrong == 0
    assert right > 0.5 * total


@pytest.mark.parametrize(("family", "faults"), [("feetech", LATE), ("feetech", ANY), ("kst", LOST)])
def test_tasks_on_one_bus(family: str, faults: str, rounds: Rounds) -> None:
    """One task per servo, all at the same time; on CAN their requests are under way together."""

    async def reader(oracle: Oracle, which: int, servo: Any, count: int) -> None:
        for _ in range(count):
            expected = oracle.change(which)
            try:
                value = await servo.position()
            except motorbus.MotorbusError as error:
                value = error
            oracle.judge_one(which, expected, value)

    async def main() -> None:
        with motorbus.simulate(family, ids=IDS[family]) as sim:
            async with motorbus.open_async(sim.url) as bus:
                servos = [ASYNC_SERVO[family](bus, node) for node in IDS[family]]
                await asyncio.gather(*(servo.position() for servo in servos))
                sim.faults = faults
                oracle, count = Oracle(sim), rounds(200_000, 1_500) // len(servos)
                await asyncio.gather(
                    *(reader(oracle, which, servo, count) for which, servo in enumerate(servos))
                )
                oracle.check(sim)

    asyncio.run(main())


def machine_file(folder: Path, sims: Sequence[Any]) -> Path:
    """A machine file with one axis for each servo of these simulations, in their order."""
    lines = ["format = 1"]
    for index, sim in enumerate(sims):
        lines += [f"[bus.b{index}]", f'address = "{sim.url}"']
        for node in IDS[sim.family.name]:
            lines += [f"[axis.a{index}_{node}]", f'device = "b{index}#{node}"', 'max_velocity = "1 rad/s"']
    path = folder / "motorbus.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


BUSES: Final = (("feetech", "seed 1"), ("kst", "seed 2"), ("feetech", "seed 3"))
"""Families of the buses of a robot, each with the seed of its faults."""


def test_a_robot_on_three_buses(tmp_path: Path, rounds: Rounds) -> None:
    with ExitStack() as stack:
        sims = [stack.enter_context(motorbus.simulate(name, ids=IDS[name])) for name, _ in BUSES]
        robot = stack.enter_context(motorbus.Robot.load(machine_file(tmp_path, sims)))
        for sim, (_, seed) in zip(sims, BUSES, strict=True):
            sim.faults = LOST.replace("seed 7", seed)
        oracle = Oracle(*sims)
        for _ in range(rounds(100_000, 200)):
            expected = oracle.change_all()
            values = attempt(robot.positions)
            if not isinstance(values, motorbus.MotorbusError):
                oracle.judge(expected, values.values())
        oracle.check(*sims)


def test_an_async_robot_on_three_buses(tmp_path: Path, rounds: Rounds) -> None:
    async def main() -> None:
        with ExitStack() as stack:
            sims = [stack.enter_context(motorbus.simulate(name, ids=IDS[name])) for name, _ in BUSES]
            async with motorbus.AsyncRobot.load(machine_file(tmp_path, sims)) as robot:
                for sim, (_, seed) in zip(sims, BUSES, strict=True):
                    sim.faults = LOST.replace("seed 7", seed)
                oracle = Oracle(*sims)
                for _ in range(rounds(100_000, 200)):
                    expected = oracle.change_all()
                    try:
                        values = await robot.positions()
                    except motorbus.MotorbusError:
                        continue
                    oracle.judge(expected, values.values())
                oracle.check(*sims)

    asyncio.run(main())


def test_reads_on_a_real_port(tmp_path: Path, rounds: Rounds) -> None:
    """What was written just now is read back, though replies are later than any time-out."""
    faults = "seed 5; 3%: delay 0.15-0.4; 2%: drop; 2%: corrupt"
    right, total = 0, rounds(2_000, 60)
    with (
        simulator(tmp_path / "bus", "feetech", "--ids", "1", "--faults", faults) as simulated,
        motorbus.open(simulated.address) as bus,
    ):
        servo = feetech.Servo(bus, 1)
        for index in range(total):
            number = 1.0 + index % 100 / 4
            if isinstance(attempt(partial(servo.write, acceleration=number)), motorbus.MotorbusError):
                continue
            value = attempt(partial(servo.read, "acceleration"))
            if not isinstance(value, motorbus.MotorbusError):
                assert abs(value["acceleration"] - number) < 0.1, number
                right += 1
        struck = json.loads(simulated.command("faults"))
    assert struck["count"] > 0
    assert right > 0.5 * total
