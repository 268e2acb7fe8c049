"""A simulated CAN bus on real ports: slcan on a pseudo-terminal and on TCP, and several at once."""

from __future__ import annotations

import os
import select
import socket
import tty
from collections.abc import Iterator
from contextlib import closing, contextmanager

from motorbus.link.base import Line
from motorbus.simulation.clients import CanClient, Door
from motorbus.simulation.listener import TcpPort
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.slcan import SlcanAdapter
from tests.simulation.parrots import Parrots
from tests.support.mounts import PATIENCE, served
from tests.support.noisy_line import NoisyLine

ASK, ANSWER = b"t60120102\r", b"t68120102\r"


class Program:
    """A client that knows nothing but the system: say bytes, await bytes."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self.rest = b""

    def say(self, data: bytes) -> None:
        os.write(self.descriptor, data)

    def hears(self, expected: bytes) -> bool:
        """Exactly these bytes come next."""
        while len(self.rest) < len(expected) and select.select([self.descriptor], (), (), PATIENCE)[0]:
            piece = os.read(self.descriptor, 4096)
            if not piece:
                break
            self.rest += piece
        begun, self.rest = self.rest[: len(expected)], self.rest[len(expected) :]
        assert begun == expected
        return True

    def opens(self, rate: bytes = b"6") -> None:
        """As an slcan host."""
        self.say(b"C\rS" + rate + b"\rO\r")
        self.hears(b"\r\r\r")


@contextmanager
def terminal(master: PtyMaster) -> Iterator[Program]:
    descriptor = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(descriptor)
    try:
        yield Program(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def slcan(bus: Parrots, *, rate: int | None = None, line: Line | None = None) -> Iterator[Program]:
    """A program on the pseudo-terminal of this bus, which is served meanwhile."""
    with closing(PtyMaster()) as master:
        mount = Mount(bus, master, adapter=SlcanAdapter(), rate=rate, line=line)
        with served(mount), terminal(master) as program:
            yield program


@contextmanager
def caller(door: Door) -> Iterator[Program]:
    with socket.create_connection((door.port.host, door.port.port), timeout=PATIENCE) as connection:
        yield Program(connection.fileno())


def test_slcan_on_a_pseudo_terminal() -> None:
    with closing(PtyMaster()) as master, served(Mount(Parrots(), master, adapter=SlcanAdapter())):
        for _ in range(2):  # another client later
            with terminal(master) as program:
                program.opens()
                program.say(ASK)
                assert program.hears(b"z\r" + ANSWER)
                program.say(b"C\r")
                assert program.hears(b"\r")


def test_slcan_on_tcp() -> None:
    door = Door(TcpPort(), SlcanAdapter)
    with closing(door), served(Mount(Parrots(), door)), caller(door) as program:
        program.opens()
        program.say(ASK)
        assert program.hears(b"z\r" + ANSWER)


def test_everyone_on_the_bus_hears_everyone_but_himself() -> None:
    door = Door(TcpPort(), SlcanAdapter)
    with closing(PtyMaster()) as master, closing(door):
        mount = Mount(Parrots(), CanClient(master, SlcanAdapter()), door)
        with served(mount), terminal(master) as one, caller(door) as other, caller(door) as third:
            for program in (one, other, third):
                program.opens()
            one.say(ASK)
            assert one.hears(b"z\r" + ANSWER)
            for program in (other, third):
                assert program.hears(ASK + ANSWER)
            other.say(b"t1231FF\r")
            assert one.hears(b"t1231FF\rt1A31FF\r")


def test_who_leaves_does_not_end_it_for_the_others() -> None:
    door = Door(TcpPort(), SlcanAdapter)
    with closing(door), served(Mount(Parrots(), door)), caller(door) as one:
        one.opens()
        with caller(door) as other:
            other.opens()
        one.say(ASK)
        assert one.hears(b"z\r" + ANSWER)


# The bit rate.


def test_devices_of_another_rate_are_silent_until_it_is_right() -> None:
    bus = Parrots(250_000)
    with slcan(bus, rate=500_000) as program:
        program.opens(b"6")
        program.say(ASK + b"V\r")
        assert program.hears(b"z\rV1013\r")
        program.opens(b"5")
        program.say(ASK)
        assert program.hears(b"z\r" + ANSWER)


def test_a_client_that_closes_leaves_the_bus_at_its_own_rate() -> None:
    bus = Parrots(500_000)
    with slcan(bus, rate=500_000) as program:
        program.opens(b"5")
        for word in (b"C\r", b"O\r"):
            program.say(word)
            program.hears(b"\r")
    assert bus.tuned == [250_000, 500_000, 250_000]


# What is between, and what cannot be.


def test_faults_strike_frames() -> None:
    line = NoisyLine(1, duplicate=1.0)
    with slcan(Parrots(), line=line) as program:
        program.opens()
        program.say(ASK)
        assert program.hears(b"z\r" + ANSWER * 2)


def test_nobody_reading_holds_nothing_up_and_frames_stay_whole() -> None:
    with closing(PtyMaster()) as master:
        mount = Mount(Parrots(), master, adapter=SlcanAdapter())
        with terminal(master) as program:
            program.say(b"S6\rO\r")
            while not mount.lost:
                program.say(ASK)
                mount.step(timeout=0.0)
            lines = b""
            while select.select([program.descriptor], (), (), 0.05)[0]:
                lines += os.read(program.descriptor, 65536)
                mount.step(timeout=0.0)
    assert set(lines.split(b"\r")) == {b"", b"z", ANSWER.strip()}


def test_with_pace_a_flood_is_held_back() -> None:
    with closing(PtyMaster()) as master:
        mount = Mount(Parrots(), master, adapter=SlcanAdapter(), pace=1000)
        with terminal(master) as program:
            program.say(b"O\r" + ASK * 1000)
            for _ in range(10):
                mount.step(timeout=0.0)
            program.say(ASK * 300)
            for _ in range(10):
                mount.step(timeout=0.0)
            assert mount.course.crowded
