"""A program that is killed in the middle of a move: its axes go no farther than the last bounded goal.

Real processes on real ports: a simulator for each bus, and the program, which SIGKILL ends as a goal is about to leave,
or from outside at any moment. Before each goal the program writes where each device was by its last reply and where the
goal is, both decoded from the bytes on the port. Who connects afterwards writes nothing.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from math import pi, radians
from pathlib import Path
from random import Random
from threading import Timer
from typing import Any, NamedTuple

import pytest

from motorbus import Robot
from tests.conftest import Rounds
from tests.support.machines import file_text
from tests.support.processes import Simulated

PROGRAM = """
import json, os, signal, sys
from random import Random
from motorbus import Robot
from motorbus.link import usb_adapters
from tests.safety.decoders import FeetechWitness, KstWitness

usb_adapters.TERMINAL_LATENCY = 1.0  # a simulator may have to wait for a processor
chance, left = Random(int(sys.argv[2])), [int(sys.argv[3])]
decoders, heard, goals = {"arm": FeetechWitness(), "can": KstWitness(0x25)}, {}, {}

def observe(name, link):
    decoder, write, read, rest = decoders[name], link.write, link.read, bytearray()

    def observed_write(data):
        ordered = {name + str(node): place for node, place in decoder.ordered(data)}
        if ordered:
            goals.update(ordered)
            left[0] -= 1
            os.write(1, json.dumps([heard, goals]).encode() + b"\\n")
            if left[0] == 0:
                os.kill(os.getpid(), signal.SIGKILL)
        write(data)

    def observed_read(until):
        arrived = read(until)
        for data in arrived if name == "can" else packets(rest, arrived):
            heard.update((name + str(node), place) for node, place in decoder.told(data))
        return arrived

    link.write, link.read = observed_write, observed_read

def packets(rest, arrived):
    rest += b"".join(arrived)
    while len(rest) > 3 and len(rest) >= rest[3] + 4:
        yield bytes(rest[:rest[3] + 4])
        del rest[:rest[3] + 4]

with Robot.load(sys.argv[1]) as robot:
    for name, bus in robot.buses.items():
        observe(name, bus.link)
    while True:
        robot.move({name: chance.uniform(-0.7, 0.7) for name in robot.axes})
"""
ROOT = Path(__file__).parents[2]
QUANTUM = 0.25 * radians(90)
"""rad that an axis of this machine may go in 250 ms."""
Spot = tuple[str, int]
COUNTS = {"arm": 2 * pi / 4096, "can": radians(0.1)}
"""rad of a raw position."""
SPOTS: dict[str, Spot] = {"arm1": ("arm", 0), "arm2": ("arm", 1), "arm3": ("arm", 2), "can37": ("can", 0)}
"""By the name that the program gives it, the number of each device in the status of its bus."""
GOALS = {"arm": "raw_goal_position", "can": "raw_target"}
LOOKS = 100_000
LONG = 60.0
"""s until a program that does not die by its own hand is killed."""
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

    def places(self) -> dict[Spot, tuple[float, float, bool]]:
        """Of each device: where it is, where it was told to go (rad), and whether it moves."""
        return {
            (bus, number): (one["raw_position"] * count, one[GOALS[bus]] * count, bool(one["moving"]))
            for bus, count in COUNTS.items()
            for number, one in enumerate(self.status(bus))
        }


@pytest.fixture
def served(tmp_path: Path, unhurried: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    """Three servos on a line and one on CAN, each bus served by a process of its own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    control = {"arm": tmp_path / "a.sock", "can": tmp_path / "c.sock"}
    with (
        Simulated("feetech", ids="1-3", link=tmp_path / "arm", control=str(control["arm"])) as arm,
        Simulated("kst", ids="0x25", link=tmp_path / "can", control=str(control["can"])) as can,
    ):
        file = tmp_path / "motorbus.toml"
        addresses = {"arm": arm.bus, "can": can.bus}
        file.write_text(file_text(addresses, "1-3", "0x25"), encoding="utf-8")
        yield Served(control, file)


class Last(NamedTuple):
    """What a killed program wrote down last: where it heard each device to be, and the goals (rad) that each may have.

    The last of all orders may have left, or not.
    """

    heard: dict[Spot, float]
    goals: dict[Spot, set[float]]


def killed(served: Served, seed: int, orders: int, after: float | None) -> Last:
    """A program that moves everything, killed as this order of it leaves, or so long (s) after its first."""
    words = [sys.executable, "-c", PROGRAM, str(served.file), str(seed), str(orders)]
    pipe = subprocess.PIPE
    # Without a buffer no line is read ahead and lost; the folder is where `tests` can be imported.
    with subprocess.Popen(words, stdout=pipe, stderr=pipe, bufsize=0, cwd=ROOT) as program:
        assert program.stdout is not None
        first = program.stdout.readline()
        doom = Timer(LONG if after is None else after, program.kill)
        doom.start()
        rest, wrong = program.communicate(timeout=2 * LONG)
        doom.cancel()
    assert program.returncode == -signal.SIGKILL, wrong
    lines = [json.loads(line) for line in (first + rest).splitlines()]
    assert after is not None or len(lines) == orders, "by its own hand"
    (heard, last), (_, before) = lines[-1], lines[-2] if len(lines) > 1 else ({}, {})
    return Last(
        {SPOTS[name]: place for name, place in heard.items()},
        {spot: {goals[name] for goals in (last, before) if name in goals} for name, spot in SPOTS.items()},
    )


def at_rest(served: Served) -> dict[Spot, tuple[float, float, bool]]:
    """Where all are once nothing moves."""
    for _ in range(LOOKS):
        found = served.places()
        if not any(moving for _, _, moving in found.values()):
            return found
    raise AssertionError("something moves on and on")


@pytest.mark.timeout(0)
def test_a_killed_program_moves_nothing_beyond_its_last_goal(served: Served, rounds: Rounds) -> None:
    chance = Random(8)
    caught = 0
    for seed in range(rounds(100_000, 3_000) // 500):
        stood = served.places()  # who was not heard before the first order was not sent anywhere yet
        own = seed % 2 == 0  # the other half is killed from outside
        last = killed(
            served, seed, chance.randrange(2, 300) if own else -1, None if own else chance.uniform(0, 2)
        )
        before = served.places()
        after = at_rest(served)
        caught += any(moving for _, _, moving in before.values())
        for spot, (place, goal, _) in after.items():
            count = COUNTS[spot[0]]
            heard = last.heard.get(spot, stood[spot][0])
            assert abs(place - heard) <= QUANTUM, (seed, spot)
            assert not last.goals[spot] or abs(place - goal) <= AT_REST * count, (seed, spot)
            ordered = last.goals[spot] or {heard}
            assert any(abs(place - one) <= (AT_REST + 1) * count for one in ordered), (seed, spot, ordered)
            assert goal == before[spot][1], (seed, spot)
        assert_connecting_changes_nothing(served)
        assert served.places() == after
    assert caught, "no movement was cut"


def assert_connecting_changes_nothing(served: Served) -> None:
    """Open the machine, read and close it: no device is in another state. The bytes: `test_promises`, promise 1."""
    before = {bus: served.status(bus) for bus in served.control}
    with Robot.load(served.file) as robot:
        robot.positions()
    assert {bus: served.status(bus) for bus in served.control} == before
