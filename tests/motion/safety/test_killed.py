"""A program that is killed in the midst of a movement: what it led goes on by no more than its last small goal.

Real processes on real ports: a simulator for each bus, and the program, which SIGKILL ends after so many orders.
A killed program tells nothing any more, so what the motors do is asked of the simulators. Whoever connects
afterwards changes nothing.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from math import pi, radians
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest

from motorbus.bus.air import Air
from motorbus.cli.simulated import Simulated
from motorbus.core.operation import CanFrame, Data
from motorbus.session.robot import Robot
from tests.motion.machines import described

PROGRAM = """
import os, signal, sys
from random import Random
from motorbus import Robot
from motorbus.bus.air import Air

chance, left, launch = Random(int(sys.argv[2])), [int(sys.argv[3])], Air._launch

def doomed(air, flight, now):
    if flight.exchange.goals:
        left[0] -= 1
        if left[0] < 0:
            os.kill(os.getpid(), signal.SIGKILL)
    return launch(air, flight, now)

Air._launch = doomed
with Robot.load(sys.argv[1]) as robot:
    while True:
        robot.move({name: chance.uniform(-0.7, 0.7) for name in robot.axes})
"""
QUANTUM = 0.25 * radians(90)
"""rad that an axis of this machine may go in 250 ms."""
COUNTS = {"arm": 2 * pi / 4096, "can": radians(0.1)}
"""rad of a raw position."""
GOALS = {"arm": "raw_goal_position", "can": "raw_target"}
LOOKS = 100_000
AT_REST = 3
"""Counts that a servo at rest may be off its goal."""


class Served(NamedTuple):
    """Two simulators with their control sockets by the names of the buses, and the file of the machine on them."""

    control: dict[str, Path]
    file: Path

    def status(self, bus: str) -> list[dict[str, Any]]:
        """How the devices of a bus are by now."""
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(self.control[bus]))
            client.sendall(b"status\n")
            found = json.loads(client.makefile().readline())
        nodes: list[dict[str, Any]] = found["nodes"]
        return nodes

    def places(self) -> dict[tuple[str, int], tuple[float, float, bool]]:
        """Of each device: where it is, where it was told to go (rad), and whether it moves."""
        return {
            (bus, number): (one["raw_position"] * count, one[GOALS[bus]] * count, bool(one["moving"]))
            for bus, count in COUNTS.items()
            for number, one in enumerate(self.status(bus))
        }


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    """Three servos on a line and one on CAN, each bus served by a process of its own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    control = {"arm": tmp_path / "a.sock", "can": tmp_path / "c.sock"}
    with (
        Simulated("feetech", ids="1-3", link=tmp_path / "arm", control=str(control["arm"])) as arm,
        Simulated("kst", ids="0x25", link=tmp_path / "can", control=str(control["can"])) as can,
    ):
        file = tmp_path / "motorbus.toml"
        addresses = {"arm": arm.bus, "can": can.bus}
        file.write_text(described(addresses, "1-3", "0x25", False, {}, {}), encoding="utf-8")
        yield Served(control, file)


def killed(served: Served, seed: int, orders: int) -> None:
    """A program that moves everything, killed when so many orders have left."""
    words = [sys.executable, "-c", PROGRAM, str(served.file), str(seed), str(orders)]
    ended = subprocess.run(words, capture_output=True, timeout=120, check=False)
    assert ended.returncode == -signal.SIGKILL, ended.stderr


def at_rest(served: Served) -> dict[tuple[str, int], tuple[float, float, bool]]:
    """Where all are once nothing moves."""
    for _ in range(LOOKS):
        found = served.places()
        if not any(moving for _, _, moving in found.values()):
            return found
    raise AssertionError("something moves on and on")


@pytest.mark.timeout(0)
def test_what_was_led_goes_no_farther_than_its_last_goal_and_connecting_changes_nothing(
    served: Served, rounds: Callable[[int], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    chance = Random(8)
    caught = 0
    for seed in range(rounds(100_000) // 500):
        killed(served, seed, chance.randrange(2, 300))
        before = served.places()
        after = at_rest(served)
        caught += any(moving for _, _, moving in before.values())
        for spot, (place, goal, _) in after.items():
            assert abs(place - before[spot][0]) <= QUANTUM, (seed, spot)
            assert abs(place - goal) <= AT_REST * COUNTS[spot[0]], (seed, spot)
            assert goal == before[spot][1], (seed, spot)
        assert_connecting_writes_nothing(served, monkeypatch)
        assert served.places() == after
    assert caught, "no movement was cut"


def assert_connecting_writes_nothing(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Open the machine and leave it again: all that is sent are questions."""
    sent: list[Data] = []
    launch = Air._launch

    def launched(air: Air, flight: Any, now: float) -> Data:
        sent.append(launch(air, flight, now))
        return sent[-1]

    with monkeypatch.context() as patched:
        patched.setattr(Air, "_launch", launched)
        with Robot.load(served.file) as robot:
            robot.positions()
    assert len(sent) > 4
    assert [data for data in sent if not asks(data)] == []


def asks(data: Data) -> bool:
    """PING, READ or SYNC READ of FEETECH; an SDO upload."""
    if isinstance(data, CanFrame):
        return data.id > 0x600 and data.data[0] & 0xE0 == 0x40
    return data[4] in (1, 2, 0x82)
