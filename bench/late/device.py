"""A servo whose replies are late now and then, on a line that may echo, and the count of what its readers believed.

A reply that is late comes when the reader has given up and asks again: as soon as the next request is heard, and thus
before that one's own answer. Order is kept, as devices and adapters keep it. After each request the servo stands
elsewhere, so a value of an earlier call is known; places repeat after 4000 requests.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import NamedTuple

ID, NOBODY = 1, 9
POSITION, TORQUE = 56, 40
SHARE = 0.01
"""Of the replies are late."""
SOON, DELAY = 50e-6, 500e-6
"""s from a request to a reply that was kept back, and to its own."""
PLACES = 4000
ECHOES = 1000
"""Calls of each kind on a line that echoes."""


class Tally(NamedTuple):
    """What became of so many calls: `right`, an `error`, or `stale`, which is a success that is not true."""

    calls: int
    right: int
    stale: int
    errors: int
    late: int = 0


def place(heard: int) -> int:
    """Where a FEETECH servo stands after so many requests, in counts."""
    return 17 + heard * 7919 % PLACES


def tally(
    ask: Callable[[], int | None],
    heard: Callable[[], int],
    count: int,
    where: Callable[[int], int] = place,
) -> Tally:
    """So many readings. One is right that was true after a request that was heard during its call; None is an error."""
    right = stale = errors = 0
    for _ in range(count):
        before = heard()
        value = ask()
        if value is None:
            errors += 1
        elif any(value == where(now) for now in range(before + 1, heard() + 1)):
            right += 1
        else:
            stale += 1
    return Tally(count, right, stale, errors)


def forged(succeeds: Callable[[], bool], count: int) -> Tally:
    """So many calls to a servo that does not exist: none can succeed."""
    false = sum(succeeds() for _ in range(count))
    return Tally(count, 0, false, count - false)


def packet(node: int, code: int, parameters: bytes = b"") -> bytes:
    """A FEETECH instruction packet or status packet."""
    body = bytes((node, len(parameters) + 2, code)) + parameters
    return b"\xff\xff" + body + bytes((~sum(body) & 255,))


class Lateness:
    """Which replies are late, the same for the same seed; keeps the one that is."""

    def __init__(self, seed: int, share: float = SHARE) -> None:
        self._random = Random(seed)
        self._share = share
        self._held: list[object] = []
        self.late = 0

    def kept_back(self) -> list[object]:
        """A request was heard: what had been kept back until then."""
        held, self._held = self._held, []
        return held

    def is_late(self, reply: object) -> bool:
        """Whether this reply is kept back."""
        if self._random.random() >= self._share:
            return False
        self._held.append(reply)
        self.late += 1
        return True


class Servo:
    """A FEETECH servo with the id 1 that knows READ, WRITE and PING; nobody else is there."""

    def __init__(self, seed: int, share: float = SHARE, echo: bool = False) -> None:
        self.lateness = Lateness(seed, share)
        self.echo = echo
        self.heard = 0

    def hear(self, request: bytes) -> tuple[bytes, bytes]:
        """What comes of this request: bytes at once (or `SOON`), and bytes after the usual `DELAY`."""
        first = request if self.echo else b""
        if request[2] != ID:
            return first, b""
        self.heard += 1
        first += b"".join(bytes(one) for one in self.lateness.kept_back() if isinstance(one, bytes))
        data = place(self.heard).to_bytes(2, "little") if request[4] == 2 else b""
        reply = packet(ID, 0, data)
        return first, b"" if self.lateness.is_late(reply) else reply
