"""Other people's libraries, unmodified, talk to our simulator over a real pseudo-terminal.

They know nothing of this project, so where they and it agree, neither has only convinced itself. Each library runs
in a process of its own, the simulator in another; what one wrote is read again by the other library and by ours.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import pytest

import motorbus
from motorbus import feetech
from tests.support.processes import Simulated

T = TypeVar("T")

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PEERS = ROOT / ".peers"
NODES = [1, 2, 3, 4, 5, 6]
IDENTITY = [3, 10, 0, 9, 3]
MIDDLE = 2048
GOAL, POSITION, MOVING, ACCELERATION, TORQUE_LIMIT = 42, 56, 66, 41, 48
ID, BAUD, RETURN_DELAY, TORQUE, LOCK, MAX_ACCELERATION = 5, 6, 7, 40, 55, 85


class Library(NamedTuple):
    """A peer: its script and the folders it needs."""

    name: str
    script: str
    folders: tuple[str, ...]


SDK = Library("feetech-servo-sdk", "feetech_servo_sdk_client.py", ("feetech-servo-sdk", "pyserial"))
RUSTYPOT = Library("rustypot", "rustypot_client.py", ("rustypot",))
BOTH = [pytest.param(SDK, RUSTYPOT, id=SDK.name), pytest.param(RUSTYPOT, SDK, id=RUSTYPOT.name)]


class PeerError(Exception):
    """What a library said instead of an answer."""


class Peer:
    """A library at work in its own process: `peer.read(1, 56, 2)`."""

    def __init__(self, library: Library, port: str) -> None:
        missing = [name for name in library.folders if not (PEERS / name).is_dir()]
        if missing:
            pytest.fail(
                f".peers/{missing[0]} is missing; `make test` installs it, or: python scripts/peers.py"
            )
        path = os.pathsep.join(str(PEERS / name) for name in library.folders)
        self._process = subprocess.Popen(
            [sys.executable, "-S", str(HERE / library.script), port],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
        )

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self._ask([name, *arguments])

    def _ask(self, request: list[Any]) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        answer = json.loads(self._process.stdout.readline())
        if "error" in answer:
            raise PeerError(answer["error"])
        return answer["value"]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(10)


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Six simulated servos, 1 to 6, in a process of their own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    link = tmp_path / "bus"
    command = [
        sys.executable,
        "-m",
        "motorbus",
        "simulate",
        "feetech",
        "--ids",
        "1-6",
        "--link",
        str(link),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ready = process.stdout.readline()
        assert str(link) in ready
        try:
            yield str(link)
        finally:
            process.send_signal(signal.SIGTERM)
    assert process.returncode == 0
    assert not link.exists()


@contextmanager
def ours(port: str) -> Iterator[list[feetech.Servo]]:
    """The same servos by motorbus."""
    with motorbus.open(f"feetech:{port}") as bus:
        yield [feetech.Servo(bus, node) for node in NODES]


def patiently(ask: Callable[[], T]) -> T:
    """Ask again, a few times: a busy machine may wake the simulator later than a library waits."""
    for _ in range(5):
        with suppress(motorbus.NoReply, AssertionError):
            return ask()
    return ask()


def word(data: list[int]) -> int:
    """Two bytes, low byte first."""
    return data[0] | data[1] << 8


def pair(value: int) -> list[int]:
    """The two bytes of a value, low byte first."""
    return [value & 255, value >> 8]


def await_standstill(peer: Peer) -> None:
    """Ask until no servo says that it moves; the test's own time limit ends it."""
    while any(moving for (moving,) in peer.sync_read(NODES, MOVING, 1)):
        pass


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_pings_those_who_are_there(port: str, library: Library, other: Library) -> None:
    with Peer(library, port) as peer:
        assert [bool(peer.ping(node)) for node in NODES] == [True] * 6
        try:
            absent = bool(peer.ping(7))
        except PeerError:
            absent = False
        assert not absent


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_reads_what_the_servos_hold(port: str, library: Library, other: Library) -> None:
    with Peer(library, port) as peer:
        assert [peer.read(node, 0, 6) for node in NODES] == [[*IDENTITY, node] for node in NODES]
        assert peer.read(3, POSITION, 2) == pair(MIDDLE)


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_reads_all_at_once(port: str, library: Library, other: Library) -> None:
    with Peer(library, port) as peer:
        assert peer.sync_read(NODES, 5, 1) == [[node] for node in NODES]
        assert peer.sync_read(NODES[::-1], 5, 1) == [[node] for node in NODES[::-1]]
        assert peer.sync_read(NODES, POSITION, 2) == [pair(MIDDLE)] * 6


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_what_it_writes_is_there_for_the_others(port: str, library: Library, other: Library) -> None:
    with Peer(library, port) as peer:
        for node in NODES:
            peer.write(node, ACCELERATION, [10 * node])
            peer.write(node, TORQUE_LIMIT, pair(500 + node))
    with Peer(other, port) as peer:
        assert [peer.read(node, ACCELERATION, 1) for node in NODES] == [[10 * node] for node in NODES]
        assert peer.sync_read(NODES, TORQUE_LIMIT, 2) == [pair(500 + node) for node in NODES]
    with ours(port) as servos:
        limits = [patiently(partial(servo.read, "torque_limit"))["torque_limit"] for servo in servos]
        assert limits == pytest.approx([(500 + node) / 1000 for node in NODES])


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_moves_all_at_once(port: str, library: Library, other: Library) -> None:
    goals = [MIDDLE + 20 * node for node in NODES]
    with Peer(library, port) as peer:
        peer.sync_write(NODES, GOAL, [[*pair(goal), 0, 0, *pair(1000)] for goal in goals])
        await_standstill(peer)
        assert [word(data) for data in peer.sync_read(NODES, POSITION, 2)] == goals
    with Peer(other, port) as peer:
        assert [word(data) for data in peer.sync_read(NODES, POSITION, 2)] == goals
        assert peer.sync_read(NODES, GOAL, 6) == [[*pair(goal), 0, 0, *pair(1000)] for goal in goals]
    with ours(port) as servos:
        angles = [goal * math.tau / 4096 for goal in goals]
        assert [patiently(servo.position) for servo in servos] == pytest.approx(angles)


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_what_we_write_is_there_for_the_others(port: str, library: Library, other: Library) -> None:
    with ours(port) as servos:
        for servo in servos:
            patiently(partial(servo.write, torque_limit=0.1 * servo.node))
    with Peer(library, port) as peer:
        assert peer.sync_read(NODES, TORQUE_LIMIT, 2) == [pair(100 * node) for node in NODES]


@pytest.mark.parametrize("target", [2, 3, 4, 5, 6])
def test_lerobots_set_up_of_a_new_servo_with_the_sdk(tmp_path: Path, target: int) -> None:
    """The writes of lerobot 0.4.4: `setup_motor`, then `configure_motors`."""
    with Simulated("feetech", ids="1", link=tmp_path / "bus"), Peer(SDK, str(tmp_path / "bus")) as peer:
        assert peer.ping(1) == 777
        for address in (TORQUE, LOCK):
            peer.write_once(1, address, [0])
        peer.write_once(1, ID, [target])
        peer.write_once(target, BAUD, [0])
        assert peer.ping(target) == 777
        for address, value in ((RETURN_DELAY, 0), (MAX_ACCELERATION, 254), (ACCELERATION, 254)):
            for one in (100, value):  # another value first, in case it ships with this one
                peer.write_once(target, address, [one])
                assert peer.read(target, address, 1) == [one]


def test_the_sdk_buffers_a_write_and_starts_it(port: str) -> None:
    with Peer(SDK, port) as peer:
        peer.reg_write(1, GOAL, pair(MIDDLE + 50))
        assert peer.read(1, 64, 1) == [1]
        assert peer.read_word(1, GOAL) != MIDDLE + 50
        peer.action()
        assert peer.read(1, 64, 1) == [0]
        assert peer.read_word(1, GOAL) == MIDDLE + 50


def test_rustypot_names_the_model_and_the_radians(port: str) -> None:
    with Peer(RUSTYPOT, port) as peer:
        patiently(lambda: _demand_scan(peer))
        assert peer.positions(NODES) == pytest.approx([0.0] * 6)  # its zero is the middle of the turn
        peer.write_register(2, "homing_offset", -5)
        assert peer.read(2, 31, 2) == [5, 8]  # sign-magnitude with the sign in bit 11
        assert peer.read_register(2, "homing_offset") == -5


def _demand_scan(peer: Peer) -> None:
    """Its scan gives each id a few milliseconds only."""
    assert peer.scan([1, 6, 7]) == [[1, 777], [6, 777]]


def test_rustypots_negative_goal_arrives_as_it_was_sent(
    port: str, record_property: Callable[[str, object], None]
) -> None:
    """Its typed controller writes two's complement where the register is sign-magnitude (seen with 1.13.1).

    That is its affair and may be mended; ours is that the register holds what was on the wire.
    """
    counts = -559  # -4 rad from the middle of the turn, cut
    with Peer(RUSTYPOT, port) as peer:
        peer.move([1], [-4.0])
        sent = word(peer.read(1, GOAL, 2))
    record_property("rustypot sends -4 rad as", f"0x{sent:04X}")
    assert sent in (counts & 0xFFFF, 0x8000 | -counts)
    with Peer(SDK, port) as peer:
        assert peer.read_word(1, GOAL) == sent
