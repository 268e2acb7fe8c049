"""What happens when on a simulated bus: by hand, without ports and without a clock."""

from __future__ import annotations

import pytest

from motorbus.core.can_bits import bits
from motorbus.core.operation import CanFrame
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Side
from motorbus.link.memory import NoisyLine
from motorbus.simulation.course import BACKLOG, HASTE, Course
from tests.simulation.parrots import ANSWER, THINKS, Parrots

FRAME = CanFrame(0x601, bytes(8))
REPLY = CanFrame(0x601 ^ ANSWER, bytes(8))


def told(course: Course, now: float) -> list[tuple[object, object, object]]:
    return [(event.at, event.data, event.sender) for event in course.happen(now)]


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
    class Ears(Parrots):
        def receive(self, data: object, at: float) -> None:
            self.heard.append((at, b"x"))

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
