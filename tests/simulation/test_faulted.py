"""Faults of a simulation that is served: set before and while it runs, told, not too much of them, and had again."""

from __future__ import annotations

import os
import select
import socket
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from motorbus import families
from motorbus.errors import RequestError
from motorbus.simulation.clients import CanClient, Door
from motorbus.simulation.faulted import Faulted, read_order
from motorbus.simulation.faults import World
from motorbus.simulation.listener import TcpListener, TcpPort
from motorbus.simulation.mount import Mount, Place
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.served import LinkClient
from motorbus.simulation.slcan import SlcanAdapter
from tests.simulation.links import QueueLink
from tests.support.mounts import PATIENCE, asked, received, served

PING, PONG = "FF FF 01 02 01 FB", "FF FF 01 02 00 FC"


class Hall:
    """A mount with faults that a test steps by itself, so that nothing else changes them meanwhile."""

    def __init__(self, place: Place, family: str = "feetech", **options: object) -> None:
        simulator: Any = families.load(family).simulator((1,), "", **options)
        self.slept = 0.0  # s that a test has added to the clock
        self.world = World(simulator, now=self.clock())
        rate = None if isinstance(place, TcpListener) else families.load(family).link.rate
        self.mount = Mount(self.world, place, rate=rate, clock=self.clock)
        self.faulted = Faulted(self.mount, self.world)

    def clock(self) -> float:
        return time.monotonic() + self.slept


@contextmanager
def reached(hall: Hall, port: TcpListener | TcpPort) -> Iterator[socket.socket]:
    with served(hall.mount), socket.create_connection((port.host, port.port), timeout=PATIENCE) as client:
        yield client


def test_a_fault_on_a_socket_and_what_is_told_of_it() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        hall.faulted.set("exchange 2 byte 5: corrupt 01; exchange 9: drop")
        with reached(hall, listener) as client:
            assert asked(client.fileno(), PING, 6) == PONG
            assert asked(client.fileno(), PING, 6) == "FF FF 01 02 00 FD"
        facts = hall.faulted.facts()
        assert [one["fault"] for one in facts["fired"]] == ["exchange 2 byte 5: corrupt 01"]
        assert facts["pending"] == ["exchange 9: drop"]
        assert (facts["exchange"], facts["count"], facts["seed"]) == (2, 1, None)
        assert 0 <= facts["fired"][0]["at"] < PATIENCE
        assert hall.faulted.replay() == "faults: 1 happened"


def test_a_bad_script_leaves_the_one_that_is_set() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        hall.faulted.set("exchange 2: drop")
        line = hall.mount.course.line
        for wrong in ("exchange 1: explode", "exchange 1: power-cycle 9"):
            with pytest.raises(RequestError):
                hall.faulted.set(wrong)
        for nothing in ("seed 3", "# nothing"):
            with pytest.raises(RequestError, match="no fault in it"):
                read_order(hall.faulted, nothing)
        assert hall.mount.course.line is line
        assert read_order(hall.faulted, "off") is None
        assert hall.mount.course.line is not line
        assert (read_order(hall.faulted, "") or {})["script"] == ""
        with pytest.raises(RequestError, match="takes no faults"):
            read_order(None, "")


def test_chance_gets_a_seed_that_is_told() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        hall.faulted.set("50%: drop")
        seed = hall.faulted.script.seed
        assert seed is not None
        hall.faulted.set("seed 5; 100%: duplicate")
        with reached(hall, listener) as client:
            assert asked(client.fileno(), PING, 12) == f"{PONG} {PONG}"
        assert hall.faulted.replay() == (
            "faults: 1 happened, by the seed 5; the same again: --faults 'seed 5; 100%: duplicate'"
        )


def test_a_pulled_terminal_hangs_up_and_is_another_one_behind_the_same_name(tmp_path: Path) -> None:
    link = tmp_path / "arm"
    with closing(PtyMaster()) as terminal:
        terminal.symlink(link)
        hall = Hall(terminal)
        hall.faulted.set("exchange 2: unplug 0.2")
        with served(hall.mount):
            descriptor = os.open(link, os.O_RDWR | os.O_NOCTTY)
            assert asked(descriptor, PING, 6) == PONG
            os.write(descriptor, bytes.fromhex(PING))
            assert hung_up(descriptor)
            os.close(descriptor)
            descriptor = opened_again(link)
            assert asked(descriptor, PING, 6) == PONG
            os.close(descriptor)
        assert hall.faulted.count == 1


def hung_up(descriptor: int) -> bool:
    """Whether this end is told that the other one is gone."""
    poll = select.poll()
    poll.register(descriptor, 0)
    return bool(poll.poll(PATIENCE * 1000)) and received_nothing(descriptor)


def received_nothing(descriptor: int) -> bool:
    try:
        return os.read(descriptor, 64) == b""
    except OSError:
        return True


def opened_again(link: Path) -> int:
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return os.open(link, os.O_RDWR | os.O_NOCTTY)
        except OSError:
            assert time.monotonic() < end
            select.select((), (), (), 0.01)


def test_a_pulled_socket_is_dropped_and_refused_and_is_back() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        hall.faulted.set("exchange 2: unplug 600")
        address = listener.host, listener.port
        with socket.create_connection(address, timeout=PATIENCE) as client:
            assert stepped(hall, client) == bytes.fromhex(PONG)
            assert stepped(hall, client) == b""
        for pause in (0.0, 300.0):
            hall.slept += pause
            hall.mount.step(timeout=0)
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection(address, timeout=PATIENCE).close()
        hall.slept += 301.0
        hall.mount.step(timeout=0)
        with socket.create_connection(address, timeout=PATIENCE) as client:
            assert stepped(hall, client) == bytes.fromhex(PONG)


def stepped(hall: Hall, client: socket.socket) -> bytes:
    """What comes of a ping, a step of the mount at a time."""
    client.sendall(bytes.fromhex(PING))
    while not select.select([client], (), (), 0)[0]:
        hall.mount.step(timeout=0.01)
    return client.recv(64)


@contextmanager
def called_again(port: TcpPort) -> Iterator[socket.socket]:
    end = time.monotonic() + PATIENCE
    while True:
        try:
            client = socket.create_connection((port.host, port.port), timeout=PATIENCE)
            break
        except ConnectionRefusedError:
            assert time.monotonic() < end
            select.select((), (), (), 0.01)
    with client:
        yield client


def test_a_pulled_can_adapter_comes_back_as_new() -> None:
    with closing(Door(TcpPort(), SlcanAdapter)) as door:
        hall = Hall(door, "kst")
        hall.faulted.set("exchange 1: unplug 0.2")
        with reached(hall, door.port) as client:
            client.sendall(b"S6\rO\rt62584002600000000000\r")
            while client.recv(64):
                pass
            with called_again(door.port) as again:
                again.sendall(b"V\r")
                assert received(again.fileno(), 1)
        assert hall.faulted.count == 1


def test_a_terminal_without_a_name_cannot_be_pulled() -> None:
    with closing(PtyMaster()) as terminal:
        assert "nobody would find" in CanClient(terminal, SlcanAdapter()).fixed
        with pytest.raises(RequestError, match=r"(?s)no port.*symbolic link"):
            Hall(terminal).faulted.set("exchange 1: unplug 1")


def test_what_has_not_happened_is_named_with_what_there_was_instead() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        script = "exchange 1 packet 2: drop; exchange 9: drop; at 0 s: delay 1; at 600 s: drop; at 700 s: power-cycle 1"
        hall.faulted.set(f"seed 1; {script}; 1e-9%: drop; 100%: duplicate; at 0 s: torn-eeprom 1")
        hall.slept += 2.0
        hall.mount.step(timeout=0)
        said = hall.faulted.unhappened()
        facts = hall.faulted.facts()
    assert [line.partition(" (")[0] for line in said] == [
        "faults: `at 0 s: torn-eeprom 1` has not happened",
        "faults: `exchange 1 packet 2: drop` has not happened",
        "faults: `exchange 9: drop` has not happened",
        "faults: `at 0 s: delay 1` has not happened",
        "faults: `at 600 s: drop` has not happened",
        "faults: `at 700 s: power-cycle 1` has not happened",
        "faults: `1e-09%: drop` has not happened",
        "faults: `100%: duplicate` has not happened",
    ]
    assert said[0].endswith("(nothing was stored since that could be torn)")
    assert said[2].endswith("(0 exchanges were seen)")
    assert said[3].endswith("(its moment has passed, and nothing came since that it could change)")
    assert said[5].endswith(" s have passed)")
    assert facts["pending_count"] == len(facts["pending"]) == 6
    assert facts["never"] == ["1e-09%: drop", "100%: duplicate"]


def test_faults_are_refused_on_a_bus_that_may_have_real_devices() -> None:
    link = QueueLink(no_wire=False, name="can://socketcan/can0")
    hall = Hall(LinkClient(link), "kst")
    line = hall.mount.line
    for script in ("1%: drop", "at 1 s: power-cycle 1"):
        with pytest.raises(RequestError, match="can://socketcan/can0: faults are refused"):
            read_order(hall.faulted, script)
    assert hall.mount.line is line
    assert not hall.faulted.used
    assert read_order(hall.faulted, "off") is None
