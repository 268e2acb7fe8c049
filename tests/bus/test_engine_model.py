"""Any requests in any order over a line that loses, delays, damages, cuts and copies, judged by frames and results.

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

from motorbus.core.can_frame import CanFrame
from motorbus.errors import Interrupted, LinkLost, MotorbusError
from tests.bus.adapter import PENDING, Cancelled, Effect, Engine, Priority, exclusive, request
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
SURPLUS = b"\x11\x22\x33"
NOISE = st.sampled_from([SURPLUS, b"\x00", b"\xff", b"\xff\xff\x01\x04\x00", b"\xff\xff\x02\x02\x00\x00"])
FOREIGN = st.sampled_from([said(9, 1), said(1, 0x77, 9), status(2, bytes(9)), checksummed(b"\x00\x02\x00")])
SOONEST = 0.0015  # s; no time-out of any request is shorter
LATE = 0.06  # s; every time-out is shorter
MOVED = 9999  # the goal of every motion order on CAN


class Sent(NamedTuple):
    """A frame of the host: the nodes that must reply, and what it is."""

    at: float
    frame: Any
    nodes: tuple[int, ...]
    probe: bool
    stop: bool
    motion: bool


class Call:
    """A submitted call; `mark` tells its frames from those of all other calls."""

    def __init__(self, name: str, kind: str, node: int, mark: Any) -> None:
        self.name, self.kind, self.node, self.mark = name, kind, node, mark
        self.outcome: Any = PENDING

    @property
    def pending(self) -> bool:
        return self.outcome is PENDING


class Model(RuleBasedStateMachine):
    """What both kinds of bus have in common."""

    family: ClassVar[str]
    seen: ClassVar[Counter[str]] = Counter()

    def __init__(self) -> None:
        super().__init__()
        self.engine = Engine(self.family, answer=Servos())
        self.servos = Servos(self._value)
        self.calls: list[Call] = []
        self.count = 0
        self.sent: list[Sent] = []
        self.values: dict[int, int] = {}  # value -> number of the frame that it answers
        self.lines: dict[int, deque[tuple[int, Any]]] = {}  # lane -> (number of its frame, reply), in order
        self.answered: set[int] = set()  # numbers of the frames whose whole reply has come
        self.owes: dict[int, int] = {}  # node -> number of the frame whose reply has not come
        self.touched: dict[int, float] = {}  # lane -> when something was delivered last
        self.cut_off = 0  # a stop or a loss has cut short the frames before this number

    # -- the far end -----------------------------------------------------------------------------------------

    def lane_of(self, node: int) -> int:
        raise NotImplementedError

    def parse(self, at: float, frame: Any) -> Sent:
        raise NotImplementedError

    def mark_of(self, frame: Any) -> Any:
        raise NotImplementedError

    def _value(self, node: int) -> int:
        self.count += 1
        value = (self.count // 200) << 8 | self.count % 200 + 1
        self.values[value] = len(self.sent) + len(self.engine.wire.sent) - 1
        return value

    def _answer(self, frame: Any) -> Any:
        self.answered.add(len(self.sent) + len(self.engine.wire.sent) - 1)
        return self.servos(frame)

    def _begin_answering(self) -> None:
        """From now on every frame is answered at once; what was on its way before is lost."""
        for line in self.lines.values():
            line.clear()
        self.engine.wire.answer = self._answer

    def _end_answering(self) -> None:
        self._collect()
        self.engine.wire.answer = lambda frame: []

    def _collect(self) -> None:
        """Take note of what was sent, and judge it."""
        sent, self.engine.wire.sent = self.engine.wire.sent, []
        for at, frame in sent:
            one = self.parse(at, frame)
            assert not (one.motion and self.engine.bus.latched), (
                "a motion order left while a stop was latched"
            )
            for node in one.nodes:
                self._judge(one, node)
            self.sent.append(one)
            self._owe(len(self.sent) - 1)

    def _judge(self, one: Sent, node: int) -> None:
        lane = self.lane_of(node)
        lanes = ({self.lane_of(other) for other in before.nodes} for before in reversed(self.sent))
        last = next((len(self.sent) - 1 - back for back, used in enumerate(lanes) if lane in used), -1)
        if last >= self.cut_off and last not in self.answered:
            sent_at = self.sent[last].at
            silent = self.touched.get(lane, -1.0) < sent_at
            assert not silent or one.at - sent_at >= SOONEST, "two requests are in flight on one lane"
        if node not in self.owes or one.stop or len(one.nodes) > 1:
            return
        owed = self.sent[self.owes[node]]
        assert one.probe, "a node that owes a reply got a request that is no probe"
        self.seen["probe"] += 1
        if not owed.probe:
            assert one.at - owed.at >= self.engine.quiet_time - 1e-9, "the bus was not quiet before the probe"

    def _owe(self, number: int) -> None:
        one = self.sent[number]
        for node in one.nodes:
            if one.stop:  # sent without a probe, and its reply proves nothing of what is older
                continue
            if number in self.answered:
                self.owes.pop(node, None)
            else:
                self.owes[node] = number
        if number not in self.answered:
            for node, reply in zip(one.nodes, self.servos(one.frame), strict=True):
                self.lines.setdefault(self.lane_of(node), deque()).append((number, reply))

    def _pay(self, number: int, reply: Any) -> None:
        """The whole reply is delivered."""
        one = self.sent[number]
        self.answered.add(number)
        self.seen["late"] += self.engine.now - one.at > LATE
        for node in one.nodes:
            if (len(one.nodes) == 1 or reply[2] == node) and self.owes.get(node) == number:
                self.owes.pop(node)

    def _take(self, lane: int, *, whole: bool = True) -> Any:
        number, reply = self.lines[lane].popleft()
        event(f"{self.family}: {'reply' if whole else 'no reply'}")
        if whole:
            self._pay(number, reply)
        return reply

    def _deliver(self, lane: int, *data: Any, after: float = 0.0003) -> None:
        self.engine.deliver(*data, after=after)
        self.touched[lane] = self.engine.now

    def _lane(self, data: st.DataObject) -> int:
        return int(data.draw(st.sampled_from(sorted(lane for lane, line in self.lines.items() if line))))

    def _pending(self, *kinds: str) -> list[Call]:
        return [call for call in self.calls if call.pending and (not kinds or call.kind in kinds)]

    def has_reply(self) -> bool:
        return any(self.lines.values())

    def submit(self, kind: str, node: int, work: Any, mark: Any) -> None:
        call = Call(f"{kind} {len(self.calls)}", kind, node, mark)
        self.calls.append(call)
        self.engine.submit(call.name, work)
        self._collect()

    # -- rules -----------------------------------------------------------------------------------------------

    @rule(seconds=TIMES)
    def wait(self, seconds: float) -> None:
        self.engine.advance(seconds)

    @precondition(has_reply)
    @rule(data=st.data(), after=st.sampled_from([0.0002, 0.0003, 0.001]))
    def reply(self, data: st.DataObject, after: float) -> None:
        lane = self._lane(data)
        self._deliver(lane, self._take(lane), after=after)

    @precondition(has_reply)
    @rule(data=st.data())
    def lose(self, data: st.DataObject) -> None:
        self._take(self._lane(data), whole=False)
        self.seen["lost"] += 1

    @precondition(has_reply)
    @rule(data=st.data())
    def copy(self, data: st.DataObject) -> None:
        lane = self._lane(data)
        reply = self._take(lane)
        self._deliver(lane, reply, reply)
        self.seen["copied"] += 1

    @rule(seconds=st.sampled_from([0.01, 0.1, 0.5]))
    def answer_all(self, seconds: float) -> None:
        self._begin_answering()
        self.engine.advance(seconds)
        self._end_answering()

    @precondition(lambda self: self._pending())
    @rule(data=st.data())
    def cancel(self, data: st.DataObject) -> None:
        self.engine.cancel(data.draw(st.sampled_from(self._pending())).name)
        self.seen["cancelled"] += 1

    @rule(answered=st.booleans())
    def estop(self, answered: bool) -> None:
        if answered:
            self._begin_answering()
        self.engine.bus.estop()
        assert all(self.parse(0.0, frame).stop for _, frame in self.engine.wire.sent), (
            "more than the stop was sent"
        )
        self.seen["stops"] += len(self.engine.wire.sent)
        self.cut_off = 1 << 30
        self._end_answering()
        self.cut_off = len(self.sent)
        self.engine.advance()

    @rule()
    def reset(self) -> None:
        self.engine.bus.reset()

    @rule(seconds=TIMES)
    def lose_link(self, seconds: float) -> None:
        pending = self._pending()
        self.engine.unplug()
        for call in pending:
            assert isinstance(self.engine.result(call.name), MotorbusError | Cancelled), (
                "it outlived the link"
            )
        self.engine.plug()
        for line in self.lines.values():
            line.clear()
        self._collect()
        self.cut_off = len(self.sent)
        self.engine.advance(seconds)

    # -- what must hold --------------------------------------------------------------------------------------

    @invariant()
    def every_call_ends_once_with_what_is_its_own(self) -> None:
        self._collect()
        for call in self.calls:
            outcome = self.engine.result(call.name)
            if not call.pending:
                assert outcome is call.outcome or outcome == call.outcome, "a call ended twice"
                continue
            call.outcome = outcome
            if isinstance(outcome, BaseException):
                self.seen["failed"] += not isinstance(outcome, Cancelled)
                self.seen["stopped"] += isinstance(outcome, Interrupted)
                self.seen["link lost"] += isinstance(outcome, LinkLost)
            elif outcome is not PENDING:
                self._judge_result(call, outcome)

    def _frames_of(self, call: Call) -> list[int]:
        return [number for number, one in enumerate(self.sent) if self.mark_of(one.frame) == call.mark]

    def _judge_result(self, call: Call, outcome: Any) -> None:
        self.seen["results"] += 1
        if outcome == {}:  # a group whose nodes are all silent lately is not sent
            return
        own = self._frames_of(call)
        assert own, "a call has a result and was never sent"
        if call.kind == "stop":
            stops = {number for number, one in enumerate(self.sent) if one.stop and call.node in one.nodes}
            assert stops & self.answered, "the reply to something else acknowledged a stop"
            return
        assert own[-1] in self.answered, "it has a result and no reply"
        values = (
            outcome if isinstance(outcome, list) else [*outcome.values()] if isinstance(outcome, dict) else []
        )
        if call.kind == "read":
            values = [outcome]
        if call.kind == "exclusive":
            between = (number for number in range(own[0], own[-1]) if number not in own)
            assert all(self.sent[number].probe or self.sent[number].stop for number in between), "not alone"
            assert self.values[values[0]] in own[:-1], "the value answers another request"
        for value in values[-1:] if call.kind == "exclusive" else values:
            assert self.values[value] == own[-1], "the value answers another request"

    def teardown(self) -> None:
        self._begin_answering()
        self.engine.advance(60.0)
        self.every_call_ends_once_with_what_is_its_own()
        assert not self._pending(), "a call never ended"
        for place, stop in enumerate(self.calls):
            sent = self._frames_of(stop) if stop.kind == "stop" else []
            for order in self.calls[:place] if sent else []:
                if order.kind == "motion" and order.node == stop.node:
                    self.seen["ordered before a stop"] += 1
                    assert all(number < sent[0] for number in self._frames_of(order)), "sent behind the stop"


class SerialModel(Model):
    """One lane, replies that carry nothing but the id of their node."""

    family = "feetech"

    def lane_of(self, node: int) -> int:
        return 0

    def parse(self, at: float, frame: Any) -> Sent:
        node, code, parameters = frame[2], frame[4], frame[5:-1]
        nodes = tuple(parameters[2:]) if code == 0x82 else () if node == BROADCAST else (node,)
        stop = code == 3 and parameters[0] == TORQUE and not parameters[1]
        probe = code == 2 and parameters[0] == ID
        return Sent(at, frame, nodes, probe, stop, code == 3 and parameters[0] == GOAL)

    def mark_of(self, frame: Any) -> Any:
        return (3, frame[-2]) if frame[4] == 3 else (frame[4], frame[5])

    def _mark(self) -> int:
        return 60 + len(self.calls) % 190

    def _read(self, node: int, count: int, mark: int, priority: Priority = Priority.POLL) -> Any:
        return request(
            instruction(node, 2, bytes([mark, count])),
            [(node, node, 6 + count)],
            lambda replies: value_of(replies[0]),
            priority=priority,
            repeatable=True,
        )

    @rule(node=NODES, priority=PRIORITIES)
    def read(self, node: int, priority: Priority) -> None:
        mark = self._mark()
        self.submit("read", node, self._read(node, 2, mark, priority), (2, mark))

    @precondition(lambda self: not self._pending("exclusive"))
    @rule(node=NODES, surplus=st.booleans())
    def read_blocking(self, node: int, surplus: bool) -> None:
        """By a caller of its own, while the others wait; then bytes come that no request called for."""
        mark = 250 + len(self.sent) % 6
        self._collect()
        self._begin_answering()
        try:
            value = self.engine.run(self._read(node, 2, mark))
        except MotorbusError:
            self.seen["blocking failed"] += 1
        else:
            self._collect()
            self._judge_result(Call("", "read", node, (2, mark)), value)
            if surplus and not self._pending():
                self._deliver(0, SURPLUS)
                self.owes[node] = len(self.sent) - 1
                self.seen["surplus"] += 1
        self._end_answering()

    @rule(node=NODES, other=NODES)
    def read_exclusively(self, node: int, other: int) -> None:
        mark = self._mark()
        self.submit(
            "exclusive", node, exclusive(self._read(node, 2, mark), self._read(other, 2, mark)), (2, mark)
        )

    @rule(nodes=st.lists(NODES, min_size=2, max_size=3, unique=True))
    def read_group(self, nodes: list[int]) -> None:
        mark = self._mark()
        work = request(
            instruction(BROADCAST, 0x82, bytes([mark, 2, *nodes])),
            [(node, node, 8) for node in nodes],
            lambda replies: {one[2]: value_of(one) for one in replies},
            repeatable=True,
        )
        self.submit("group", nodes[0], work, (0x82, mark))

    @rule(node=NODES, priority=PRIORITIES, motion=st.booleans(), repeatable=st.booleans())
    def write(self, node: int, priority: Priority, motion: bool, repeatable: bool) -> None:
        mark = self._mark()
        work = (move if motion else write)(node, mark, priority=priority, repeatable=repeatable)
        self.submit("motion" if motion else "write", node, work, (3, mark))

    @rule(node=NODES)
    def stop_one(self, node: int) -> None:
        mark = self._mark()
        frame = instruction(node, 3, bytes([TORQUE, 0, mark]))
        options: Any = {"effect": Effect.TORQUE, "priority": Priority.STOP}
        self.submit("stop", node, request(frame, [(node, node, 6)], lambda _: None, **options), (3, mark))

    @precondition(Model.has_reply)
    @rule(at=st.integers(0, 12), flip=st.integers(1, 255))
    def damage(self, at: int, flip: int) -> None:
        reply = bytearray(self._take(0, whole=False))
        reply[2 + at % (len(reply) - 2)] ^= flip
        self._deliver(0, bytes(reply))
        self.seen["damaged"] += 1

    @precondition(Model.has_reply)
    @rule(cut=st.integers(1, 12), seconds=TIMES, lost=st.booleans())
    def cut(self, cut: int, seconds: float, lost: bool) -> None:
        reply = self._take(0, whole=not lost)
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

    @rule(frame=FOREIGN)
    def foreign(self, frame: bytes) -> None:
        self._deliver(0, frame)
        self.seen["foreign"] += 1


class CanModel(Model):
    """A lane for each node; replies name their node and their object."""

    family = "kst"

    def lane_of(self, node: int) -> int:
        return node

    def parse(self, at: float, frame: Any) -> Sent:
        index, value = frame.data[1] | frame.data[2] << 8, frame.data[4:]
        motion = index == CAN_GOAL and value[:2] == MOVED.to_bytes(2, "little")
        stop = (index == CAN_GOAL and not motion) or (index == CAN_POSITION and not any(value))
        return Sent(at, frame, (frame.id - 0x600,), index not in (CAN_GOAL, CAN_POSITION), stop, motion)

    def mark_of(self, frame: Any) -> Any:
        return frame.data[0], frame.data[4:]

    @rule(node=NODES, priority=PRIORITIES)
    def read(self, node: int, priority: Priority) -> None:
        mark = (len(self.calls) + 1).to_bytes(4, "big")
        frame = upload_frame(node)
        frame = frame._replace(data=frame.data[:4] + mark)
        expected = [(node, ("upload", CAN_POSITION), 8)]
        work = request(frame, expected, can_value, lane=node, priority=priority, repeatable=True)
        self.submit("read", node, work, (0x40, mark))

    @rule(node=NODES)
    def move(self, node: int) -> None:
        tail = len(self.calls).to_bytes(2, "little")
        mark = (0x22, MOVED.to_bytes(2, "little") + tail)
        self.submit("motion", node, can_move(node, MOVED, tail=tail), mark)

    @rule(
        node=st.integers(1, 9),
        index=st.sampled_from([0x6063, 0x2000]),
        data=st.binary(min_size=4, max_size=4),
    )
    def foreign(self, node: int, index: int, data: bytes) -> None:
        self._deliver(node, uploaded(node, 1, index), CanFrame(0x580 + node, data))
        self.seen["foreign"] += 1


BOTH = "results probe late lost copied cancelled stops foreign failed stopped"
SERIAL = f"{BOTH} damaged cut noise surplus"


@pytest.mark.parametrize(("model", "faults"), [(SerialModel, SERIAL), (CanModel, BOTH)])
def test_no_value_is_another_requests_and_every_call_ends_once(
    model: type[Model], faults: str, rounds: Rounds
) -> None:
    Model.seen.clear()
    phases = [Phase.generate]  # shrinking a failure takes minutes: add Phase.shrink when there is one
    count = rounds(2_000, 80)
    run_state_machine_as_test(
        model, settings=settings(max_examples=count, stateful_step_count=50, phases=phases)
    )
    assert [fault for fault in faults.split() if not Model.seen[fault]] == [], "these faults never happened"
