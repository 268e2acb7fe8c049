"""Foreign libraries, unmodified, use our simulator over a pseudo-terminal.

Each library has a process, the simulator another; what one has written is read by the other library and by motorbus.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pytest

import motorbus
from motorbus import feetech
from tests.interop.feetech import peer
from tests.interop.feetech.peer import PeerError, Script, folders
from tests.support.processes import Simulated

T = TypeVar("T")

HERE = Path(__file__).resolve().parent
NODES = [1, 2, 3, 4, 5, 6]
IDENTITY = [3, 10, 0, 9, 3]
MIDDLE = 2048
GOAL, POSITION, MOVING, ACCELERATION, TORQUE_LIMIT = 42, 56, 66, 41, 48
ID, BAUD, RETURN_DELAY, TORQUE, LOCK, MAX_ACCELERATION = 5, 6, 7, 40, 55, 85


SDK = "feetech_servo_sdk_client.py"
RUSTYPOT = "rustypot_client.py"
LIBRARIES = {SDK: peer.OLD_SDK, RUSTYPOT: peer.RUSTYPOT}
BOTH = [pytest.param(SDK, RUSTYPOT, id="sdk"), pytest.param(RUSTYPOT, SDK, id="rustypot")]


class Peer(Script):
    """A library in its own process: `peer.read(1, 56, 2)`."""

    def __init__(self, script: str, port: str) -> None:
        super().__init__([str(HERE / script), port], folders(LIBRARIES[script]))

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self.ask(name, *arguments)


@pytest.fixture
def port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Six simulated servos, 1 to 6, in a process of their own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Simulated("feetech", ids="1-6", link=tmp_path / "bus"):
        yield str(tmp_path / "bus")


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
def test_pings_and_reads(port: str, library: str, other: str) -> None:
    with Peer(library, port) as peer:
        assert [bool(peer.ping(node)) for node in NODES] == [True] * 6
        try:
            absent = bool(peer.ping(7))
        except PeerError:
            absent = False
        assert not absent
        assert [peer.read(node, 0, 6) for node in NODES] == [[*IDENTITY, node] for node in NODES]
        assert peer.sync_read(NODES[::-1], 5, 1) == [[node] for node in NODES[::-1]]
        assert peer.sync_read(NODES, POSITION, 2) == [pair(MIDDLE)] * 6


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_what_it_writes_is_there_for_the_others(port: str, library: str, other: str) -> None:
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
        for servo in servos:
            patiently(partial(servo.write, torque_limit=0.1 * servo.node))
    with Peer(library, port) as peer:
        assert peer.sync_read(NODES, TORQUE_LIMIT, 2) == [pair(100 * node) for node in NODES]


@pytest.mark.parametrize(("library", "other"), BOTH)
def test_moves_all_at_once(port: str, library: str, other: str) -> None:
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
