"""Simulated servos on a real pseudo-terminal and a real socket, asked by clients that know no motorbus."""

from __future__ import annotations

import os
import socket
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import pytest

from motorbus.families.feetech.simulator import FeetechBus, simulate
from motorbus.link.base import Side
from motorbus.simulation.faults import FaultyLine
from motorbus.simulation.listener import TcpListener
from motorbus.simulation.mount import HASTE, Mount
from motorbus.simulation.pty import PtyMaster
from tests.support.mounts import asked, received, served

PING_1 = "FF FF 01 02 01 FB"
PONG_1 = "FF FF 01 02 00 FC"


@contextmanager
def terminal(bus: FeetechBus, **options: object) -> Iterator[int]:
    """A descriptor on the client's end, raw, of a bus that is served meanwhile."""
    with closing(PtyMaster()) as master, served(Mount(bus, master, **options)):  # type: ignore[arg-type]
        descriptor = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(descriptor)
        try:
            yield descriptor
        finally:
            os.close(descriptor)


@contextmanager
def client(listener: TcpListener) -> Iterator[int]:
    with socket.create_connection((listener.host, listener.port)) as connection:
        yield connection.fileno()


def set_rate(descriptor: int, code: int) -> None:
    settings = termios.tcgetattr(descriptor)
    settings[4] = settings[5] = code
    termios.tcsetattr(descriptor, termios.TCSANOW, settings)


# Real ports.


def test_a_pseudo_terminal() -> None:
    with terminal(simulate((1, 2), position=1304)) as port:
        assert asked(port, PING_1, 6) == PONG_1
        assert asked(port, "FF FF 01 04 02 38 02 BE", 8) == "FF FF 01 04 00 18 05 DD"


def test_a_socket() -> None:
    bus = simulate((1,))
    with closing(TcpListener()) as listener, served(Mount(bus, listener)), client(listener) as port:
        assert asked(port, PING_1, 6) == PONG_1


def test_a_second_client_of_a_socket_is_served_when_the_first_leaves() -> None:
    with closing(TcpListener()) as listener, served(Mount(simulate((1,)), listener)):
        first = socket.create_connection((listener.host, listener.port))
        assert asked(first.fileno(), PING_1, 6) == PONG_1
        with client(listener) as second:
            os.write(second, bytes.fromhex(PING_1))
            assert asked(first.fileno(), PING_1, 6) == PONG_1
            assert received(second, 1, patience=0.0) == ""
            first.close()
            assert received(second, 6) == PONG_1


def test_clients_of_a_terminal_come_and_go() -> None:
    with closing(PtyMaster()) as master, served(Mount(simulate((1,)), master)):
        for _ in range(3):
            port = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
            try:
                assert asked(port, PING_1, 6) == PONG_1
            finally:
                os.close(port)


def test_a_train_of_replies_arrives_whole_and_in_order() -> None:
    with terminal(simulate((1, 2, 3))) as port:
        assert asked(port, "FF FF FE 07 82 38 02 01 02 03 38", 24) == (
            "FF FF 01 04 00 00 08 F2 FF FF 02 04 00 00 08 F1 FF FF 03 04 00 00 08 F0"
        )


def test_motion_takes_real_time() -> None:
    bus = simulate((1,), position=2000)
    with terminal(bus) as port:
        # to 2048 at 1 count/s, which nobody waits for
        assert asked(port, "FF FF 01 09 03 2A 00 08 00 00 01 00 BF", 6) == PONG_1
        assert asked(port, "FF FF 01 04 02 42 01 B5", 7) == "FF FF 01 03 00 01 FA"  # moving
        # at 1000 counts/s: some 70 ms, ramps included
        assert asked(port, "FF FF 01 09 03 2A 00 08 00 00 E8 03 D5", 6) == PONG_1
        while asked(port, "FF FF 01 04 02 42 01 B5", 7) != "FF FF 01 03 00 00 FB":
            pass
        assert asked(port, "FF FF 01 04 02 38 02 BE", 8) == "FF FF 01 04 00 00 08 F2"


def test_an_eeprom_write_is_answered_later_than_a_ping_behind_it() -> None:
    with terminal(simulate((1, 2))) as port:
        assert asked(port, "FF FF 01 04 03 37 00 C0", 6) == PONG_1  # unlock
        both = "FF FF 01 04 03 0D 41 A9 FF FF 02 02 01 FA"  # max temperature 65 takes 20 ms
        assert asked(port, both, 12) == f"FF FF 02 02 00 FB {PONG_1}"


def test_nobody_reading_holds_nothing_up() -> None:
    bus = simulate((1,))
    with closing(PtyMaster()) as master:
        mount = Mount(bus, master)
        port = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
        try:
            for _ in range(300):  # 259 bytes each
                os.write(port, bytes.fromhex("FF FF 01 04 02 00 FD FB"))
                while mount.step(timeout=0.0) or bus.due() is not None:
                    pass
        finally:
            os.close(port)
        assert mount.lost > 0


# The rate.


def test_a_mismatch_stays_silent_until_the_rate_is_right() -> None:
    bus = simulate((1,))
    with closing(PtyMaster()) as master:
        mount = Mount(bus, master, rate=1_000_000)
        port = os.open(master.slave_name, os.O_RDWR | os.O_NOCTTY)
        try:
            for code, answer in ((termios.B115200, ""), (termios.B38400, ""), (termios.B1000000, PONG_1)):
                set_rate(port, code)
                os.write(port, bytes.fromhex(PING_1))
                mount.step(timeout=1.0)
                assert received(port, 6, patience=10.0 if answer else 0.0) == answer
        finally:
            os.close(port)
    assert bus.rate == 1_000_000


# Time, by hand: the clock is the test's, the port is a list.


class Wire:
    """An endpoint that writes down what reaches the host, and when."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.clock = clock
        self.said: list[bytes] = []
        self.heard: list[tuple[float, str]] = []
        self._read, self._write = os.pipe()

    def say(self, data: str) -> None:
        self.said.append(bytes.fromhex(data))
        os.write(self._write, b".")

    def fileno(self) -> int:
        return self._read

    def read(self) -> bytes:
        os.read(self._read, 1)
        return self.said.pop(0)

    def write(self, data: bytes) -> int:
        self.heard.append((round(self.clock(), 7), data.hex(" ").upper()))
        return len(data)

    def rate(self) -> int | None:
        return None

    def close(self) -> None:
        os.close(self._read)
        os.close(self._write)


class Bench:
    """A mount on such a wire."""

    def __init__(self, bus: FeetechBus, **options: object) -> None:
        self.now = 0.0
        self.wire = Wire(lambda: self.now)
        self.mount = Mount(bus, self.wire, clock=lambda: self.now, **options)  # type: ignore[arg-type]

    def until(self, moments: Iterator[float] | list[float]) -> list[tuple[float, str]]:
        for self.now in moments:
            self.mount.step(timeout=0.0)
        return self.wire.heard


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def make(bus: FeetechBus, **options: object) -> Bench:
        made.append(Bench(bus, **options))
        return made[-1]

    yield make
    for one in made:
        one.wire.close()


def steps(end: float, width: float) -> list[float]:
    return [index * width + 1e-9 for index in range(round(end / width) + 1)]  # just past each moment


def test_without_pace_short_waits_are_left_out_and_long_ones_are_not(bench: Callable[..., Bench]) -> None:
    bus = simulate((1,))
    bus.nodes[1].memory["return_delay"] = 250  # 500 µs
    here = bench(bus)
    here.wire.say(PING_1)
    assert here.until([0.0]) == [(0.0, PONG_1)]
    bus.nodes[1].memory["lock"] = 0
    here.wire.heard.clear()
    here.wire.say("FF FF 01 04 03 0D 41 A9")
    (heard,) = here.until(steps(0.03, 0.001))
    assert heard[1] == PONG_1
    assert 0.0205 - HASTE <= heard[0] <= 0.0215 - HASTE


def test_with_pace_every_byte_takes_its_time(bench: Callable[..., Bench]) -> None:
    bus = simulate((1,))
    bus.nodes[1].memory["return_delay"] = 100  # 200 µs
    here = bench(bus, pace=100_000)  # 100 µs a byte
    here.wire.say(PING_1)
    # 6 bytes there, 200 µs, 6 bytes back
    assert here.until(steps(0.002, 0.0001)) == [(0.0014, PONG_1)]


def test_with_pace_the_wire_carries_one_thing_at_a_time(bench: Callable[..., Bench]) -> None:
    here = bench(simulate((1, 2)), pace=100_000)
    here.wire.say(PING_1)
    here.wire.say("FF FF 02 02 01 FA")  # does not wait for the answer
    assert here.until(steps(0.004, 0.0001)) == [(0.0018, PONG_1), (0.0024, "FF FF 02 02 00 FB")]


def test_with_pace_a_train_keeps_its_order_and_its_time(bench: Callable[..., Bench]) -> None:
    here = bench(simulate((1, 2)), pace=1_000_000)
    here.wire.say("FF FF FE 06 82 38 02 01 02 3C")
    assert [at for at, _ in here.until(steps(0.001, 0.00001))] == [0.00018, 0.00026]


# Faults between.


def test_a_scripted_fault_is_between_simulator_and_port(bench: Callable[..., Bench]) -> None:
    line = FaultyLine(
        "exchange 1 byte 5: corrupt 01; exchange 2 byte 0 to device: drop; exchange 3 byte 0: delay 1"
    )
    here = bench(simulate((1,)), line=line)
    for _ in range(3):
        here.wire.say(PING_1)
    assert here.until(steps(1.3, 0.1)) == [(0.0, "FF FF 01 02 00 FD"), (1.2, PONG_1)]
    assert [fired.to for fired in line.fired] == [Side.HOST, Side.DEVICE, Side.HOST]


# What cannot be.
