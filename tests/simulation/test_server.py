"""Simulated devices on real ports: rates, pace, programs that come and go, ports that are unplugged."""

from __future__ import annotations

import os
import termios
import time
from pathlib import Path

import pytest

from motorbus import families
from motorbus.core.family import Simulator
from motorbus.errors import LinkError, RequestError
from motorbus.families.feetech.simulator import simulate
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.server import Server
from motorbus.simulation.tcp import TcpPort, parse_endpoint
from tests.simulation.programs import PING_1, PONG_1, Program, on_pty, on_tcp, serving

READ_25 = b"t62584002600000000000\r"
REPLY_25 = b"t5A584B02600000000000\r"
OPEN = b"C\rS6\rO\r"


def servos(*ids: int) -> Simulator:
    return families.load("kst").simulator(ids or (0x25,))


def set_rate(program: Program, code: int) -> None:
    settings = termios.tcgetattr(program.descriptor)
    settings[4] = settings[5] = code
    termios.tcsetattr(program.descriptor, termios.TCSANOW, settings)


# Serial lines.


def test_programs_of_a_terminal_come_and_go() -> None:
    port = PtyMaster()
    with serving(simulate((1,)), port):
        for _ in range(3):
            with on_pty(port) as program:
                assert program.ask(PING_1, 6) == PONG_1


def test_a_second_program_of_a_tcp_port_waits_for_the_first() -> None:
    port = TcpPort()
    with serving(simulate((1,)), port):
        with on_tcp(port) as first:
            assert first.ask(PING_1, 6) == PONG_1
            with on_tcp(port) as second:
                second.send(PING_1)
                assert first.ask(PING_1, 6) == PONG_1
                assert second.receive(1, 0.0) == ""
        with on_tcp(port) as third:
            assert third.ask(PING_1, 6) == PONG_1


def test_devices_follow_the_rate_that_the_program_sets() -> None:
    port = PtyMaster()
    with serving(simulate((1,)), port), on_pty(port) as program:
        assert program.ask(PING_1, 6) == PONG_1, "the terminal has the rate of the devices at first"
        set_rate(program, termios.B115200)
        program.send(PING_1)
        assert program.receive(1, 0.3) == ""
        set_rate(program, termios.B1000000)
        assert program.ask(PING_1, 6) == PONG_1


def test_pace_lets_each_byte_take_its_air_time() -> None:
    port = PtyMaster()
    with serving(simulate((1,)), port, pace=True, rate=1_000_000) as server, on_pty(port) as program:
        server.wire.rate = 1_000  # 10 ms a byte; the devices keep their rate
        server.wire.tune = lambda rate: None  # type: ignore[method-assign]
        start = time.monotonic()
        assert program.ask(PING_1, 6) == PONG_1
        assert 0.12 <= time.monotonic() - start < 0.5


# CAN.


@pytest.mark.parametrize("on_terminal", [True, False])
def test_slcan_from_open_to_close(on_terminal: bool) -> None:
    port: PtyMaster | TcpPort = PtyMaster() if on_terminal else TcpPort()
    with serving(servos(), port, slcan=True, rate=500_000):
        for _ in range(2):
            with on_pty(port) if isinstance(port, PtyMaster) else on_tcp(port) as program:
                program.say(b"C\rS5\rO\r", b"\r\r\r")
                program.say(READ_25, b"z\r")
                assert program.receive(1, 0.1) == "", "another rate"
                program.say(OPEN, b"\r\r\r")
                program.say(READ_25, b"z\r" + REPLY_25)
                program.say(b"C\r", b"\r")


def test_can_programs_receive_each_other_and_one_that_does_not_read_loses_whole_frames() -> None:
    terminal, tcp = PtyMaster(), TcpPort()
    with (
        serving(servos(), terminal, tcp, slcan=True, rate=500_000) as server,
        on_pty(terminal) as silent,
        on_tcp(tcp) as other,
    ):
        for program in (silent, other):
            program.say(OPEN, b"\r\r\r")
        other.say(READ_25, b"z\r" + REPLY_25)
        silent.say(b"", READ_25 + REPLY_25)
        for _ in range(600):
            other.say(READ_25, b"z\r" + REPLY_25)
        assert server.lost > 0
        rest = bytes.fromhex(silent.receive(1 << 20, 0.5))
        assert set(rest.split(b"\r")) == {READ_25[:-1], REPLY_25[:-1], b""}


# Unplugged ports.


def test_an_unplugged_terminal_hangs_up_and_is_back_behind_its_link(tmp_path: Path) -> None:
    port = PtyMaster(tmp_path / "bus")
    with serving(simulate((1,)), port, faults="exchange 2: unplug 0.2") as server:
        with on_pty(port) as program:
            assert program.ask(PING_1, 6) == PONG_1
            assert program.ask(PING_1, 6) == ""
        deadline = time.monotonic() + 20
        while not port.link.exists():  # type: ignore[union-attr]
            assert time.monotonic() < deadline
            time.sleep(0.01)
        with on_pty(port) as program:
            assert program.ask(PING_1, 6) == PONG_1
        assert server.faults.count == 1
    assert not os.path.lexists(tmp_path / "bus")


def test_a_terminal_without_a_link_cannot_be_unplugged() -> None:
    port = PtyMaster()
    server = Server(simulate((1,)), port, rate=1_000_000)
    with pytest.raises(RequestError, match="cannot be unplugged"):
        server.set_faults("at 1 s: unplug 1")
    server.close()


# Names of ports.


def test_a_link_replaces_only_what_a_simulator_left(tmp_path: Path) -> None:
    left, file, foreign = tmp_path / "left", tmp_path / "file", tmp_path / "foreign"
    left.symlink_to("/dev/pts/99999")
    file.touch()
    foreign.symlink_to(file)
    for path in (file, foreign):
        with pytest.raises(RequestError, match="exists already"):
            PtyMaster(path)
    port = PtyMaster(left)
    assert str(left.readlink()) == port.slave_name
    with pytest.raises(RequestError, match="exists already"):
        PtyMaster(left)
    port.close()
    port.close()
    assert not os.path.lexists(left)
    with pytest.raises(LinkError):
        PtyMaster(tmp_path / "no" / "folder")


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("4000", ("127.0.0.1", 4000)),
        (":0", ("127.0.0.1", 0)),
        ("10.0.0.7:80", ("10.0.0.7", 80)),
        ("[::1]:1", ("::1", 1)),
        ("host", None),
        ("1:65536", None),
        ("1:٣", None),
    ],
)
def test_endpoints(text: str, endpoint: tuple[str, int] | None) -> None:
    if endpoint is None:
        with pytest.raises(RequestError, match="not a TCP endpoint"):
            parse_endpoint(text)
    else:
        assert parse_endpoint(text) == endpoint
