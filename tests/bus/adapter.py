"""Binds the vocabulary of the engine tests (submit, deliver, advance, cancel, stop, sent, result) to the engine.

The one file of the engine tests that names classes of the bus. Time is virtual; nothing here waits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from motorbus.bus.blocking import Bus
from motorbus.bus.stop_socket import StopOutcome
from motorbus.bus.tasks import Tree
from motorbus.core.request import ANY, Data, Expected, Request, Response
from motorbus.core.request import Effect as Effect
from motorbus.core.request import Priority as Priority
from motorbus.core.request import TimeoutClass as TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Exclusive, WaitFor
from motorbus.errors import LinkLost
from motorbus.families import feetech, kst
from motorbus.families.kst import sdo
from motorbus.link.memory import MemoryLink
from tests.bus.script import Check

Cancelled = KeyboardInterrupt
PENDING = object()
FAMILIES: dict[str, Any] = {"feetech": feetech.FAMILY, "kst": kst.FAMILY}


def request(
    frame: Data,
    expected: Sequence[tuple[int, Any, int]] | None,
    decode: Callable[[list[bytes]], Any],
    *,
    priority: Priority = Priority.POLL,
    goal_of: int | None = None,
    goal: float = 0.0,
    **options: Any,
) -> Request[Any]:
    """One request and the replies it calls for: (node, key, length) each; None: all until the deadline."""
    dues = tuple(
        sdo.expected(node, *key) if isinstance(key, tuple) else Expected(node, key, length)
        for node, key, length in expected or ()
    )

    def read(answer: Response) -> Any:
        return decode([reply.data for reply in answer.replies])

    def whole(data: Any, _: float) -> Any:
        parts, start = [], 0
        for due in dues:
            part = data[start : start + due.length]
            if part[:3] != bytes([0xFF, 0xFF, due.node]) or part[4] or ~sum(part[2:-1]) & 0xFF != part[-1]:
                return None
            parts.append(part)
            start += due.length
        return decode(parts) if start == len(data) else None

    return Request(
        frame,
        ANY if expected is None else dues,
        read,
        priority=priority,
        setpoints=() if goal_of is None else (Setpoint(goal_of, "position", goal, -1.0, 1.0),),
        decode_exact=whole if isinstance(frame, bytes) and dues else None,
        **options,
    )


async def exclusive(*requests: Request[Any]) -> Any:
    """These requests in order, and no other in between."""

    async def sequence() -> list[Any]:
        values = []
        for one in requests:
            value = await one
            values.append(value)
        return values

    return await Exclusive(sequence())


async def notification(node: int, seconds: float) -> Any:
    """Wait for a notification of this node: its kind, None after so many seconds."""
    notice = await WaitFor(lambda one: one.node == node, seconds)
    return notice and notice.kind


class Wire:
    """The far end: keeps what was sent, says what it is given, and may answer and echo by itself."""

    nodes: ClassVar[dict[int, Any]] = {}

    def __init__(self) -> None:
        self.sent: list[tuple[float, Data]] = []
        self.coming: list[tuple[float, Data]] = []
        self.answer: Callable[[Any], list[Data]] = lambda frame: []
        self.delay = 0.0005
        self.echoes = False

    def tune(self, rate: int) -> None:
        self.rate = rate

    def receive(self, data: Data, at: float) -> None:
        self.sent.append((at, data))
        if self.echoes:
            self.coming.append((at, data))
        self.coming += [(at + self.delay, reply) for reply in self.answer(data)]

    def due(self) -> float | None:
        return min((at for at, _ in self.coming), default=None)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        ready = sorted((one for one in self.coming if one[0] <= to), key=lambda one: one[0])
        self.coming = [one for one in self.coming if one[0] > to]
        return ready


class Engine:
    """A bus of one family over a scripted wire, opened, with `check` as its interlock (None: it has none)."""

    def __init__(
        self,
        family: str = "feetech",
        *,
        check: Callable[[Any], None] | None = lambda request: None,
        latency: float = 0.0,
        echo: bool = False,
        listen_only: bool = False,
        answer: Callable[[Any], list[Data]] | None = None,
    ) -> None:
        self.wire = Wire()
        self.driver = FAMILIES[family].open()
        self.link = MemoryLink(self.wire, rate=self.driver.family.link.rate)
        self.link.__dict__["listen_only"] = listen_only
        self.calls: dict[str, Any] = {}
        self.bus = self.open(check, latency)
        self.wire.echoes = echo
        if answer is not None:
            self.wire.answer = answer
            if family == "feetech":  # as `motorbus.open` does
                test = self.driver.echo_test()
                self.bus.expect_echo(test)
                self.bus.run(test)
        self.wire.answer = lambda frame: []
        self.sent()

    def open(self, check: Callable[[Any], None] | None, latency: float) -> Bus:
        bus = Bus(self.link, self.driver, interlock=None if check is None else Check(check))
        bus.latency = latency
        self.engine = bus.engine
        return bus

    @property
    def now(self) -> float:
        return self.link.now()

    @property
    def quiet_time(self) -> float:
        return float(self.driver.quiet_time(self.bus.rate))

    @property
    def deadline(self) -> float:
        """Seconds until the engine acts by itself."""
        return self.engine.next_deadline() - self.now

    def submit(self, name: str, work: Any) -> None:
        self.calls[name] = Tree(self.engine, work, now=self.link.now)
        self.advance()

    def run(self, work: Any) -> Any:
        """Carry it out as a blocking caller does."""
        return self.bus.run(work)

    def cancel(self, name: str) -> None:
        self.calls[name].cancel(Cancelled())
        self.advance()

    def deliver(self, *data: Data, after: float = 0.0005) -> None:
        """These arrive after so many seconds, each by itself."""
        self.wire.coming += [(self.now + after, one) for one in data]
        self.advance(after)

    def _state(self) -> tuple[Any, ...]:
        calls = [(call.finished, len(call.ready), len(call.sending)) for call in self.calls.values()]
        return self.now, len(self.wire.sent), len(self.engine.in_flight), calls

    def advance(self, seconds: float = 0.0) -> None:
        """Let time pass, and do all that is to be done meanwhile."""
        end, same = self.now + seconds, 0
        while same < 3:
            before = self._state()
            trees = [call for call in self.calls.values() if not call.advance()]
            if self.engine.gone is not None:
                self._look_for_link(end)
            else:
                moment = self.bus.send(trees)
                if any(tree.ready for tree in trees):
                    continue
                self.bus.receive(min([end, moment, *(tree.next_moment() for tree in trees)]), trees)
                if self.engine.gone is None:
                    self.link.advance(0.0)
            same = same + 1 if before == self._state() else 0
        assert self.now >= end - 1e-9

    def _look_for_link(self, end: float) -> None:
        try:
            self.link.renew(0)
        except LinkLost as error:
            self.engine.lost(error)
            self.link.rest(end)
        else:
            self.engine.reconnected(self.now, self.engine.latency)

    def sent(self) -> list[Any]:
        """Everything sent since the last look."""
        sent, self.wire.sent = [data for _, data in self.wire.sent], []
        return sent

    def result(self, name: str) -> Any:
        """The value of a call or its error, PENDING while it has not ended."""
        call = self.calls[name]
        if not call.advance():
            return PENDING
        return call.root.value if call.error() is None else call.error()

    def estop(self) -> StopOutcome:
        outcome: StopOutcome = self.bus.estop()
        self.advance()
        return outcome

    def unplug(self) -> None:
        self.link.unplug()
        self.advance()

    def plug(self) -> None:
        self.link.plug()
        self.advance()

    def counts(self, node: int) -> Any:
        return self.bus.statistics.nodes[node]


__all__ = ["PENDING", "Cancelled", "Effect", "Engine", "LinkLost", "Priority", "TimeoutClass", "request"]
