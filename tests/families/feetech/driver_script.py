"""Carries out driver functions by hand: each exchange they yield is checked byte by byte against a script.

A line of a script is what must be sent and what comes back: a packet, several (for a group), None for silence, or
an exception. Packets are made here by hand, so the driver is judged by bytes it did not make. What a bus would add
(retries, taint, deadlines) is not here: that belongs to the tests of the bus.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias, TypeVar

from motorbus.core.request import ANY, Effect, Reply, Request, Response
from motorbus.core.steps import Emit, Exclusive, Runnable, SetBitrate, Shielded, Sleep
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown
from motorbus.families.feetech.driver import Node
from tests.families.player import played

T = TypeVar("T")

PING, READ, WRITE, REG_WRITE, ACTION = 1, 2, 3, 4, 5
SYNC_READ, SYNC_WRITE = 0x82, 0x83
ALL = 254
EEPROM_END = 40
"""Registers below this one are EEPROM in every map."""

Back: TypeAlias = bytes | Sequence[bytes] | BaseException | None


class Line(NamedTuple):
    """What must be sent, and what comes back."""

    sent: bytes
    back: Back


def packet(id: int, code: int, *parameters: int) -> bytes:
    """FF FF, id, parameters + 2, instruction or error byte, parameters, and the low byte of the sum turned over."""
    body = [id, len(parameters) + 2, code, *parameters]
    return bytes([0xFF, 0xFF, *body, 255 - sum(body) % 256])


def low_high(value: int) -> tuple[int, int]:
    """Two bytes, low one first; a negative number has bit 15 set."""
    code = value if value >= 0 else -value | 0x8000
    return code & 255, code >> 8


def reads(id: int, address: int, *data: int, error: int = 0) -> Line:
    """READ of as many bytes as come back."""
    return Line(packet(id, READ, address, len(data)), packet(id, error, *data))


def writes(id: int, address: int, *data: int, error: int = 0) -> Line:
    """WRITE, acknowledged."""
    return Line(packet(id, WRITE, address, *data), packet(id, error))


def looks(*lines: Line) -> tuple[Line, ...]:
    """The look at the EEPROM cells that these lines write one after the other: each holds something else as yet.

    What they say of other registers (lock, torque switch) is not looked at.
    """
    found = []
    for line in lines:
        _, _, id, _, code, address, *rest = line.sent
        if code == WRITE and address < EEPROM_END:
            found.append(reads(id, address, *(byte ^ 1 for byte in rest[:-1])))
    return tuple(found)


def looked(*lines: Line) -> tuple[Line, ...]:
    """`looks`, and the torque switch of a limp servo 3, which a write by name reads before it writes."""
    return (*looks(*lines), reads(3, 40, 0))


def unheard(line: Line) -> Line:
    """The same request, and nothing comes back."""
    return Line(line.sent, None)


def sync_reads(address: int, replies: dict[int, tuple[int, ...] | None], count: int) -> Line:
    """SYNC READ; None for an id that does not answer."""
    packets = [packet(id, 0, *data) for id, data in replies.items() if data is not None]
    return Line(packet(ALL, SYNC_READ, address, count, *replies), packets)


def image(id: int = 3, **changes: int) -> bytes:
    """Registers 0 to 39 of an STS3215 as shipped; `changes` by address, as `at_33=1`."""
    values = [
        *(3, 10, 0, 9, 3, id, 0, 0, 1, 0, 0, 0xFF, 0x0F, 70, 80, 40, 0xE8, 0x03, 12, 44),
        *(47, 32, 32, 0, 16, 0, 1, 1, 0xF4, 0x01, 1, 0, 0, 0, 20, 200, 80, 10, 200, 10),
    ]
    for name, value in changes.items():
        values[int(name.removeprefix("at_"))] = value
    return bytes(values)


def prepares(id: int = 3, **changes: int) -> Line:
    """The one READ that tells identity and settings."""
    return reads(id, 0, *image(id, **changes))


def prepared(id: int = 3, **changes: int) -> Node:
    """A node that is known already."""
    from motorbus.families.feetech.driver.identity import learn

    node = Node(id)
    learn(node, image(id, **changes))
    return node


class Played:
    """What happened: exchanges, packets, events, rates and pauses in order, and the value in the end."""

    def __init__(
        self, script: Sequence[Line], interrupt_at: int | None = None, *, rate: int = 1_000_000
    ) -> None:
        self.script = list(script)
        self.interrupt_at = interrupt_at
        self.requests: list[Request[Any]] = []
        self.events: list[object] = []
        self.rate = rate
        self.rates: list[int] = []
        self.alone = 0
        self.now = 100.0

    @property
    def sent(self) -> list[bytes]:
        """Every packet in order."""
        return [bytes(request.wire) for request in self.requests if isinstance(request.wire, bytes)]

    def run(self, runnable: Runnable[T]) -> T:
        """Carry it out to its end; at exchange number `interrupt_at` a KeyboardInterrupt is thrown in instead."""
        return played(runnable, self._carry_out)

    def _carry_out(self, step: Any) -> Any:
        if isinstance(step, Request):
            return self._exchange(step)
        if isinstance(step, Exclusive):
            self.alone += 1
            return self.run(step.runnable)
        if isinstance(step, Shielded):
            return self._shielded(step)
        if isinstance(step, SetBitrate):
            return self._tune(step.rate)
        if isinstance(step, Emit):
            self.events.append(step.event)
        elif isinstance(step, Sleep):
            self.now += step.seconds
            return self.now
        else:
            raise AssertionError(f"unexpected step {step!r}")
        return None

    def _shielded(self, step: Shielded[Any]) -> Any:
        """The end of a guard; an interruption in it is raised when it has ended."""
        at, self.interrupt_at, first = self.interrupt_at, None, len(self.requests)
        value = self.run(step.runnable)
        self.interrupt_at = at
        if at is not None and first <= at < len(self.requests):
            raise KeyboardInterrupt
        return value

    def _tune(self, rate: int) -> int:
        """The rate there was; 0 only asks."""
        before = self.rates[-1] if self.rates else self.rate
        if rate:
            self.rates.append(rate)
        return before

    def _exchange(self, request: Request[Any]) -> Any:
        number = len(self.requests)
        self.requests.append(request)
        if number == self.interrupt_at:
            raise KeyboardInterrupt
        assert self.script, f"nothing more was expected, but {bytes_of(request).hex(' ')} was sent"
        line = self.script.pop(0)
        assert bytes_of(request).hex(" ") == line.sent.hex(" ")
        self.now += 0.001
        if isinstance(line.back, BaseException):
            raise line.back
        return self._answer(request, line.back)

    def _answer(self, request: Request[Any], back: bytes | Sequence[bytes] | None) -> Any:
        frames = [] if back is None else [back] if isinstance(back, bytes) else list(back)
        dues = request.expected
        assert dues is not ANY
        replies = []
        for due in dues:
            replies += [Reply(0, due.key, f) for f in frames if f[2] == due.node and len(f) == due.length][:1]
        assert sorted(frames) == sorted(reply.data for reply in replies), (
            "a reply that is not due, or of wrong length"
        )
        missing = tuple(due.node for due in dues if due.node not in {reply.data[2] for reply in replies})
        if len(dues) == 1 and missing:
            raise silence(request)
        answer = Response(tuple(replies), missing, self.now)
        return answer if request.decode is None else request.decode(answer)


def silence(request: Request[Any]) -> MotorbusError:
    """As the bus has it: silence after a read is NoReply, after a write nobody knows what became of it."""
    changes = request.effect is not Effect.NONE or not request.repeatable
    return OutcomeUnknown("no acknowledgement") if changes else NoReply("silence")


def bytes_of(request: Request[Any]) -> bytes:
    assert isinstance(request.wire, bytes)
    return request.wire


def play(runnable: Runnable[T], *script: Line) -> T:
    """Carry out with this script, not a packet more or less; the value in the end."""
    played = Played(script)
    value = played.run(runnable)
    assert played.script == [], "these exchanges were expected and did not come"
    return value


def watch(runnable: Runnable[Any], *script: Line) -> Played:
    """As `play`; what happened instead of the value."""
    played = Played(script)
    played.run(runnable)
    assert played.script == []
    return played
