"""A simulated KST bus with the real bus on it, and operations carried out by hand against a script.

`Bench` judges the driver by the simulator's bytes; `play` judges it by bytes that stand in the test. What a bus adds
(retries, taint, deadlines) is absent in `play`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from motorbus.bus.blocking import Bus
from motorbus.bus.stop_socket import StopOutcome
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import ANY, EVERY_LANE, Effect, Reply, Request, Response
from motorbus.core.steps import Emit, Exclusive, Gather, Runnable, SetBitrate, Sleep, WaitFor
from motorbus.errors import NoReply, OutcomeUnknown
from motorbus.families.kst import FAMILY, BusSettings, Node, Servo, notifications, sdo
from motorbus.families.kst.notifications import BusState
from motorbus.families.kst.simulator import KstBus
from motorbus.families.kst.simulator import Servo as SimulatedServo
from motorbus.link.base import Line
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from tests.families.player import played

T = TypeVar("T")


class Bench:
    """A simulated bus, the real bus on it, what was reported, and what was sent and heard."""

    def __init__(
        self,
        ids: Sequence[int] = (5,),
        *,
        profile: str = "kst",
        rate: int = 500_000,
        settings: Mapping[str, object] | None = None,
        link: type[MemoryLink] = MemoryLink,
        line: Line | None = None,
        **options: Any,
    ) -> None:
        self.driver = FAMILY.open(profile=profile, **(settings or {}))
        simulator = FAMILY.simulator(tuple(ids), profile=profile, **options)
        assert isinstance(simulator, KstBus)
        self.simulator = simulator
        self.link = link(simulator, rate=rate, line=line)
        self.events: list[Any] = []
        self.on: Callable[[Any], None] = lambda event: None
        self.bus = Bus(self.link, self.driver, interlock=Gate(), report=self._heard)
        self._trace = self.bus.trace.subscribe(limit=1_000_000)

    def _heard(self, event: object) -> None:
        self.events.append(event)
        self.on(event)

    def servo(self, node: int = 5, **how: Any) -> Servo:
        """A servo as a user holds it."""
        return Servo(self.bus, node, **how)

    def sim(self, node: int = 5) -> SimulatedServo:
        """The simulated servo behind it."""
        return self.simulator.nodes[node]

    def of(self, kind: type[T]) -> list[T]:
        """The events of this kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def sent(self) -> list[str]:
        """What left since the last time this was asked, as candump writes it."""
        return [str(record.data) for record in self._trace if record.direction == "tx"]

    def run(self, operation: Runnable[T]) -> T:
        """Carry it out."""
        return self.bus.run(operation)

    def estop(self) -> StopOutcome:
        """Stop everything."""
        return self.bus.estop()


@contextmanager
def bench(ids: Sequence[int] = (5,), **how: Any) -> Iterator[Bench]:
    """A bench, closed at the end."""
    made = Bench(ids, **how)
    try:
        yield made
    finally:
        made.bus.close()


# --- by hand ------------------------------------------------------------------------------------------------


def node(profile: str = "kst", number: int = 5, **settings: object) -> Node:
    """A servo of which nothing is known."""
    return Node(number, BusSettings(profile).replace(state=BusState(), **settings))


class Played:
    """What happened: exchanges, events, rates and seconds waited, in order.

    A script pairs what must be sent, as `605#4003600000000000`, with the data that come back: hex, several of them
    for a broadcast as `node:hex`, None for silence.
    """

    def __init__(self, script: Sequence[tuple[str, Any]]) -> None:
        self.script = list(script)
        self.requests: list[Request[Any]] = []
        self.events: list[object] = []
        self.rates: list[int] = []
        self.waited = 0.0
        self.alone = 0
        self.now = 100.0

    def run(self, runnable: Runnable[T]) -> T:
        """Carry it out to its end."""
        return played(runnable, self._carry_out)

    def _carry_out(self, step: Any) -> Any:
        if isinstance(step, Request):
            return self._exchange(step)
        if isinstance(step, Exclusive):
            self.alone += 1
            return self.run(step.runnable)
        if isinstance(step, Gather):
            return tuple(self.run(one) for one in step.runnables)
        if isinstance(step, SetBitrate):
            self.rates += [step.rate] if step.rate else []
            return 500_000
        if isinstance(step, Emit):
            self.events.append(step.event)
        elif isinstance(step, Sleep):
            self.waited += step.seconds
            self.now += step.seconds
        else:
            assert isinstance(step, WaitFor)
        return None

    def _exchange(self, request: Request[Any]) -> Any:
        self.requests.append(request)
        assert self.script, f"nothing more was expected, but {request!r} was sent"
        sent, back = self.script.pop(0)
        assert isinstance(request.wire, CanFrame)
        assert str(request.wire) == sent
        self.now += 0.001
        answer = Response(self._replies(request, back), (), self.now)
        return answer if request.decode is None else request.decode(answer)

    def _replies(self, request: Request[Any], back: Any) -> tuple[Reply, ...]:
        lines = [back] if isinstance(back, str) else list(back or ())
        replies = tuple(self._reply(request.lane, line) for line in lines)
        if request.expected is ANY:
            return replies
        for due, reply in zip(request.expected, replies, strict=False):
            assert (due.key, due.length) == (reply.key, len(reply.data)), "this reply is not due"
        if len(replies) < len(request.expected):
            changes = request.effect is not Effect.NONE or not request.repeatable
            raise OutcomeUnknown("no acknowledgement") if changes else NoReply("silence")
        return replies

    def _reply(self, lane: int, line: str) -> Reply:
        who, colon, data = line.rpartition(":")
        frame = CanFrame(sdo.REPLY + (int(who) if colon else max(lane, 1)), bytes.fromhex(data))
        (event,) = notifications.FrameReceiver().feed(frame)
        assert isinstance(event, Reply)
        assert colon or lane != EVERY_LANE
        return event


def play(runnable: Runnable[T], *script: tuple[str, Any]) -> T:
    """Carry out with this script, not a frame more or less; the value in the end."""
    played = Played(script)
    value = played.run(runnable)
    assert played.script == [], "these exchanges were expected and did not come"
    return value


def watch(runnable: Runnable[Any], *script: tuple[str, Any]) -> Played:
    """As `play`; what happened instead of the value."""
    played = Played(script)
    played.run(runnable)
    assert played.script == []
    return played


def abort(index: int, code: int, subindex: int = 0) -> str:
    """The data of a refusal."""
    return (b"\x80" + index.to_bytes(2, "little") + bytes((subindex,)) + code.to_bytes(4, "little")).hex()
