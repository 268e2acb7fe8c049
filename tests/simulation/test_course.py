"""What happens when on a simulated bus: by hand, without ports and without a clock."""

from __future__ import annotations

from collections import Counter

import pytest

from motorbus.core.can_bits import bits
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Side
from motorbus.link.memory import NoisyLine
from motorbus.simulation.course import AHEAD, BACKLOG, HASTE, PIECE, Course
from motorbus.simulation.faults import FaultyLine
from tests.simulation.parrots import ANSWER, THINKS, Parrots

RATE = 100_000
BYTE = 10 / RATE
FRAME = CanFrame(0x601, bytes(8))
REPLY = CanFrame(0x601 ^ ANSWER, bytes(8))


def told(course: Course, now: float) -> list[tuple[object, object, object]]:
    return [(event.at, event.data, event.sender) for event in course.happen(now)]


class Ears(Parrots):
    """Devices on a serial line: they note what they hear, and say nothing but what they are told to."""

    def receive(self, data: Data, at: float) -> None:
        self.heard.append((at, data))


def test_without_pace_a_frame_arrives_and_is_answered_at_once() -> None:
    course = Course(Parrots())
    course.hear(FRAME, 1.0, "me")
    assert told(course, 1.0) == [(1.0, FRAME, "me"), (1.0, REPLY, None)]


def test_without_pace_what_takes_long_is_waited_for() -> None:
    course = Course(Parrots(thinks=0.1))
    course.hear(FRAME, 1.0, "me")
    assert told(course, 1.0) == [(1.0, FRAME, "me")]
    assert course.next() == pytest.approx(1.1 - HASTE)
    assert told(course, 1.099) == [(1.099, REPLY, None)]


def test_with_pace_a_frame_takes_its_bits() -> None:
    course = Course(Parrots(), pace=500_000)
    course.hear(FRAME, 1.0, "me")
    there = 1.0 + bits(FRAME) / 500_000
    back = there + THINKS + bits(REPLY) / 500_000
    assert told(course, 2.0) == [(pytest.approx(there), FRAME, "me"), (pytest.approx(back), REPLY, None)]


def test_with_pace_the_wire_carries_one_frame_at_a_time_whoever_sends() -> None:
    course = Course(Parrots(thinks=0.0), pace=500_000)
    for _ in range(3):
        course.hear(FRAME, 1.0)
    (last, _, _) = told(course, 2.0)[-1]
    assert last == pytest.approx(1.0 + 3 * (bits(FRAME) + bits(REPLY)) / 500_000)


def test_the_rate_that_is_set_is_the_pace() -> None:
    course = Course(Parrots(250_000), pace=500_000)
    course.tune(250_000)
    course.hear(FRAME, 1.0)
    assert told(course, 2.0)[0][0] == pytest.approx(1.0 + bits(FRAME) / 250_000)


def test_devices_are_tuned_when_the_rate_changes_only() -> None:
    bus = Parrots()
    course = Course(bus)
    for rate in (None, 250_000, 250_000, None, 500_000):
        course.tune(rate)
    assert bus.tuned == [250_000, 500_000]


def test_a_frame_comes_at_the_rate_of_its_sender() -> None:
    bus = Parrots(500_000)
    course = Course(bus)
    course.hear(FRAME, 1.0, "right", 500_000)
    course.hear(FRAME, 1.0, "wrong", 250_000)
    list(course.happen(1.0))
    assert bus.tuned == [500_000, 250_000]
    assert len(bus.heard) == 1


def test_a_line_stands_between() -> None:
    line = NoisyLine(1, loss=1.0)
    course = Course(Parrots(), line=line)
    course.hear(FRAME, 1.0, "me")
    assert told(course, 1.0) == [(1.0, FRAME, "me")]
    assert line.count("loss") == 1


def test_an_echo_is_heard_by_the_sender_too() -> None:
    course = Course(Parrots(), line=NoisyLine(1, echo=True))
    course.hear(FRAME, 1.0, "me")
    assert told(course, 1.0)[:2] == [(1.0, FRAME, "me"), (1.0, FRAME, None)]


def test_bytes_are_for_the_device_alone() -> None:
    bus = Ears()
    course = Course(bus)
    course.hear(b"abc", 1.0)
    assert told(course, 1.0) == []
    assert len(bus.heard) == 1


def test_too_much_under_way_is_told() -> None:
    class Slow:
        def carry(self, sender: Side, data: object, at: float) -> list[Delivery]:
            return [Delivery(at + 1.0, Side.DEVICE, FRAME)] if sender is Side.HOST else []

    course = Course(Parrots(), line=Slow())
    for _ in range(BACKLOG):
        assert not course.crowded
        course.hear(FRAME, 1.0)
    assert course.crowded
    list(course.happen(2.0))
    assert not course.crowded


@pytest.mark.parametrize("pace", [0, -1])
def test_an_impossible_pace(pace: int) -> None:
    with pytest.raises(RequestError, match="pace"):
        Course(Parrots(), pace=pace)


def test_what_is_forgotten_never_arrives() -> None:
    course = Course(Parrots(), pace=500_000)
    course.hear(FRAME, 1.0, "me")
    course.forget()
    assert told(course, 9.0) == []


def test_a_paced_piece_is_heard_packet_by_packet_each_when_its_last_byte_has_passed() -> None:
    bus = Ears()
    course = Course(bus, pace=RATE)
    said = bytes(range(200)) * 3
    course.hear(said, 1.0)
    list(course.happen(2.0))
    assert b"".join(bytes(data) for _, data in bus.heard if isinstance(data, bytes)) == said
    passed = [min(PIECE * number, len(said)) for number in (1, 2, 3)]
    assert [at for at, _ in bus.heard] == pytest.approx([1.0 + count * BYTE for count in passed])


def test_without_pace_it_is_one_piece() -> None:
    bus = Ears()
    Course(bus).hear(bytes(1000), 1.0)
    course = Course(bus)
    course.hear(bytes(1000), 1.0)
    list(course.happen(1.0))
    assert bus.heard == [(1.0, bytes(1000))]


def test_bytes_are_given_early_with_their_own_moment() -> None:
    bus = Ears()
    course = Course(bus, pace=RATE)
    course.hear(bytes(100), 1.0)
    end = 1.0 + 100 * BYTE
    assert course.next() == pytest.approx(end - AHEAD)
    list(course.happen(end - AHEAD - 1e-6))
    assert bus.heard == []
    list(course.happen(end - AHEAD + 1e-6))
    ((at, data),) = bus.heard
    assert at == pytest.approx(end)
    assert data == bytes(100)


def test_what_a_device_says_before_is_said_before() -> None:
    bus = Ears()
    course = Course(bus, pace=RATE)
    course.hear(bytes(100), 1.0)
    end = 1.0 + 100 * BYTE
    bus.say(FRAME, end - 0.001)
    list(course.happen(end - 0.002))
    assert bus.heard == []
    list(course.happen(end))
    assert len(bus.heard) == 1


def test_time_never_goes_back_for_devices() -> None:
    class Clocked(Ears):
        now = 0.0

        def receive(self, data: Data, at: float) -> None:
            super().receive(data, at)
            self.now = at

        def advance(self, to: float) -> list[tuple[float, Data]]:
            assert to >= self.now
            self.now = to
            return super().advance(to)

    bus = Clocked()
    course = Course(bus, pace=RATE)
    course.hear(bytes(100), 1.0)
    for step in range(20):
        list(course.happen(1.0 + step * 0.001))
    assert len(bus.heard) == 1
    assert bus.now == pytest.approx(1.019)


def test_frames_are_not_given_early_for_others_see_them_too() -> None:
    course = Course(Parrots(), pace=RATE)
    course.hear(FRAME, 1.0, "me")
    end = 1.0 + bits(FRAME) / RATE
    assert course.next() == pytest.approx(end)
    assert told(course, end - 1e-6) == []


OTHERS = CanFrame(0x626, bytes(8))
CALL = CanFrame(0x600, bytes(8))


def shared(script: str) -> tuple[Parrots, Course, FaultyLine]:
    """Devices on a bus that others share, with this going wrong, and answers that take a moment."""
    bus, line = Parrots(thinks=1.0), FaultyLine(script)
    bus.others, bus.calls = {OTHERS.id}, {CALL.id}
    return bus, Course(bus, line=line, shared=True), line


@pytest.mark.parametrize(
    "harm", ["drop", "duplicate", "flip", "corrupt", "truncate", "delay 0.5", "stall 0.5", "reorder", "merge"]
)
def test_what_is_for_others_on_a_shared_bus_passes_unharmed_and_is_no_exchange(harm: str) -> None:
    bus, course, line = shared(f"100% to device: {harm}")
    course.hear(OTHERS, 1.0, "me")
    assert told(course, 1.5) == [(1.0, OTHERS, "me")]
    assert bus.heard == [(1.0, OTHERS)]
    assert (line.exchange, line.count) == (0, 0)
    course.hear(FRAME, 1.6, "me")
    assert (line.exchange, line.count) == (1, 1)


def test_an_echo_on_a_shared_bus_is_of_what_is_for_these_devices_only() -> None:
    _, course, line = shared("100%: echo")
    for frame in (OTHERS, CALL, FRAME):
        course.hear(frame, 1.0, "me")
    assert Counter(told(course, 1.0)) == Counter(
        [(1.0, OTHERS, "me"), (1.0, CALL, "me"), (1.0, FRAME, "me"), (1.0, FRAME, None)]
    )
    assert (line.exchange, line.count) == (2, 1), "what nobody hears has not happened"


def test_an_echo_that_nobody_hears_is_still_to_come() -> None:
    _, course, line = shared("exchange 1: echo; at 0 s: echo; exchange 1 to device: duplicate")
    course.hear(CALL, 1.0, "me")
    assert told(course, 1.0) == [(1.0, CALL, "me")]
    assert [str(fault) for fault in line.pending] == ["exchange 1: echo", "at 0 s: echo"]
    course.hear(FRAME, 1.0, "me")
    assert Counter(told(course, 1.0)) == Counter([(1.0, FRAME, "me"), (1.0, FRAME, None)])
    assert [one.fault for one in line.fired] == ["exchange 1 to device: duplicate", "exchange 2: echo"]


def test_an_echo_of_what_is_for_everyone_is_heard_where_nobody_else_is() -> None:
    line = FaultyLine("exchange 1: echo")
    course = Course(Parrots(thinks=1.0), line=line)
    course.hear(CALL, 1.0, "me")
    assert Counter(told(course, 1.0)) == Counter([(1.0, CALL, "me"), (1.0, CALL, None)])
    assert line.count == 1


@pytest.mark.parametrize(("harm", "heard"), [("drop", 0), ("duplicate", 2), ("corrupt", 0)])
def test_of_what_is_for_everyone_only_these_devices_get_less_or_more(harm: str, heard: int) -> None:
    bus, course, line = shared(f"exchange 1 to device: {harm}")
    course.hear(CALL, 1.0, "me")
    assert told(course, 1.5) == [(1.0, CALL, "me")]
    assert bus.heard == [(1.0, CALL)] * heard
    assert (line.exchange, line.count) == (1, 1)


def test_what_is_said_by_these_devices_on_a_shared_bus_suffers() -> None:
    bus, course, _ = shared("exchange 0: duplicate")
    bus.say(REPLY, 1.0)
    assert told(course, 1.0) == [(1.0, REPLY, None)] * 2


def test_devices_that_cannot_tell_what_is_theirs_leave_a_shared_bus_alone() -> None:
    class Mute(Parrots):
        audience = None  # type: ignore[assignment]  # as of one that has no such method

    course = Course(Mute(), line=FaultyLine("100% to device: drop"), shared=True)
    course.hear(FRAME, 1.0, "me")
    assert told(course, 1.0)[0] == (1.0, FRAME, "me")
