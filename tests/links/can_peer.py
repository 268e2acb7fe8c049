"""The other end of a CAN link in tests: a real port, a thread that serves it, and an adapter.

Frames of the host are kept, and sent back with the identifier plus one. `say` sends further data.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable, Iterator
from select import select
from threading import Event, Thread
from typing import Protocol, TypeAlias

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.link import url
from motorbus.link.can import PythonCanLink
from motorbus.link.slcan import SlcanLink
from motorbus.simulation.adapter import Adapter
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.slcan import SlcanAdapter

PING = CanFrame(0x625, bytes.fromhex("40 02 60 00 00 00 00 00"))
PONG = PING._replace(id=0x626)
LONG_PING = CanFrame(0x625, b"\x01", extended=True)


class Mute(SlcanAdapter):
    """An slcan adapter that sends no replies, as some do."""

    def take(self) -> bytes:
        super().take()
        return b""


class Picky(SlcanAdapter):
    """An slcan adapter that refuses some commands and keeps all of them."""

    def __init__(self, *refused: bytes) -> None:
        super().__init__()
        self.refused = refused
        self.refusals = b""
        self.commands: list[bytes] = []

    def feed(self, data: bytes, at: float = 0.0) -> list[CanFrame]:
        frames = []
        for line in data.split(b"\r")[:-1]:
            self.commands.append(line)
            if line in self.refused:
                self.refusals += b"\a"
            else:
                frames += super().feed(line + b"\r", at)
        return frames

    def take(self) -> bytes:
        refusals, self.refusals = self.refusals, b""
        return super().take() + refusals


class SocketcandServer(SlcanAdapter):
    """A server of socketcand in raw mode: standard data frames and error frames."""

    def __init__(self) -> None:
        super().__init__()
        self.answer = b""

    def feed(self, data: bytes, at: float = 0.0) -> list[CanFrame]:
        frames = []
        for words in (element.split() for element in data.decode().replace("<", "").split(">")):
            if words[:1] == ["send"]:
                frames.append(
                    CanFrame(
                        int(words[1], 16), bytes(int(word, 16) for word in words[3:]), len(words[1]) == 8
                    )
                )
            elif words:
                self.answer += b"< ok >"
        return frames

    def take(self) -> bytes:
        answer, self.answer = self.answer, b""
        return answer

    def deliver(self, frame: CanFrame, at: float) -> bytes:
        if frame.id & ERROR_FLAG:
            return f"< error {frame.id & ~ERROR_FLAG:X} {at:.6f} >".encode()
        number = f"{frame.id:0{8 if frame.extended else 3}X}"
        return f"< frame {number} {at:.6f} {frame.data.hex()} >".encode()


class Peer:
    """An adapter on a port; `url` is how a host opens it."""

    def __init__(self, adapter: Adapter, url: str) -> None:
        self.adapter = adapter
        self.url = url
        self.received: list[CanFrame] = []
        self.echoes = True
        self.write: Callable[[bytes], object] = lambda _: None

    def say(self, *data: bytes | CanFrame) -> None:
        """Bytes as they are; a frame as the adapter delivers it."""
        for item in data:
            self.write(self.adapter.deliver(item, 1.0) if isinstance(item, CanFrame) else item)

    def receive(self, data: bytes) -> None:
        frames = self.adapter.feed(data)
        answer = self.adapter.take()
        self.received += frames
        if self.echoes:
            for frame in frames:
                answer += self.adapter.deliver(frame._replace(id=frame.id + 1), 1.0)
        if answer:
            self.write(answer)


class Readable(Protocol):
    def fileno(self) -> int: ...


@contextlib.contextmanager
def serving(source: Readable, receive: Callable[[], bool]) -> Iterator[None]:
    """A thread that calls `receive` for data, until it returns False."""
    over = Event()

    def run() -> None:
        while True:
            ending = over.is_set()  # data from before the end is still received
            if select((source,), (), (), 0.0 if ending else 0.02)[0]:
                if not receive():
                    return
            elif ending:
                return

    thread = Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@contextlib.contextmanager
def on_terminal(adapter: Adapter | None = None) -> Iterator[Peer]:
    """An slcan adapter on a pseudo-terminal."""
    master = PtyMaster()
    peer = Peer(adapter or SlcanAdapter(), f"can://slcan{master.slave_name}")
    peer.write = master.write

    def receive() -> bool:
        peer.receive(master.read())
        return True

    try:
        with serving(master, receive):
            yield peer
    finally:
        master.close()


@contextlib.contextmanager
def on_socket(make: Callable[[], Adapter], url: str) -> Iterator[Peer]:
    """An adapter for each that connects; `peer` speaks to the last. `url` has a place for the TCP port."""
    with socket.create_server(("127.0.0.1", 0)) as server, contextlib.ExitStack() as ends:
        peer = Peer(make(), url.format(server.getsockname()[1]))

        def accept() -> bool:
            connection = ends.enter_context(server.accept()[0])
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer.adapter = make()
            peer.write = connection.sendall
            if isinstance(peer.adapter, SocketcandServer):
                peer.write(b"< hi >")
            ends.enter_context(serving(connection, lambda: _receive(peer, connection)))
            return True

        with serving(server, accept):
            yield peer
        ends.close()


def _receive(peer: Peer, connection: socket.socket) -> bool:
    """A host may hang up at any moment, also before it reads the reply."""
    try:
        data = connection.recv(4096)
        if data:
            peer.receive(data)
    except OSError:
        return False
    return bool(data)


@contextlib.contextmanager
def slcan_server() -> Iterator[Peer]:
    with on_socket(SlcanAdapter, "can://slcan/socket://127.0.0.1:{}") as peer:
        yield peer


@contextlib.contextmanager
def socketcand_server() -> Iterator[Peer]:
    with on_socket(SocketcandServer, "can://socketcand/127.0.0.1:{}/can0") as peer:
        yield peer


CanLink: TypeAlias = PythonCanLink | SlcanLink


def open_can(peer: Peer | str, rate: int = 0, **options: object) -> CanLink:
    """As a session opens it."""
    port = peer if isinstance(peer, str) else peer.url
    return url.open_can(port, rate=rate, default_rate=500_000, options=options)


def some(link: CanLink, count: int = 1, seconds: float = 30.0) -> list[Data]:
    """The next frames, however long they take within reason."""
    end = link.now() + seconds
    frames: list[Data] = []
    while len(frames) < count and link.now() < end:
        frames += link.read(end)
    return frames


def remote(id: int, count: int = 0, *, extended: bool = False) -> CanFrame:
    return CanFrame(id | REMOTE_FLAG, bytes(count), extended)
