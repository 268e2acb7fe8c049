"""Ports that are read without waiting: silence is not a hang-up, and a hang-up is not silence."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator

import pytest
import serial  # type: ignore[import-untyped]

from motorbus.link.can_port import CHUNK, Descriptor, Port, SerialObject, SocketObject
from motorbus.simulation.pty import PtyMaster


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        yield ours, theirs


@pytest.fixture(params=["descriptor", "socket"])
def port(request: pytest.FixtureRequest, pair: tuple[socket.socket, socket.socket]) -> Port:
    return Descriptor(pair[0].fileno()) if request.param == "descriptor" else SocketObject(pair[0])


def test_bytes_go_and_come(port: Port, pair: tuple[socket.socket, socket.socket]) -> None:
    assert port.read() == b""
    assert port.write(b"O\r") == 2
    assert pair[1].recv(9) == b"O\r"
    pair[1].send(b"\r" * (CHUNK + 1))
    assert (len(port.read()), len(port.read()), port.read()) == (CHUNK, 1, b"")
    assert port.fileno() == pair[0].fileno()


def test_a_full_port(port: Port) -> None:
    while port.write(bytes(CHUNK)):
        pass
    assert port.write(b"O\r") == 0


def test_a_hang_up(port: Port, pair: tuple[socket.socket, socket.socket]) -> None:
    pair[1].close()
    with pytest.raises(ConnectionError, match="hung up"):
        port.read()
    with pytest.raises(BrokenPipeError):
        port.write(b"O\r")


def test_a_terminal_that_pyserial_has_set_up(master: PtyMaster) -> None:
    with serial.Serial(master.slave_name, timeout=0) as terminal:
        port = Descriptor(terminal.fileno())
        assert port.read() == b""
        master.write(b"\r\a")
        assert port.read() == b"\r\a"


def test_a_port_of_pyserial(master: PtyMaster) -> None:
    with serial.Serial(master.slave_name) as terminal:
        port = SerialObject(terminal)
        assert (port.read(), port.fileno()) == (b"", None)
        master.write(b"\r\a")
        heard = b""
        while len(heard) < 2:
            heard += port.read()
        assert heard == b"\r\a"
        assert port.write(b"O\r") == 2
        assert os.read(master.fileno(), 9) == b"O\r"
