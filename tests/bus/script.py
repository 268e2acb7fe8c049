"""Drives `Turns` by hand: time and bytes go in as literals, so every test reads like a table of what happened."""

from __future__ import annotations

from typing import Any

from motorbus.bus.ticket import Flight, Retune
from motorbus.bus.turns import Turns
from motorbus.core.operation import Answer, Data, Due, Exchange, Timeout
from motorbus.families.feetech import FAMILY, wire

READ_LENGTH = 8  # the status frame of a two-byte READ


def admit_all(exchange: Exchange[Any]) -> None:
    """A gate that is open, for tests that are not about the gate."""


def position(node: int, **options: Any) -> Exchange[Answer]:
    """READ two bytes at 56, repeatable."""
    return Exchange(
        wire.read(node, 56, 2),
        (Due(node, node, READ_LENGTH),),
        repeatable=True,
        tells_position=True,
        **options,
    )


def positions(*nodes: int) -> Exchange[Answer]:
    """SYNC READ two bytes at 56."""
    return Exchange(
        wire.sync_read(56, 2, nodes),
        tuple(Due(node, node, READ_LENGTH) for node in nodes),
        repeatable=True,
    )


def ping(node: int) -> Exchange[Answer]:
    """PING as a scan sends it."""
    return Exchange(wire.ping(node), (Due(node, node, 6),), timeout=Timeout.SCAN, repeatable=True)


def reply(node: int, value: int = 2048, error: int = 0) -> bytes:
    """The answer to `position`."""
    return wire.encode_status(node, error, value.to_bytes(2, "little"))


def probe_reply(request: Data, node: int) -> bytes:
    """The right answer to a probe: as many bytes as it asks for, beginning with the id."""
    assert isinstance(request, bytes)
    return wire.encode_status(node, 0, bytes([node]) + bytes(request[6] - 1))


class Script:
    """Turns and a hand-moved clock."""

    def __init__(self, **options: Any) -> None:
        self.turns = Turns(FAMILY, rate=1_000_000, **{"admit": admit_all, **options})
        self.turns.echo.excluded()
        self.now = 100.0

    def submit(self, exchange: Exchange[Any], owner: object = None) -> Flight:
        flight = Flight(exchange, owner)
        self.turns.submit(flight, self.now)
        return flight

    def send(self) -> Data | Retune | None:
        out = self.turns.send(self.now)
        self.turns.left(self.now)
        return out

    def sent(self) -> bytes:
        """What goes out now; fails when nothing does."""
        out = self.send()
        assert isinstance(out, bytes), f"expected a request, got {out!r}"
        return out

    def feed(self, *data: bytes, after: float = 0.0005) -> None:
        self.now += after
        self.turns.feed(list(data), self.now)

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.turns.expire(self.now)

    def time_out(self) -> None:
        """Let everything in the air pass its deadline."""
        self.now = self.turns.due()
        self.turns.expire(self.now)

    def clear(self, node: int) -> None:
        """Wait for the quiet time, answer the probe."""
        assert self.send() is None
        self.wait(self.turns.due() - self.now)
        request = self.sent()
        self.feed(probe_reply(request, node))
