"""Any requests in any order over a line that loses, delays, damages, cuts and copies, judged by who asked for what.

The far end gives every reply a value of its own and keeps the order of each line, as links do. So a value that
belongs to another request, or to an earlier try of the same one, is recognised.
"""

from __future__ import annotations

from collections import Counter, deque
from typing import Any, ClassVar, NamedTuple

import pytest
from hypothesis import Phase, event, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from motorbus.core.operation import CanFrame
from motorbus.errors import Interrupted, LinkLost, MotorbusError
from tests.bus.adapter import PENDING, Cancelled, Engine, Priority, request
from tests.bus.frames import (
    BROADCAST,
    CAN_GOAL,
    CAN_POSITION,
    GOAL,
    ID,
    TORQUE,
    Servos,
    can_move,
    can_value,
    checksummed,
    instruction,
    move,
    said,
    status,
    upload_frame,
    uploaded,
    value_of,
    write,
)
from tests.conftest import Rounds

NODES = st.integers(1, 3)
PRIORITIES = st.sampled_from([Priority.CONTROL, Priority.POLL, Priority.CONFIGURATION])
TIMES = st.sampled_from([0.0002, 0.002, 0.01, 0.025, 0.06, 0.3])
NOISE = st.sampled_from(
    [b"\x00", b"\xff", b"\x11\x22\x33", b"\xff\xff\x01\x04\x00", b"\xff\xff\x02\x02\x00\x00"]
)
SOONEST = 0.003  # s; no time-out of any request is shorter
MOVED = 9999  # the goal of every motion order


class Sent(NamedTuple):
    """A frame of the host, and the replies that it calls for."""

    at: float
    frame: Any
    nodes: tuple[int, ...]
    is_probe: bool


class Call:
    """A submitted call: its frames begin with `mark`, which no other call has."""

    def __init__(self, engine: Engine, name: str, mark: Any, kind: str) -> None:
        self.name, self.mark, self.kind = name, mark, kind
        self.outcome: Any = PENDING
        self.was_latched = engine.bus.latched


class Model(RuleBasedStateMachine):
    """What both kinds of bus have in common."""

    family: ClassVar[str]
    seen: ClassVar[Counter[str]] = Counter()

    def __init__(self) -> None:
        super().__init__()
        self.engine = Engine(self.family, answer=Servos())
        self.calls: list[Call] = []
        self.count = 0
        self.sent: list[Sent] = []
        self.values: dict[int, int] = {}  # value -> number of the frame that it answers
        self.lines: dict[int, deque[tuple[int, Any]]] = {}  # lane -> (number of its frame, reply), in order
        self.owes: dict[int, int] = {}  # node -> number of the last frame whose reply has not been delivered
        self.touched: dict[int, float] = {}  # lane -> when something was delivered last
        self.cut_off = 0  # a stop or a loss has cut short the frames before this number
        self.servos = Servos(self._value)
        self.answered: set[int] = set()  # numbers of the frames that were answered at once

    # -- the far end -----------------------------------------------------------------------------------------

    def _value(self, node: int) -> int:
        self.count += 1
        value = (self.count // 200) << 8 | self.count % 200 + 1
        self.values[value] = len(self.sent) + len(self.engine.wire.sent) - 1
        return value

    def _answer(self, frame: Any) -> Any:
        self.answered.add(len(self.sent) + len(self.engine.wire.sent) - 1)
        return self.servos(frame)

    def _answering(self, seconds: float) -> None:
        """For so long every frame is answered at once; what was on its way before is lost."""
        for lane in self.lines:
            while self.lines[lane]:
                self._taken(lane, whole=False)
        self.engine.wire.answer = self._answer
        self.engine.advance(seconds)

    def _silent(self) -> None:
        self._collect()
        self.engine.wire.answer = lambda frame: []

    def lane_of(self, node: int) -> int:
        raise NotImplementedError

    def parse(self, frame: Any) -> tuple[tuple[int, ...], bool, bool, bool]:
        """Nodes that must reply; is it a probe, a stop, a motion order?"""
        raise NotImplementedError

    def _collect(self) -> None:
        """Take note of what was sent, and judge it."""
        sent, self.engine.wire.sent = self.engine.wire.sent, []
        for at, frame in sent:
            nodes, probe, stop, motion = self.parse(frame)
            assert not (motion and self.engine.bus.latched), "a motion order left while the stop was latched"
            for node in nodes:
                self._judge(at, node, probe, stop, len(nodes) > 1)
            self.sent.append(Sent(at, frame, nodes, probe))
            self._owe(len(self.sent) - 1, stop)

    def _owe(self, number: int, stop: bool) -> None:
        """The replies to this frame are on their way, or have come: a reply to a stop proves nothing older."""
        _, frame, nodes, _ = self.sent[number]
        for node in nodes:
            if number not in self.answered:
                self.owes[node] = number
            elif not stop:
                self.owes.pop(node, None)
        if number not in self.answered:
            for node, reply in zip(nodes, self.servos(frame), strict=True):
                self.lines.setdefault(self.lane_of(node), deque()).append((number, reply))

    def _judge(self, at: float, node: int, probe: bool, stop: bool, grouped: bool) -> None:
        lane = self.lane_of(node)
        others = (number for number in reversed(range(len(self.sent))) if lane in self._lanes(number))
        before = next(others, None)
        if before is not None and before >= self.cut_off and before not in self.answered:
            sent_at = self.sent[before].at
            silent = self.touched.get(lane, -1.0) < sent_at
            assert not silent or at - sent_at >= SOONEST, "two requests are in flight on one lane"
        if node not in self.owes or stop or grouped:
            return
        owed = self.sent[self.owes[node]]
        assert probe, "a node that owes a reply got a request that is no probe"
        self.seen["probe"] += 1
        if not owed.is_probe:
            assert at - owed.at >= self.engine.quiet_time - 1e-9, "the bus was not quiet before the probe"

    def _lanes(self, number: int) -> set[int]:
        return {self.lane_of(node) for node in self.sent[number].nodes}

    def _deliver(self, lane: int, *data: Any, after: float = 0.0003) -> None:
        self.engine.deliver(*data, after=after)
        self.touched[lane] = self.engine.now

    def _taken(self, lane: int, whole: bool = True) -> Any:
        number, reply = self.lines[lane].popleft()
        event(f"{self.family}: {'reply' if whole else 'no reply'}")
        if whole:
            for node in self.sent[number].nodes:
                is_its = len(self.sent[number].nodes) == 1 or reply[2] == node
                if is_its and self.owes.get(node) == number:
                    self.owes.pop(node)
        late = self.engine.now - self.sent[number].at > 0.06
        self.seen["late"] += late and whole
        return reply

    def _lane(self, data: st.DataObject) -> int:
        return int(data.draw(st.sampled_from(sorted(lane for lane, line in self.lines.items() if line))))

    def has_reply(self) -> bool:
        return any(self.lines.values())

    # -- rules -----------------------------------------------------------------------------------------------

    def submit(self, kind: str, work: Any, mark: Any) -> None:
        call = Call(self.engine, f"{kind} {len(self.calls)}", mark, kind)
        self.calls.append(call)
        self.engine.submit(call.name, work)
        self._collect()

    @rule(seconds=TIMES)
    def wait(self, seconds: float) -> None:
        self.engine.advance(seconds)

    @precondition(has_reply)
    @rule(data=st.data(), after=st.sampled_from([0.0002, 0.0003, 0.001]))
    def reply(self, data: st.DataObject, after: float) -> None:
        lane = self._lane(data)
        self._deliver(lane, self._taken(lane), after=after)

    @precondition(has_reply)
    @rule(data=st.data())
    def lose(self, data: st.DataObject) -> None:
        self._taken(self._lane(data), whole=False)
        self.seen["lost"] += 1

    @precondition(has_reply)
    @rule(data=st.data())
    def copy(self, data: st.DataObject) -> None:
        lane = self._lane(data)
        reply = self._taken(lane)
        self._deliver(lane, reply, reply)
        self.seen["copied"] += 1

    @precondition(lambda self: any(call.outcome is PENDING for call in self.calls))
    @rule(data=st.data())
    def cancel(self, data: st.DataObject) -> None:
        pending = [call for call in self.calls if call.outcome is PENDING]
        self.engine.cancel(data.draw(st.sampled_from(pending)).name)
        self.seen["cancelled"] += 1

    @rule(answered=st.booleans())
    def estop(self, answered: bool) -> None:
        if answered:
            self._answering(0.0)
            self._silent()
            self.engine.wire.answer = self._answer
        self.engine.bus.estop()
        stops = [frame for _, frame in self.engine.wire.sent]
        assert all(self.parse(frame)[2] for frame in stops), "something else was sent during the stop"
        self.seen["stops"] += bool(stops)
        self.cut_off = 1 << 30
        self._silent()
        self.cut_off = len(self.sent)
        self.engine.advance()

    @rule(seconds=st.sampled_from([0.01, 0.1, 0.5]))
    def answer_all(self, seconds: float) -> None:
        self._answering(seconds)
        self._silent()

    @rule()
    def reset(self) -> None:
        self.engine.bus.reset()

    @rule(seconds=TIMES)
    def lose_link(self, seconds: float) -> None:
        pending = [call for call in self.calls if call.outcome is PENDING]
        self.engine.unplug()
        for call in pending:
            assert isinstance(self.engine.result(call.name), MotorbusError | Cancelled), (
                "it outlived the link"
            )
        self.seen["cut off"] += len(pending)
        self.engine.plug()
        self.lines.clear()
        self._collect()
        self.cut_off = len(self.sent)
        self.engine.advance(seconds)

    # -- what must hold --------------------------------------------------------------------------------------

    @invariant()
    def no_call_has_the_value_of_another(self) -> None:
        self._collect()
        for call in self.calls:
            outcome = self.engine.result(call.name)
            if call.outcome is not PENDING:
                assert outcome is call.outcome or outcome == call.outcome, "a call ended twice"
                continue
            call.outcome = outcome
            if outcome is PENDING or isinstance(outcome, BaseException):
                self.seen["failed"] += isinstance(outcome, MotorbusError)
                self.seen["link lost"] += isinstance(outcome, LinkLost)
                self.seen["stopped"] += isinstance(outcome, Interrupted)
                continue
            own = [number for number, one in enumerate(self.sent) if self.mark_of(one.frame) == call.mark]
            assert own, "a call has a result and was never sent"
            for value in outcome.values() if isinstance(outcome, dict) else [outcome]:
                if call.kind != "write":
                    assert self.values[value] == own[-1], "the value answers another request"
                    self.seen["values"] += 1

    def mark_of(self, frame: Any) -> Any:
        raise NotImplementedError

    def teardown(self) -> None:
        self._answering(60.0)
        self.no_call_has_the_value_of_another()
        for call in self.calls:
            assert self.engine.result(call.name) is not PENDING, "a call never ended"


class SerialModel(Model):
    """One lane, replies that carry nothing but the id of their node."""

    family = "feetech"

    def lane_of(self, node: int) -> int:
        return 0

    def parse(self, frame: Any) -> tuple[tuple[int, ...], bool, bool, bool]:
        node, code, parameters = frame[2], frame[4], frame[5:-1]
        off = code == 3 and parameters[0] == TORQUE and not parameters[1]
        nodes = tuple(parameters[2:]) if code == 0x82 else () if node == BROADCAST else (node,)
        return nodes, code == 2 and parameters[0] == ID, off, code == 3 and parameters[0] == GOAL

    def mark_of(self, frame: Any) -> Any:
        return frame[4], frame[5] if frame[4] != 3 else frame[6]

    def _mark(self) -> int:
        return 60 + len(self.calls) % 190

    def _read(self, node: int, count: int, mark: int, priority: Priority) -> Any:
        return request(
            instruction(node, 2, bytes([mark, count])),
            [(node, node, 6 + count)],
            lambda replies: value_of(replies[0]),
            alternate=lambda: self._read(node, 5 - count, mark, priority),
            priority=priority,
            repeatable=True,
        )

    @rule(node=NODES, priority=PRIORITIES)
    def read(self, node: int, priority: Priority) -> None:
        mark = self._mark()
        self.submit("read", self._read(node, 2, mark, priority), (2, mark))

    @rule(nodes=st.lists(NODES, min_size=2, max_size=3, unique=True))
    def read_group(self, nodes: list[int]) -> None:
        mark = self._mark()
        expected = [(node, node, 8) for node in nodes]
        frame = instruction(BROADCAST, 0x82, bytes([mark, 2, *nodes]))
        work = request(frame, expected, lambda them: {one[2]: value_of(one) for one in them}, repeatable=True)
        self.submit("group", work, (0x82, mark))

    @rule(node=NODES, priority=PRIORITIES, motion=st.booleans())
    def write(self, node: int, priority: Priority, motion: bool) -> None:
        mark = self._mark()
        work = move(node, mark) if motion else write(node, mark, priority=priority, repeatable=True)
        self.submit("write", work, (3, mark))

    @precondition(Model.has_reply)
    @rule(data=st.data(), at=st.integers(0, 12), flip=st.integers(1, 255))
    def damage(self, data: st.DataObject, at: int, flip: int) -> None:
        reply = bytearray(self._taken(0, whole=False))
        reply[2 + at % (len(reply) - 2)] ^= flip
        self._deliver(0, bytes(reply))
        self.seen["damaged"] += 1

    @precondition(Model.has_reply)
    @rule(cut=st.integers(1, 12), seconds=TIMES, lost=st.booleans())
    def cut(self, cut: int, seconds: float, lost: bool) -> None:
        reply = self._taken(0, whole=not lost)
        cut %= len(reply)
        self._deliver(0, reply[:cut])
        self.engine.advance(seconds if lost else min(seconds, 0.002))
        if not lost:
            self._deliver(0, reply[cut:])
        self.seen["cut"] += 1

    @rule(noise=NOISE)
    def noise(self, noise: bytes) -> None:
        self._deliver(0, noise)
        self.seen["noise"] += 1

    @rule(
        frame=st.sampled_from(
            [said(9, 1), said(1, 0x77, 9), status(2, bytes(9)), checksummed(b"\x00\x02\x00")]
        )
    )
    def foreign(self, frame: bytes) -> None:
        self._deliver(0, frame)
        self.seen["foreign"] += 1


class CanModel(Model):
    """A lane for each node; replies name their node and their object."""

    family = "kst"

    def lane_of(self, node: int) -> int:
        return node

    def parse(self, frame: Any) -> tuple[tuple[int, ...], bool, bool, bool]:
        index, value = frame.data[1] | frame.data[2] << 8, frame.data[4:]
        ours = any(value)
        moved = index == CAN_GOAL and value[:2] == MOVED.to_bytes(2, "little")
        stop = (index == CAN_GOAL and not moved) or (index == CAN_POSITION and not ours)
        return (frame.id - 0x600,), index not in (CAN_GOAL, CAN_POSITION), stop, moved

    def mark_of(self, frame: Any) -> Any:
        return frame.data[0], frame.data[4:]

    @rule(node=NODES, priority=PRIORITIES)
    def read(self, node: int, priority: Priority) -> None:
        mark = (len(self.calls) + 1).to_bytes(4, "big")
        frame = upload_frame(node)
        frame = frame._replace(data=frame.data[:4] + mark)
        expected = [(node, ("upload", CAN_POSITION), 8)]
        work = request(frame, expected, can_value, lane=node, priority=priority, repeatable=True)
        self.submit("read", work, (0x40, mark))

    @rule(node=NODES)
    def move(self, node: int) -> None:
        self.submit("write", can_move(node, MOVED), (0x22, MOVED.to_bytes(2, "little") + b"\0\0"))

    @rule(
        node=st.integers(1, 9),
        index=st.sampled_from([0x6063, 0x2000]),
        data=st.binary(min_size=4, max_size=4),
    )
    def foreign(self, node: int, index: int, data: bytes) -> None:
        self._deliver(node, uploaded(node, 1, index), CanFrame(0x580 + node, data))
        self.seen["foreign"] += 1


BOTH = (
    "values",
    "probe",
    "late",
    "lost",
    "copied",
    "cancelled",
    "stops",
    "foreign",
    "failed",
    "stopped",
    "cut off",
)


@pytest.mark.parametrize(
    ("model", "wanted"), [(SerialModel, (*BOTH, "damaged", "cut", "noise")), (CanModel, BOTH)]
)
def test_no_value_is_another_requests_and_every_call_ends_once(
    model: type[Model], wanted: tuple[str, ...], rounds: Rounds
) -> None:
    Model.seen.clear()
    count = rounds(2_000, 50)
    phases = [Phase.generate]  # shrinking a failure takes minutes: add Phase.shrink when there is one
    run_state_machine_as_test(
        model, settings=settings(max_examples=count, stateful_step_count=50, phases=phases)
    )
    assert {what: Model.seen[what] for what in wanted if not Model.seen[what]} == {}
