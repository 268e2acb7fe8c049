"""However a program ends, each axis that it gave torque gets what the file says of it, though the first ones fail."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from motorbus import Robot
from motorbus.core.steps import Sleep
from motorbus.errors import MotorbusError
from motorbus.motion.safety.lease import Lease
from motorbus.simulation.named import Simulation
from tests.support.machines import listened, machine, said

EXITS = {
    "a1": {"exit": "torque_off"},
    "a2": {"exit": "park", "park": "10 deg"},
    "a3": {"exit": "hold"},
    "a4": {"exit": "torque_off"},
    "a5": {"exit": "park", "park": "20 deg"},
    "a6": {"exit": "leave"},
    "a7": {"exit": "torque_off"},
}
"""a1 and a2 are dead when it ends; nobody gives a7 torque."""


def goes(robot: Robot) -> None:
    """The normal end."""


def fails(robot: Robot) -> None:
    raise ValueError("its own")


def interrupted(robot: Robot) -> None:
    signal.raise_signal(signal.SIGINT)


def told_to_end(robot: Robot) -> None:
    signal.raise_signal(signal.SIGTERM)


def terminal_gone(robot: Robot) -> None:
    signal.raise_signal(signal.SIGHUP)


def lease_lost(robot: Robot) -> None:
    for bus in robot.buses.values():
        bus.run(Sleep(30.0))  # type: ignore[attr-defined]


ENDS: list[tuple[Callable[[Robot], None], type[BaseException]]] = [
    (goes, MotorbusError),
    (fails, ValueError),
    (interrupted, KeyboardInterrupt),
    (told_to_end, SystemExit),
    (terminal_gone, SystemExit),
    (lease_lost, MotorbusError),
]


@contextmanager
def default_signals() -> Iterator[None]:
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, signal.SIG_DFL) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def works(robot: Robot, sims: dict[str, Simulation], end: Callable[[Robot], None]) -> None:
    """It gives torque, moves a wheel without an end in the held axis, loses two servos, and ends."""
    robot["a3"].device.set_mode("velocity")
    robot.enable_torque(["a1", "a2", "a3", "a4", "a5", "a6"])
    robot.lease = lease = Lease(0.5)
    lease.take("page", robot.now, attended=True)
    robot["a3"].device.set_velocity(1.0)
    assert sims["arm"][3].memory["goal_velocity"]
    for node in (1, 2):
        sims["arm"][node].unplug()
    listened(sims)
    end(robot)


@pytest.mark.parametrize(("end", "kind"), ENDS, ids=lambda one: one.__name__)
def test_each_gets_its_exit_policy(end: Callable[[Robot], None], kind: type[BaseException]) -> None:
    with machine(arm="1-7", axes=EXITS) as (made, sims), default_signals():
        with pytest.raises(kind) as caught, Robot.of(made) as robot:
            works(robot, sims, end)
        torque = [sims["arm"][node].memory["torque_enable"] for node in range(1, 8)]
        assert torque[2:] == [1, 0, 1, 1, 0]
        assert not sims["arm"][3].memory["goal_velocity"]
        parked = abs(sims["arm"][5].raw_position - 2048 - 20 / 360 * 4096) < 20
        assert parked == (end is not lease_lost)
        assert not [one for one in said(sims) if "servo 6" in one and "WRITE" in one]
        error = caught.value
        told = "\n".join([str(error), *getattr(error, "__notes__", ())])
        assert "a1" in told
        assert ("a5: not parked, for the lease of the machine was lost" in told) == (end is lease_lost)
