"""The served machine of `motorbus web --demo`, and pages that a program plays."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from threading import Event, Thread
from typing import Any, NamedTuple, Self

import msgspec
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from motorbus import Robot
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.machine import MachineConfig
from motorbus.web.app import Server
from motorbus.web.demo import SimulatedMachine, simulated
from motorbus.web.service import Page, Service


class Sniffer(PerfectLine):
    """Keeps the instruction of each FEETECH packet that the host sends."""

    def __init__(self) -> None:
        self.instructions: set[int] = set()

    def carry(self, sender: Side, data: Any, at: float) -> list[Delivery]:
        """Carry what one side sends."""
        if sender is Side.HOST:
            self.instructions.add(data[4])
        return super().carry(sender, data, at)


class Served(NamedTuple):
    """A served machine."""

    robot: Robot
    service: Service
    server: Server
    faults: SimulatedMachine

    def headers(self, **changes: str) -> dict[str, str]:
        """Headers of a request of the page; an empty value leaves one out."""
        headers = {
            "Host": f"127.0.0.1:{self.server.port}",
            "Cookie": f"motorbus-{self.server.port}={self.server.token}",
            "Origin": f"http://127.0.0.1:{self.server.port}",
        } | changes
        return {name: value for name, value in headers.items() if value}

    def sniff(self) -> Sniffer:
        """What the host sends to the arm from now on."""
        line = self.faults._buses["arm"].line = Sniffer()
        return line

    def position(self, name: str) -> float:
        """The last position (rad) of an axis."""
        position = self.robot.snapshot().axes[name].position
        assert position is not None
        return position


@contextmanager
def serve(folder: Path) -> Iterator[Served]:
    """Serve the demo machine."""
    file = folder / "demo.toml"
    file.write_bytes((files("motorbus.cli") / "demo.toml").read_bytes())
    config = MachineConfig.load(file)
    with (
        simulated(config) as (config, faults),
        Robot(config) as robot,
        Service(robot, folder / "recordings", faults) as service,
        Server(service) as server,
    ):
        robot.set_position("slide", 0.05)
        yield Served(robot, service, server, faults)


class Client:
    """A page over the socket, which sends heartbeats until `silent` is set. `messages` has all but states."""

    def __init__(self, served: Served) -> None:
        headers = served.headers()
        self._connection = connect(
            f"ws://{headers['Host']}/ws",
            origin=Origin(headers["Origin"]),
            additional_headers={"Cookie": headers["Cookie"]},
            close_timeout=0.2,  # a client that reads nothing does not see the close
        )
        self.messages: list[dict[str, Any]] = []
        self.frame: dict[str, Any] = {}
        self.silent = Event()

    def __enter__(self) -> Self:
        self.socket: ClientConnection = self._connection.__enter__()
        self._beats = Thread(target=self._beat)
        self._beats.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.silent.set()
        self._beats.join()
        self._connection.__exit__(None, None, None)

    def _beat(self) -> None:
        with suppress(ConnectionClosed):
            while not self.silent.wait(0.1):
                self.send(type="heartbeat")

    def send(self, **message: Any) -> None:
        """Send a message."""
        self.socket.send(json.dumps(message))

    def wait(self, condition: Callable[[Client], bool], seconds: float = 10.0) -> None:
        """Read what comes until this holds."""
        end = time.monotonic() + seconds
        while not condition(self):
            assert time.monotonic() < end, (self.messages, self.frame)
            try:
                message = json.loads(self.socket.recv(0.1))
            except TimeoutError:
                continue
            if message["type"] == "state":
                self.frame = message
            else:
                self.messages.append(message)

    def got(self, kind: str, **fields: Any) -> bool:
        """A message of this type, with these fields, has come."""
        return any(one.items() >= (fields | {"type": kind}).items() for one in self.messages)

    @property
    def last(self) -> dict[str, Any]:
        """The last message that is no state."""
        return self.messages[-1]

    def axis(self, name: str) -> dict[str, Any]:
        """An axis in the last state."""
        found: dict[str, Any] = self.frame["state"]["axes"][name]
        return found


class Recorder(Page):
    """A page without a socket."""

    def __init__(self) -> None:
        super().__init__(asyncio.new_event_loop())
        self._loop.close()
        self.got: list[Any] = []

    def put(self, message: msgspec.Struct) -> None:
        """Keep a message."""
        self.got.append(message)


def wait_for(condition: Callable[[], bool], seconds: float = 8.0) -> None:
    """Wait until this holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
