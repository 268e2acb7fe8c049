"""The engine in events: requests submitted, bytes that arrive, time that passes -> frames and results."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.errors import (
    ChecksumError,
    FramingError,
    Interrupted,
    LimitExceeded,
    LinkLost,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    RequestError,
    UnexpectedReply,
)
from tests.bus.adapter import (
    PENDING,
    Cancelled,
    Effect,
    Engine,
    Priority,
    TimeoutClass,
    exclusive,
    notification,
    request,
)
from tests.bus.frames import (
    BROADCAST,
    GOAL,
    TORQUE,
    Servos,
    can_move,
    can_read,
    checksummed,
    download_frame,
    downloaded,
    group,
    group_frame,
    instruction,
    move,
    read,
    read_frame,
    said,
    status,
    torque,
    torque_off,
    torque_off_everywhere,
    uploaded,
    write,
    write_frame,
)


@pytest.fixture
def engine() -> Engine:
    """A half-duplex serial bus at 1 Mbit/s without echo."""
    return Engine(answer=Servos())


@pytest.fixture
def can() -> Engine:
    """A CAN bus at 500 kbit/s: one lane for each node."""
    return Engine("kst")


def next_frame(engine: Engine) -> Any:
    (frame,) = engine.sent()
    return frame


def resync(engine: Engine, request_frame: bytes) -> bytes:
    """Let the quiet time pass and answer the probe, which must come before the request."""
    assert engine.sent() == []
    engine.advance(engine.quiet_time)
    probe = next_frame(engine)
    assert probe != request_frame
    engine.deliver(*Servos()(probe))
    return bytes(probe)


def replies(engine: Engine) -> int:
    """Length of the reply that the last frame calls for."""
    return len(Servos()(next_frame(engine))[0])


def nodes(frames: list[Any]) -> list[int]:
    return [frame.id & 0x7F if isinstance(frame, CanFrame) else frame[2] for frame in frames]


def test_a_request_is_sent_once_and_its_reply_is_the_result(engine: Engine) -> None:
    engine.submit("a", read(1))
    assert engine.sent() == [read_frame(1)]
    engine.deliver(said(1, 1234))
    assert engine.result("a") == 1234
    assert engine.sent() == []


@pytest.mark.parametrize("sizes", [(1,) * 8, (3, 5), (7, 1), (2, 6), (8,)])
def test_a_reply_in_pieces_is_put_together(engine: Engine, sizes: tuple[int, ...]) -> None:
    engine.submit("a", read(1))
    rest = said(1, 1234)
    for size in sizes:
        engine.deliver(rest[:size])
        rest = rest[size:]
    engine.advance(0.0001)
    assert engine.result("a") == 1234


@pytest.mark.parametrize("noise", [b"\x00", b"\xff", b"\x12\xff\xff\x34", b"\xff\xff\x01"])
def test_noise_before_a_reply_does_no_harm(engine: Engine, noise: bytes) -> None:
    """Noise that looks like the head of a frame delays the reply to the deadline."""
    engine.submit("a", read(1))
    engine.deliver(noise + said(1, 1234))
    engine.advance(0.03)
    assert engine.result("a") == 1234
    assert engine.sent() == [read_frame(1)]


@pytest.mark.parametrize(
    ("work", "seconds"),
    [(read(1), 0.021668), (read(1, 3), 0.021678), (group(1, 2), 0.022276), (write(1), 0.021648)],
)
@pytest.mark.parametrize("latency", [0.0, 0.016])
def test_a_deadline_is_air_time_plus_thinking_time_plus_latency(
    work: Any, seconds: float, latency: float
) -> None:
    """Air time of both frames, 1 ms and 0.508 ms for each reply, 20 ms for the host."""
    engine = Engine(latency=latency, answer=Servos())
    engine.submit("a", work)
    assert engine.deadline == pytest.approx(seconds + latency, abs=1e-6)
    engine.advance(0.001)
    engine.deliver(b"\x00", after=0.001)
    assert engine.deadline == pytest.approx(seconds + latency - 0.002, abs=1e-6), "no byte extends it"


@pytest.mark.parametrize("repeatable", [True, False])
@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (said(1, 7)[:-1] + b"\x00", ChecksumError),
        (said(1, 7)[:-1], FramingError),
        (said(1, 7) + b"\x11", UnexpectedReply),
        (said(1, 7, 5), UnexpectedReply),
        (said(1, 7) * 2, UnexpectedReply),
    ],
)
def test_a_bad_reply_is_asked_for_three_times_if_it_may_be_repeated(
    engine: Engine, answer: bytes, error: type[MotorbusError], repeatable: bool
) -> None:
    servos = Servos()
    engine.wire.answer = lambda frame: [answer] if frame == read_frame(1) else servos(frame)
    engine.submit("a", read(1, repeatable=repeatable))
    engine.advance(1.0)
    assert isinstance(engine.result("a"), error if repeatable else OutcomeUnknown)
    assert engine.sent().count(read_frame(1)) == (3 if repeatable else 1)
    assert engine.counts(1).retries == (2 if repeatable else 0)


def test_a_lost_reply_is_asked_for_again(engine: Engine) -> None:
    engine.submit("a", read(1))
    engine.sent()
    engine.advance(0.03)
    resync(engine, read_frame(1))
    assert engine.sent() == [read_frame(1)]
    engine.deliver(said(1, 7))
    assert engine.result("a") == 7


def test_a_silent_node_is_reported_and_a_lost_write_has_an_unknown_outcome(engine: Engine) -> None:
    engine.submit("a", read(1))
    engine.submit("b", write(2))
    engine.advance(1.0)
    assert isinstance(engine.result("a"), NoReply)
    assert isinstance(engine.result("b"), OutcomeUnknown)
    assert engine.sent().count(write_frame(2, 20, 1)) == 1
    engine.submit("c", write(1))
    engine.advance(1.0)
    assert isinstance(engine.result("c"), NoReply), "its node answered no probe, so it was never sent"
    assert write_frame(1, 20, 1) not in engine.sent()


def test_a_request_without_reply_ends_when_it_is_sent(engine: Engine) -> None:
    engine.submit("a", request(instruction(BROADCAST, 5), [], lambda replies: replies))
    assert engine.sent() == [instruction(BROADCAST, 5)]
    assert engine.result("a") == []


def test_what_a_decoder_raises_ends_its_own_call_only(engine: Engine) -> None:
    def refuse(_: list[bytes]) -> Any:
        raise RequestError("out of range")

    engine.submit("a", request(read_frame(1), [(1, 1, 8)], refuse, repeatable=True))
    engine.deliver(said(1, 7))
    engine.submit("b", read(1))
    engine.deliver(said(1, 8))
    assert isinstance(engine.result("a"), RequestError)
    assert engine.result("b") == 8


# -- late, foreign and surplus -------------------------------------------------------------------------------


def test_a_late_reply_is_ignored_and_its_node_is_asked_only_behind_a_probe(engine: Engine) -> None:
    engine.submit("a", read(1, repeatable=False))
    engine.sent()
    engine.advance(0.03)
    assert isinstance(engine.result("a"), OutcomeUnknown)
    engine.submit("b", read(1))
    engine.deliver(said(1, 1111))
    assert engine.result("b") is PENDING
    assert engine.bus.statistics.other["late"] == 1
    resync(engine, read_frame(1))
    assert engine.sent() == [read_frame(1)]
    engine.deliver(said(1, 2222))
    assert engine.result("b") == 2222


def test_a_node_is_probed_with_a_reply_length_that_nothing_owed_has(engine: Engine) -> None:
    lengths = [8]
    for number in range(8):
        engine.submit(str(number), read(1))
        engine.advance(0.3)
        frames = [frame for frame in engine.sent() if frame != read_frame(1)]
        lengths += [len(Servos()(frame)[0]) for frame in frames]
    assert len(lengths) == 9
    assert len(set(lengths)) == 9


def test_a_late_reply_does_not_answer_the_probe(engine: Engine) -> None:
    engine.submit("a", read(1))
    engine.advance(0.03 + engine.quiet_time)
    asked, probe = engine.sent()
    engine.deliver(said(1, 1111))
    assert engine.sent() == []
    engine.deliver(*Servos()(probe))
    assert engine.sent() == [asked]
    engine.deliver(said(1, 2222))
    assert engine.result("a") == 2222


def test_a_node_that_owes_a_reply_is_not_trusted_after_another_reply(engine: Engine) -> None:
    """A stop is sent without a probe; its acknowledgement does not prove that nothing older follows."""
    engine.submit("a", read(1, repeatable=False))
    engine.advance(0.03)
    engine.submit("stop", torque_off(1))
    assert write_frame(1, TORQUE, 0) in engine.sent()
    engine.deliver(status(1))
    assert engine.result("stop") == "written"
    engine.submit("b", read(1))
    engine.advance(engine.quiet_time)
    probe = next_frame(engine)
    assert probe != read_frame(1)
    engine.deliver(said(1, 1111), *Servos()(probe))
    assert engine.result("b") is PENDING
    engine.deliver(said(1, 2222))
    assert engine.result("b") == 2222


def test_a_group_reply_does_not_prove_a_node_that_owes_one(engine: Engine) -> None:
    """A scan is sent without a probe, too."""
    engine.submit("a", read(1, repeatable=False))
    engine.advance(0.03)
    engine.submit("b", read(1, 3, reply_within=TimeoutClass.SCAN))
    engine.deliver(said(1, 7, 3))
    assert engine.result("b") == 7
    engine.sent()
    engine.submit("c", read(1))
    engine.advance(engine.quiet_time)
    assert next_frame(engine) != read_frame(1), "the first reply may still come"


@pytest.mark.parametrize("surplus", [b"\x11", b"\x11\x22\x33", checksummed(b"\x07\x02\x00")])
def test_surplus_bytes_put_the_node_asked_last_out_of_sync(engine: Engine, surplus: bytes) -> None:
    engine.submit("a", read(1))
    engine.deliver(said(1, 7))
    engine.deliver(surplus)
    engine.sent()
    engine.submit("b", read(1))
    resync(engine, read_frame(1))
    assert engine.sent() == [read_frame(1)]
    engine.deliver(said(1, 8))
    assert engine.result("b") == 8


def test_a_blocking_read_meets_surplus_bytes_that_came_before_it(engine: Engine) -> None:
    engine.wire.answer = servos = Servos()
    assert engine.run(read(1)) == 100
    servos.position = lambda node: 777
    engine.sent()
    engine.wire.coming.append((engine.now, said(1, 1111)))
    engine.link.advance(0.0)
    assert engine.run(read(1)) == 777
    assert engine.sent()[-1] == read_frame(1)
    assert engine.bus.statistics.other["late"] + engine.bus.statistics.other["foreign"] == 1


def test_a_blocking_read_of_a_node_out_of_sync_begins_with_a_probe(engine: Engine) -> None:
    with pytest.raises(NoReply):
        engine.run(read(1))
    engine.sent()
    engine.wire.answer = Servos()
    assert engine.run(write(1)) == "written"
    first, second = engine.sent()
    assert first != write_frame(1, 20, 1)
    assert second == write_frame(1, 20, 1)


@pytest.mark.parametrize(
    "foreign",
    [said(2, 1111), status(1), said(1, 1111, 3), status(0), instruction(1, 2, b"\x38\x02")],
    ids=["other node", "too short", "too long", "node 0", "another host"],
)
def test_a_foreign_reply_is_no_answer(engine: Engine, foreign: bytes) -> None:
    servos = Servos(lambda node: 2222)
    engine.submit("a", read(1))
    engine.deliver(foreign)
    assert engine.result("a") is PENDING
    engine.wire.answer = servos
    engine.deliver(said(1, 2222))
    engine.advance(0.5)
    assert engine.result("a") == 2222


@pytest.mark.parametrize("way", ["direct", "as a task"])
@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_a_copied_reply_passes_for_at_most_128_next_ones(family: str, way: str) -> None:
    """No byte of a reply tells it from the last one, so after every 128th equal reply its node is probed."""
    engine = Engine(family, answer=Servos())
    count = 0

    def position(node: int) -> int:
        nonlocal count
        count += 1
        return count

    servos = Servos(position)

    def answer(frame: Any) -> list[Any]:
        replies = servos(frame)
        if count == 5:
            engine.wire.coming += [(engine.now + engine.wire.delay + 0.001, one) for one in replies]
        return replies

    engine.wire.delay = 0.005
    engine.wire.answer = answer
    reading = read(1) if family == "feetech" else can_read(1)

    async def task() -> Any:
        return await reading

    late = []
    for _ in range(300):
        value = engine.run(reading if way == "direct" else task())
        late.append(count - value)
    assert set(late) == {0, 1}
    assert 0 < sum(late) <= 128
    assert late[150:] == [0] * 150


# -- echo ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("echo", [True, False])
def test_an_echo_is_found_when_the_bus_is_opened_and_taken_off(echo: bool) -> None:
    engine = Engine(answer=Servos(), echo=echo)
    assert engine.bus.echoes is echo
    for number, value in enumerate((1111, 2222)):
        engine.submit(str(number), read(1))
        engine.deliver(said(1, value))
        assert engine.result(str(number)) == value
    assert engine.sent() == [read_frame(1)] * 2


@pytest.mark.parametrize("cut", [1, 4, 7, 8, 9, 15])
def test_an_echo_is_taken_off_wherever_it_is_cut(cut: int) -> None:
    engine = Engine(answer=Servos(), echo=True)
    engine.wire.echoes = False
    engine.submit("a", read(1))
    stream = read_frame(1) + said(1, 1234)
    engine.deliver(stream[:cut])
    engine.deliver(stream[cut:])
    engine.advance(0.0001)
    assert engine.result("a") == 1234


@pytest.mark.parametrize("before", [True, False], ids=["ceases", "appears"])
def test_an_echo_that_changes_while_the_bus_is_open_is_never_a_result(before: bool) -> None:
    engine = Engine(answer=Servos(), echo=before)
    engine.wire.answer = Servos(lambda node: 2222)
    engine.wire.echoes = not before
    for number in range(3):
        engine.submit(str(number), read(1))
        engine.advance(0.3)
        assert isinstance(engine.result(str(number)), UnexpectedReply)
    assert engine.bus.echoes is before
    assert engine.bus.statistics.other["echo"] >= 1


def test_a_part_of_an_echo_is_no_reply() -> None:
    """Where an echo is known, the first six bytes of a longer frame look like an acknowledgement."""
    engine = Engine(answer=Servos(), echo=True)
    engine.wire.echoes = False
    longer = status(1) + bytes(5)
    engine.submit("a", request(longer, [(1, 1, 6)], lambda _: "acknowledged"))
    engine.deliver(longer[:6])
    engine.advance(0.1)
    assert isinstance(engine.result("a"), OutcomeUnknown)


def test_the_echo_of_an_earlier_frame_is_no_reply(engine: Engine) -> None:
    """A write of one byte has the length of the reply to a read of two."""
    engine.submit("a", request(write_frame(1, 41, 7), [], lambda _: None))
    engine.submit("b", read(1))
    engine.deliver(write_frame(1, 41, 7))
    assert engine.result("b") is PENDING


# -- several requests ----------------------------------------------------------------------------------------


def test_a_half_duplex_bus_has_one_request_in_flight(engine: Engine) -> None:
    for node in (1, 2, 3):
        engine.submit(str(node), read(node))
    for node in (1, 2, 3):
        assert engine.sent() == [read_frame(node)]
        engine.deliver(said(node, 10 * node))
    assert [engine.result(str(node)) for node in (1, 2, 3)] == [10, 20, 30]


def test_a_can_bus_has_one_request_in_flight_per_lane_and_as_many_lanes_as_its_window(can: Engine) -> None:
    window = can.driver.window
    lanes = range(1, window + 3)
    for node in lanes:
        can.submit(f"{node}", can_read(node))
        can.submit(f"{node} again", can_read(node))
    sent = nodes(can.sent())
    assert len(sent) == window
    assert len(set(sent)) == window, "one on each lane"
    answered = sent[3]
    can.deliver(uploaded(answered, 7))
    assert len(can.sent()) == 1
    can.wire.answer = Servos()
    for node in sent:
        if node != answered:
            can.deliver(uploaded(node, 100 * node))
    can.advance(0.5)
    wanted = [7 if node == answered else 100 * node for node in lanes]
    assert [can.result(f"{node}") for node in lanes] == wanted


@pytest.mark.parametrize("other", [uploaded(1, 5, 0x6063), downloaded(1), uploaded(2, 5)])
def test_a_can_reply_to_something_else_is_no_answer(can: Engine, other: CanFrame) -> None:
    can.submit("a", can_read(1))
    can.deliver(other)
    assert can.result("a") is PENDING
    can.deliver(uploaded(1, 7))
    assert can.result("a") == 7


def test_a_deadline_on_can_allows_for_the_frames_of_other_lanes(can: Engine) -> None:
    can.submit("1", can_read(1))
    alone = can.deadline
    assert alone == pytest.approx(0.050488, abs=1e-5)
    for node in range(2, 9):
        can.submit(str(node), can_read(node))
    assert can.deadline == pytest.approx(0.05 + 8 * (alone - 0.05), abs=2e-5)


def test_the_higher_priority_is_sent_first(engine: Engine) -> None:
    engine.submit("first", read(9))
    order = [Priority.CONFIGURATION, Priority.POLL, Priority.CONTROL, Priority.STOP]
    for node, priority in enumerate(order, 1):
        effect = Effect.TORQUE if priority is Priority.STOP else Effect.NONE
        engine.submit(str(node), write(node, priority=priority, effect=effect))
    engine.wire.answer = Servos()
    engine.deliver(said(9, 1))
    engine.advance(0.1)
    assert nodes(engine.sent()) == [9, 4, 3, 2, 1]


def test_equal_priorities_are_sent_in_order(can: Engine) -> None:
    order = [5, 3, 9, 1, 7, *range(20, 40)]
    can.wire.answer = Servos()
    for node in order:
        can.submit(str(node), can_read(node))
    can.advance(0.1)
    assert nodes(can.sent()) == order


def test_an_exclusive_sequence_is_not_interrupted_but_by_a_stop(engine: Engine) -> None:
    engine.wire.answer = Servos()
    engine.wire.delay = 0.01
    engine.submit("alone", exclusive(read(1), read(1), read(1)))
    engine.submit("other", read(2, priority=Priority.CONTROL))
    engine.submit("alone too", exclusive(read(3), read(3)))
    engine.advance(0.005)
    engine.submit("stop", torque_off(4))
    engine.advance(0.2)
    assert nodes(engine.sent()) == [1, 4, 1, 1, 2, 3, 3]
    assert engine.result("alone") == [100, 100, 100]


def test_an_exclusive_sequence_that_is_cancelled_frees_the_bus(engine: Engine) -> None:
    engine.submit("alone", exclusive(read(1), read(1)))
    engine.submit("other", read(2))
    engine.cancel("alone")
    engine.deliver(said(1, 7))
    engine.deliver(said(2, 8))
    assert isinstance(engine.result("alone"), Cancelled)
    assert engine.result("other") == 8


def test_a_notification_without_a_request_is_passed_on_and_disturbs_no_reply(can: Engine) -> None:
    watch = can.bus.notices.subscribe()
    can.submit("none", notification(7, 0.5))
    can.submit("one", notification(5, 0.5))
    can.submit("read", can_read(5))
    report = CanFrame(0x585, b"\x64\0\0\0")
    can.deliver(report, uploaded(5, 77))
    assert can.result("read") == 77
    assert can.result("one") == "report"
    assert can.result("none") is PENDING
    can.advance(0.5)
    assert can.result("none") is None
    assert [(notice.node, notice.data) for notice in watch] == [(5, report.data)]


def test_a_group_read_without_one_node_has_the_others(engine: Engine) -> None:
    engine.submit("a", group(1, 2, 3))
    assert engine.sent() == [group_frame(1, 2, 3)]
    engine.deliver(said(1, 11) + said(3, 33))
    assert engine.result("a") is PENDING
    engine.advance(0.03)
    assert engine.result("a") == {1: 11, 3: 33}
    assert [sum(engine.counts(node).errors.values()) for node in (1, 2, 3)] == [0, 1, 0]


def test_a_damaged_reply_in_a_group_loses_that_node_only(engine: Engine) -> None:
    damaged = said(2, 22)[:-1] + b"\x00"
    engine.submit("a", group(1, 2, 3))
    engine.deliver(said(1, 11) + damaged + said(3, 33))
    engine.advance(0.03)
    assert 2 not in engine.result("a")
    assert engine.result("a")[3] == 33


def test_a_dead_node_of_a_group_is_waited_for_ever_less_often(engine: Engine) -> None:
    servos = engine.wire.answer = Servos()
    servos.silent = {2}
    waited = 0
    for number in range(300):
        before = engine.now
        engine.submit(str(number), group(1, 2, 3))
        while engine.result(str(number)) is PENDING:
            engine.advance(0.0005)
        assert engine.result(str(number)) == {1: 100, 3: 300}
        waited += engine.now - before > 0.015
        engine.advance(0.002)
    assert 3 <= waited <= 12
    servos.silent = set()
    engine.advance(1.0)
    engine.submit("again", group(1, 2, 3))
    engine.advance(0.1)
    assert engine.result("again") == {1: 100, 2: 200, 3: 300}


def test_a_late_reply_to_a_group_read_is_not_in_the_next(engine: Engine) -> None:
    engine.submit("a", group(1, 2))
    engine.deliver(said(1, 11))
    engine.advance(0.03)
    assert engine.result("a") == {1: 11}
    engine.submit("b", group(1, 2))
    engine.deliver(said(2, 1111))
    engine.wire.answer = Servos()
    engine.advance(0.3)
    assert engine.result("b") == {1: 100, 2: 200}


def test_every_node_is_asked_and_each_reply_counts_until_the_deadline(engine: Engine) -> None:
    engine.submit("a", request(instruction(BROADCAST, 1), None, lambda replies: [one[2] for one in replies]))
    engine.deliver(status(7), status(3))
    assert engine.result("a") is PENDING
    engine.deliver(status(5))
    engine.advance(2.0)
    assert engine.result("a") == [7, 3, 5]


def test_a_request_cancelled_while_it_waits_is_never_sent(engine: Engine) -> None:
    engine.submit("a", read(1))
    engine.submit("b", write(2))
    engine.cancel("b")
    engine.deliver(said(1, 7))
    engine.advance(1.0)
    assert engine.sent() == [read_frame(1)]
    assert isinstance(engine.result("b"), Cancelled)


def test_a_request_cancelled_in_flight_keeps_its_lane_and_is_answered_by_no_other(engine: Engine) -> None:
    engine.submit("a", read(1))
    engine.sent()
    engine.cancel("a")
    assert isinstance(engine.result("a"), Cancelled)
    engine.submit("b", read(1))
    assert engine.sent() == []
    engine.advance(0.03)
    engine.deliver(said(1, 1111))
    assert engine.result("b") is PENDING
    engine.wire.answer = Servos(lambda node: 2222)
    engine.advance(0.3)
    assert engine.result("b") == 2222


# -- stop ----------------------------------------------------------------------------------------------------


def known(engine: Engine, *known_nodes: int) -> None:
    engine.wire.answer = Servos()
    for node in known_nodes:
        engine.run(read(node))
    engine.sent()


def test_stop_frames_are_sent_first_and_repeated_to_no_node_that_acknowledged(engine: Engine) -> None:
    known(engine, 1, 2, 3)
    engine.wire.delay = 0.001
    engine.submit("a", read(1))
    for node in (1, 2, 3):
        engine.submit(f"move {node}", move(node))
    begun = engine.now
    outcome = engine.estop()
    frames = engine.sent()
    stops = [write_frame(node, TORQUE, 0) for node in (BROADCAST, 1, 2, 3)]
    assert frames == [read_frame(1), *stops]
    assert outcome.acknowledged == (1, 2, 3)
    assert outcome.silent == ()
    assert engine.now - begun < 0.05
    assert all(isinstance(engine.result(f"move {node}"), Interrupted) for node in (1, 2, 3))


def test_a_stop_waits_for_the_rest_of_a_reply_only(engine: Engine) -> None:
    engine.submit("a", read(1))
    engine.sent()
    begun = engine.now
    engine.estop()
    at, first = engine.wire.sent[0]
    assert first == write_frame(BROADCAST, TORQUE, 0)
    assert begun < at < begun + 0.004
    assert isinstance(engine.result("a"), Interrupted)


@pytest.mark.parametrize("answers", [0, 1, 3, 5])
def test_a_stop_is_repeated_up_to_five_times_until_it_is_acknowledged(engine: Engine, answers: int) -> None:
    known(engine, 1, 2)
    servos, stop = Servos(), write_frame(2, TORQUE, 0)

    def answer(frame: bytes) -> list[Any]:
        count = sum(data == stop for _, data in engine.wire.sent)
        servos.silent = {2} if answers == 0 or count < answers else set()
        return servos(frame)

    engine.wire.answer = answer
    outcome = engine.estop()
    frames = engine.sent()
    assert frames.count(stop) == (answers or 5)
    assert frames.count(write_frame(BROADCAST, TORQUE, 0)) == (answers or 5)
    assert frames.count(write_frame(1, TORQUE, 0)) == 1
    assert outcome.acknowledged == ((1, 2) if answers else (1,))
    assert outcome.silent == (() if answers else (2,))
    assert outcome.rounds == (answers or 5)


def test_a_latched_stop_refuses_motion_and_torque_until_reset_and_lets_reads_pass(engine: Engine) -> None:
    known(engine, 1)
    engine.estop()
    engine.sent()
    assert engine.bus.latched
    for number, refused in enumerate((move(1), torque(1), torque(1, 0))):
        engine.submit(str(number), refused)
        engine.advance(0.1)
        assert isinstance(engine.result(str(number)), Interrupted)
        with pytest.raises(Interrupted, match="reset"):
            engine.run(refused)
    assert engine.sent() == []
    assert engine.run(read(1)) == 100
    assert engine.run(write(1)) == "written"
    engine.bus.reset()
    assert engine.run(move(1)) == "written"


@pytest.mark.parametrize("stop", [torque_off(1), torque_off_everywhere()])
def test_a_torque_off_ends_the_motion_orders_of_its_nodes_that_wait(engine: Engine, stop: Any) -> None:
    engine.submit("read", read(3))
    engine.submit("move 1", move(1))
    engine.submit("torque 1", torque(1))
    engine.submit("write 1", write(1))
    engine.submit("stop", stop)
    engine.submit("later", move(1, 9))
    engine.wire.answer = Servos()
    engine.deliver(said(3, 7))
    engine.advance(0.2)
    for name in ("move 1", "torque 1"):
        assert isinstance(engine.result(name), Interrupted)
    assert engine.result("write 1") == engine.result("later") == "written"
    frames = [frame for frame in engine.sent() if frame[4] == 3]
    assert frames[0][5:7] == bytes([TORQUE, 0])
    assert sorted(frames[1:]) == sorted([write_frame(1, 20, 1), write_frame(1, GOAL, 9)])


def test_a_motion_order_that_is_lost_is_not_repeated_behind_a_torque_off(engine: Engine) -> None:
    engine.submit("move", move(1, repeatable=True))
    engine.submit("stop", torque_off(1))
    engine.sent()
    engine.advance(engine.deadline + 1e-6)
    engine.deliver(status(1))
    assert engine.result("stop") is PENDING, "this may acknowledge the motion order"
    engine.wire.answer = Servos()
    engine.deliver(status(1))
    assert engine.result("stop") == "written"
    engine.advance(1.0)
    assert isinstance(engine.result("move"), Interrupted)
    assert write_frame(1, GOAL, 1) not in engine.sent()


def test_a_stop_ends_the_motion_orders_of_nodes_that_it_does_not_know(can: Engine) -> None:
    can.submit("read", can_read(9))
    can.submit("move", can_move(9))
    can.wire.answer = Servos()
    can.estop()
    can.advance(1.0)
    assert isinstance(can.result("move"), Interrupted)
    assert download_frame(9, 1) not in can.sent()


def test_a_late_acknowledgement_is_not_taken_for_that_of_the_stop(engine: Engine) -> None:
    engine.submit("a", write(1))
    engine.advance(0.03)
    engine.submit("stop", torque_off(1))
    engine.deliver(status(1))
    assert engine.result("stop") is PENDING
    engine.deliver(status(1))
    assert engine.result("stop") == "written"


def test_a_can_node_is_held_at_a_fresh_position_and_asked_for_an_old_one(can: Engine) -> None:
    servos = can.wire.answer = Servos()
    for age, frames in ((0.0, [4]), (10.0, [4, 4])):
        assert can.run(can_read(4, reports_position=True)) == 400
        can.advance(age)
        can.sent()
        outcome = can.estop()
        assert outcome.acknowledged == (4,)
        assert nodes(can.sent()) == frames
        can.bus.reset()
    servos.silent = {4}
    assert can.estop().silent == (4,)


@pytest.mark.parametrize("work", [move(1), torque(1)])
def test_a_bus_without_a_gate_refuses_motion_and_torque_but_sends_a_stop(work: Any) -> None:
    engine = Engine(check=None, answer=Servos())
    engine.wire.answer = Servos()
    engine.submit("a", work)
    engine.advance(0.1)
    assert isinstance(engine.result("a"), RequestError)
    with pytest.raises(RequestError, match="no gate"):
        engine.run(work)
    assert engine.sent() == []
    assert engine.run(read(1)) == 100
    assert engine.run(torque_off(1)) == "written"
    assert engine.estop().acknowledged == (1,)


def test_the_gate_is_asked_before_every_try_of_motion_and_torque() -> None:
    asked: list[bytes] = []

    def check(one: Any) -> None:
        asked.append(one.wire)
        if len(asked) == 3:
            raise LimitExceeded("beyond the limit")

    engine = Engine(check=check, answer=Servos())
    engine.wire.answer = Servos()
    for work in (read(1), write(1), torque_off(1)):
        engine.run(work)
    assert asked == []
    engine.sent()
    engine.run(torque(1))
    engine.wire.answer = lambda frame: Servos()(frame) if frame[4] == 2 else []
    engine.submit("move", move(1, repeatable=True))
    engine.advance(0.5)
    assert isinstance(engine.result("move"), LimitExceeded)
    assert engine.sent().count(write_frame(1, GOAL, 1)) == 1
    assert asked == [write_frame(1, TORQUE, 1), write_frame(1, GOAL, 1), write_frame(1, GOAL, 1)]
    del asked[2:]
    with pytest.raises(LimitExceeded):
        engine.run(move(1))


@pytest.mark.parametrize(
    ("goal", "refusal"), [(1.0, ""), (1.1, "outside"), (-1.1, "outside"), (nan, "finite"), (inf, "finite")]
)
def test_the_gate_of_an_opened_bus_refuses_a_goal_beyond_its_limits(goal: float, refusal: str) -> None:
    with motorbus.simulate("feetech", ids="1") as simulation, motorbus.open(simulation.url) as bus:
        if not refusal:
            assert bus.run(move(1, goal=goal)) == "written"
            return
        with pytest.raises(LimitExceeded, match=refusal):
            bus.run(move(1, goal=goal))


# -- the link ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_a_listen_only_bus_sends_nothing(family: str) -> None:
    engine = Engine(family, listen_only=True)
    work = read(1) if family == "feetech" else can_read(1)
    engine.submit("a", work)
    assert isinstance(engine.result("a"), RequestError)
    with pytest.raises(RequestError, match="listen"):
        engine.run(work)
    assert engine.estop().rounds == 0
    engine.advance(1.0)
    assert engine.sent() == []


def test_a_lost_link_fails_everything_and_nothing_of_before_is_sent_later(engine: Engine) -> None:
    known(engine, 1)
    engine.wire.answer = lambda frame: []
    engine.submit("read", read(1))
    engine.submit("alone", exclusive(read(2)))
    for node in (1, 2, 3):
        engine.submit(f"move {node}", move(node))
    engine.submit("listen", notification(1, 5.0))
    engine.sent()
    engine.unplug()
    for name in ("read", "alone", "move 1", "move 2", "move 3", "listen"):
        assert isinstance(engine.result(name), LinkLost), name
    with pytest.raises(LinkLost):
        engine.run(move(1, 5))
    engine.plug()
    engine.wire.answer = Servos()
    engine.advance(1.0)
    assert engine.sent() == []
    assert engine.run(read(1)) == 100
    probe, asked = engine.sent()
    assert (probe[4], asked) == (2, read_frame(1))
    assert probe != asked, "what was owed before the loss may still come"


def test_a_procedure_that_began_before_a_loss_moves_nothing_after_it(engine: Engine) -> None:
    known(engine, 1)
    servos = engine.wire.answer

    async def stubborn() -> Any:
        for work in (read(1), move(1), read(1), move(1, 2)):
            try:
                await work
            except LinkLost:
                engine.link.plug()

    def answer(frame: Any) -> Any:
        if frame == write_frame(1, GOAL, 1):
            engine.link.unplug()
        return servos(frame)

    engine.wire.answer = answer
    engine.submit("a", stubborn())
    engine.advance(1.0)
    assert engine.result("a") is None
    assert write_frame(1, GOAL, 2) not in engine.sent()
    assert engine.run(move(1, 3)) == "written"


def test_a_latched_stop_stays_latched_over_a_loss(engine: Engine) -> None:
    known(engine, 1)
    engine.estop()
    engine.unplug()
    engine.plug()
    engine.advance(0.1)
    with pytest.raises(Interrupted):
        engine.run(move(1))


def test_statistics_balance_for_every_node(engine: Engine) -> None:
    before = {node: engine.counts(node).sent if node == 1 else 0 for node in (1, 2, 3)}
    servos = engine.wire.answer = Servos()
    servos.silent = {2}
    for number, work in enumerate((read(1), read(2), group(1, 2, 3), write(3), read(1))):
        engine.submit(str(number), work)
        engine.advance(0.3)
    engine.wire.answer = lambda frame: []
    engine.submit("lost", read(3))
    engine.unplug()
    for node in (1, 2, 3):
        counts = engine.counts(node)
        assert counts.sent == counts.ok + sum(counts.errors.values()) > before[node]
    assert engine.counts(2).ok == 0
    assert engine.counts(3).errors["lost"] == 1
