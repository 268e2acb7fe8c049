"""The other end of a CAN link in tests: a real port, a thread that serves it, and an adapter.

Frames of the host are kept, and sent back with the identifier plus one. `say` sends further data.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from select import select
from threading import Event, Thread
from typing import TypeAlias

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link import url
from motorbus.link.can import PythonCanLink
from motorbus.link.slcan import SlcanLink
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.slcan import SlcanAdapter

PING = CanFrame(0x625, bytes.fromhex("40 02 60 00 00 00 00 00"))
PONG = PING._replace(id=0x626)
LONG_PING = CanFrame(0x625, b"\x01", extended=True)


class Mute(SlcanAdapter):
    """An slcan adapter that sends no replies, as some do."""

    def take_answer(self) -> bytes:
        super().take_answer()
        return b""


class Picky(SlcanAdapter):
    """An slcan adapter that refuses some commands and keeps all of them."""

    def __init__(self, *refused: bytes) -> None:
        super().__init__()
        self.refused = refused
        self.refusals = b""
        self.commands: list[bytes] = []

    def receive(self, data: bytes) -> list[CanFrame]:
        frames = []
        for line in data.split(b"\r")[:-1]:
            self.commands.append(line)
            if line in self.refused:
                self.refusals += b"\a"
            else:
                frames += super().receive(line + b"\r")
        return frames

    def take_answer(self) -> bytes:
        refusals, self.refusals = self.refusals, b""
        return super().take_answer() + refusals


class Peer:
    """An adapter on a port; `url` is how a host opens it."""

    def __init__(self, adapter: SlcanAdapter, url: str) -> None:
        self.adapter = adapter
        self.url = url
        self.received: list[CanFrame] = []
        self.write: Callable[[bytes], object] = lambda _: None

    def say(self, *data: bytes | CanFrame) -> None:
        """Bytes as they are; a frame as the adapter delivers it."""
        for item in data:
            self.write(self.adapter.encode(item, 1.0) if isinstance(item, CanFrame) else item)

    def receive(self, data: bytes) -> None:
        frames = self.adapter.receive(data)
        self.received += frames
        echoes = (self.adapter.encode(frame._replace(id=frame.id + 1), 1.0) for frame in frames)
        self.write(self.adapter.take_answer() + b"".join(echoes))


@contextlib.contextmanager
def on_terminal(adapter: SlcanAdapter | None = None) -> Iterator[Peer]:
    """An slcan adapter on a pseudo-terminal, served by a thread."""
    master = PtyMaster()
    peer = Peer(adapter or SlcanAdapter(), f"can://slcan{master.slave_name}")
    peer.write = master.write
    over = Event()

    def serve() -> None:
        while True:
            ending = over.is_set()  # data from before the end is still received
            if select((master,), (), (), 0.0 if ending else 0.02)[0]:
                peer.receive(master.read())
            elif ending:
                return

    thread = Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield peer
    finally:
        over.set()
        thread.join()
        master.close()


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
