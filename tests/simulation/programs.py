"""Programs that use nothing but the system, on a simulated bus that a thread serves."""

from __future__ import annotations

import os
import select
import socket
import time
import tty
from collections.abc import Iterator
from contextlib import closing, contextmanager

from motorbus.core.family import Simulator
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.server import Server, ServerThread
from motorbus.simulation.tcp import TcpPort

LIMIT = 20.0  # s
RATE = 1_000_000
PING_1 = "FF FF 01 02 01 FB"
PONG_1 = "FF FF 01 02 00 FC"


class Program:
    """A descriptor of a port: `ask` sends bytes given as hex and reads the reply as hex."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor

    def send(self, text: str) -> None:
        os.write(self.descriptor, bytes.fromhex(text))

    def receive(self, count: int, limit: float = LIMIT) -> str:
        """So many bytes, or fewer when no more come within `limit` (s) or the port is gone."""
        data, end = b"", time.monotonic() + limit
        while len(data) < count and (left := end - time.monotonic()) > 0:
            if select.select([self.descriptor], (), (), left)[0]:
                try:
                    piece = os.read(self.descriptor, count - len(data))
                except OSError:
                    break
                if not piece:
                    break
                data += piece
        return data.hex(" ").upper()

    def ask(self, text: str, count: int) -> str:
        self.send(text)
        return self.receive(count)

    def say(self, line: bytes, reply: bytes) -> None:
        """Send slcan lines; the next bytes must be `reply`."""
        os.write(self.descriptor, line)
        assert bytes.fromhex(self.receive(len(reply))) == reply


@contextmanager
def serving(
    simulator: Simulator,
    *ports: PtyMaster | TcpPort,
    slcan: bool = False,
    rate: int = RATE,
    pace: bool = False,
    faults: str = "",
) -> Iterator[Server]:
    """A server at work in a thread; its errors are raised here."""
    server = Server(simulator, *ports, slcan=slcan, rate=rate, pace=pace)
    server.set_faults(faults)
    with ServerThread(server):
        yield server
    for port in ports:
        port.close()


@contextmanager
def on_pty(port: PtyMaster) -> Iterator[Program]:
    """A program that opens a pseudo-terminal in raw mode."""
    descriptor = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(descriptor)
    try:
        yield Program(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def on_tcp(port: TcpPort) -> Iterator[Program]:
    """A program that connects to a TCP port."""
    with closing(socket.create_connection((port.host, port.port), timeout=LIMIT)) as connection:
        yield Program(connection.fileno())
