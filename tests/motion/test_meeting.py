"""Buses that wait for each other: all begin at one moment, or nobody does, and each is told why."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from motorbus.core.operation import Operation, Pause
from motorbus.errors import Interrupted, MotorbusError, NoReply
from motorbus.motion.abreast import settled
from motorbus.motion.meeting import LOOK, NOTICE, Beat, Meeting
from tests.bus.responder import position, write
from tests.bus.several import Several

MOVED = 20  # the register that stands for a movement


def taking_part(
    beat: Beat, name: str, origin: float, needs: float, lead: float = 0.0
) -> Operation[tuple[float, float, float]]:
    """Agree, begin, and let it be seen; gives the duration, and when it came back and began (s, clock of all)."""
    yield from position(1)
    seat = beat.of(name, origin)
    duration = yield from seat.agreed(needs, lambda longest: longest)
    moment = yield from seat.start(lead)
    back = yield from Pause(0)
    yield from write(1, MOVED, 9)
    return duration, back - origin, moment - origin


def attending(beat: Beat, part: Operation[Any]) -> Operation[Any]:
    """Whoever fails tells the others."""
    try:
        return (yield from part)
    except MotorbusError as error:
        beat.fail(error)
        raise


def parts(several: Several, beat: Beat, **other: Operation[Any]) -> dict[str, Operation[Any]]:
    """Every bus takes part, but for the `other`; each in its place tells the rest when it fails."""
    wanted = {
        name: other.get(name) or taking_part(beat, name, several.origins[name], 0.1) for name in several.buses
    }
    return {name: attending(beat, one) for name, one in wanted.items()}


def who_moved(several: Several) -> list[str]:
    return [name for name, responder in several.responders.items() if responder.memory[1][MOVED] == 9]


@pytest.mark.parametrize("virtual", [(True, True, True), (False, False), (True, False)])
def test_all_begin_at_one_moment(virtual: tuple[bool, ...]) -> None:
    several = Several(*virtual)
    beat = Beat(several.buses)
    told = settled(several.concert.run(parts(several, beat)))
    starts = [start for _, _, start in told.values()]
    assert max(starts) - min(starts) < 1e-9
    assert who_moved(several) == list(several.buses)
    several.close()


def test_who_needs_a_lead_comes_back_that_much_earlier() -> None:
    several = Several(True, True)
    beat = Beat(several.buses)
    work = {
        name: taking_part(beat, name, several.origins[name], 0.1, lead)
        for name, lead in (("a", 0.05), ("b", 0.001))
    }
    told = several.concert.run(work)
    for name, lead in (("a", 0.05), ("b", 0.001)):
        _, back, start = told[name]
        assert start - back == pytest.approx(lead, abs=1e-6)
    assert told["a"][2] == pytest.approx(told["b"][2])


def test_all_have_time_to_look_before_the_start() -> None:
    assert NOTICE > 2 * LOOK
    several = Several(True, True)
    beat = Beat(several.buses)
    ready: dict[str, float] = {}

    def late(name: str, pause: float) -> Operation[float]:
        ready[name] = (yield from Pause(pause)) - several.origins[name]
        return (yield from beat.of(name, several.origins[name]).start(0.0)) - several.origins[name]

    told = several.concert.run({"a": late("a", 0.0), "b": late("b", 1.0)})
    assert told["a"] == pytest.approx(max(ready.values()) + NOTICE)
    assert told["b"] == pytest.approx(told["a"])


def test_the_duration_suits_everybody() -> None:
    several = Several(True, True, True)
    beat = Beat(several.buses)

    def tenths(longest: float) -> float:
        """A device that knows steps of 0.4 s."""
        return -(-longest // 0.4) * 0.4

    def agree(name: str, shortest: float, fitted: Any) -> Operation[float]:
        return (yield from beat.of(name, several.origins[name]).agreed(shortest, fitted))

    told = several.concert.run(
        {
            "a": agree("a", 0.5, lambda longest: longest),
            "b": agree("b", 0.2, tenths),
            "c": agree("c", 0.7, lambda longest: longest),
        }
    )
    assert told == pytest.approx({"a": 0.8, "b": 0.8, "c": 0.8})


@pytest.mark.parametrize("virtual", [(True, True, True), (False, False, False)])
def test_when_one_fails_before_the_start_nobody_moves_and_the_cause_is_told(
    virtual: tuple[bool, ...],
) -> None:
    several = Several(*virtual)
    several.responders["b"].dead = {1}
    beat = Beat(several.buses)
    told = several.concert.run(parts(several, beat))
    assert who_moved(several) == []
    assert isinstance(told["b"], NoReply)
    for name in "ac":
        assert isinstance(told[name], Interrupted)
        assert told[name].__cause__ is told["b"]
        assert told[name].cause == told["b"].summary
    with pytest.raises(NoReply) as caught:
        settled(told)
    assert any("a does not move" in note for note in caught.value.__notes__)
    several.close()


def test_who_comes_when_another_has_failed_is_told_as_well() -> None:
    several = Several(True)
    beat = Beat(["a", "elsewhere"])
    error = MotorbusError("it is on fire")
    beat.fail(error)
    beat.fail(MotorbusError("something else"))
    for meet in (beat.shortest, beat.fitted, beat.ready):
        with pytest.raises(Interrupted, match="a does not move") as caught:
            several.buses["a"].run(meet.meet("a", 1.0))
        assert caught.value.__cause__ is error


def test_a_failure_after_the_start_stops_nobody_else() -> None:
    several = Several(True, True)
    beat = Beat(several.buses)

    def begin(name: str) -> Operation[float]:
        moment = yield from beat.of(name, several.origins[name]).start(0.0)
        if name == "a":
            several.responders["a"].dead = {1}
        for _ in range(5):
            yield from position(1)
        return (yield from Pause(0)) - moment

    told = several.concert.run({name: attending(beat, begin(name)) for name in several.buses})
    assert isinstance(told["a"], NoReply)
    assert told["b"] == pytest.approx(0.0, abs=0.002), "and the dead one held it up by nothing"


@pytest.mark.parametrize(
    "error", [NoReply("it is gone"), KeyboardInterrupt("it is gone"), KeyboardInterrupt()]
)
def test_who_fails_with_its_seat_lets_nobody_begin(error: BaseException) -> None:
    several = Several(True, True)
    beat = Beat(several.buses)

    def gone() -> Operation[None]:
        beat.of("a", several.origins["a"]).fails(error)
        yield from Pause(0)

    waiting = attending(beat, taking_part(beat, "b", several.origins["b"], 0.1))
    told = several.concert.run({"a": gone(), "b": waiting})["b"]
    assert isinstance(told, Interrupted)
    assert (str(error) or "KeyboardInterrupt") in str(told)


def test_when_all_have_come_a_failure_changes_nothing_for_anybody() -> None:
    several = Several(True, True)
    meeting = Meeting[int](several.buses)
    said: list[Mapping[str, int]] = []

    def first() -> Operation[None]:
        said.append((yield from meeting.meet("a", 1)))
        meeting.fail(MotorbusError("too late"))

    def second() -> Operation[None]:
        yield from Pause(LOOK / 2)
        said.append((yield from meeting.meet("b", 2)))

    assert several.concert.run({"b": second(), "a": first()}) == {"a": None, "b": None}
    assert said == [{"a": 1, "b": 2}] * 2


def test_who_was_not_asked_is_refused() -> None:
    several = Several(True)
    with pytest.raises(ValueError, match=r"'c' has no part in this; those who have are \['a', 'b'\]"):
        several.buses["a"].run(Meeting[int](["a", "b"]).meet("c", 1))
