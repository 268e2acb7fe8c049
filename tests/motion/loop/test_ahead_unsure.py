"""A loop that is a cycle ahead: whom it leaves out of what was made ready before he was known to be in doubt."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from motorbus.bus.loosed import Loosed
from motorbus.core.family import Quality
from motorbus.errors import NoReply
from motorbus.motion.loop.place import STALE
from motorbus.motion.loop.readings import PATIENCE, SILENCE, LoopState
from tests.motion.loop.test_ahead import Behind, ahead, packets
from tests.motion.loop.test_rounds import RATE, cycles
from tests.motion.loop.test_unsure import FAR, SLOW


def test_who_was_not_heard_is_left_out_of_what_is_ready() -> None:
    with ahead(rate=SLOW) as (_, loop, sims):
        line = sims["arm"].line
        loop.goal.update(dict.fromkeys(loop.axes, 2.0))
        cycles(loop, 12)
        packets(line)
        line.mute = {2}
        cycles(loop, STALE)
        line.mute = set()  # the bus leaves it alone for a while
        assert [set(packet) for packet in packets(line)] == [{1, 2, 3}] * STALE
        while next(loop).missing:
            pass
        left_out = [set(packet) == {1, 3} for packet in packets(line)]
        assert len(left_out) > 1
        assert left_out[:-1] == [True] * (len(left_out) - 1)
        assert loop.statistics.unordered == {"a1": 0, "a2": sum(left_out), "a3": 0}
        cycles(loop, 2)
        assert set(packets(line)[-1]) == {1, 2, 3}
        assert cycles(loop, 80).position["a2"] == pytest.approx(2.0, abs=0.02)


def test_who_cannot_be_where_he_says_is_not_ordered_by_what_was_ready_before() -> None:
    with ahead(rate=SLOW) as (_, loop, sims):
        line = sims["arm"].line
        loop.goal.update(dict.fromkeys(loop.axes, 2.0))
        cycles(loop, 12)
        packets(line)
        line.lying = {2: lambda raw: raw + FAR}
        state = next(loop)
        assert state.doubts["a2"] is Quality.SUSPECT
        assert [set(packet) for packet in packets(line)] == [{1, 3}]  # what left when that reading had come
        assert loop.statistics.suspect["a2"] == loop.statistics.unordered["a2"] == 1


def test_who_is_silent_too_long_ends_it_by_name() -> None:
    with ahead() as (_, loop, sims):
        cycles(loop, 2)
        sims["arm"][2].unplug()
        states: list[LoopState] = []
        with pytest.raises(NoReply, match="a2: no reading in "):
            states.extend(next(loop) for _ in range(100))
        assert len(states) >= PATIENCE
        assert states[-1].at - states[0].at == pytest.approx(SILENCE, abs=3 / RATE)


def test_who_was_left_out_goes_no_faster_than_he_may_afterwards() -> None:
    most = 4096 / 4 / RATE  # counts in a cycle, at 90 deg/s
    with ahead() as (_, loop, sims):
        line = sims["arm"].line
        loop.goal.update(dict.fromkeys(loop.axes, 2.5))
        cycles(loop, 60)
        packets(line)
        given = list[tuple[int, int]]()
        for lies in (True, *[False] * 42, True, *[False] * 8):
            line.lying = {2: lambda raw: raw - FAR} if lies else {}
            state = next(loop)
            given += [(state.number, packet[2]) for packet in packets(line) if 2 in packet]
        assert loop.statistics.suspect["a2"] >= 2
        assert len(given) < 52
        for (slot, here), (later, there) in pairwise(given):
            assert abs(there - here) <= (later - slot) * most + 1


def test_a_reading_that_waited_for_the_program_is_no_younger_than_it_can_be() -> None:
    with ahead(rate=20.0) as (robot, loop, _):
        cycles(loop, 5)
        link: Any = robot.buses["arm"].link
        began = loop._rounds.parts["arm"].began
        link.advance(0.015)  # its answer has been there for long
        state = next(loop)
        assert state.at == pytest.approx(began, abs=0.003)
        assert loop.statistics.cycle.most < 0.005
        assert state.age == dict.fromkeys(loop.axes, 0.0)


@pytest.mark.parametrize("lies", [False, True])
def test_who_cannot_be_where_he_says_is_not_ordered_right_behind_that_answer(
    lies: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[float | None] = []
    land = Loosed.land

    def landed(volley: Loosed, behind: Any = None) -> list[Any]:
        told = land(volley, behind)
        left.append(behind and behind.at)
        return told

    with ahead(how={"direct": True}, rate=200.0) as (_, loop, sims):
        loop.goal.update(dict.fromkeys(loop.axes, 0.0))
        cycles(loop, 3)
        sims["arm"].line = line = Behind()
        line.by = 0.006
        cycles(loop, 3)
        packets(line)
        monkeypatch.setattr(Loosed, "land", landed)
        line.lying = {2: lambda raw: raw + FAR} if lies else {}
        state = next(loop)
        assert ("a2" in state.doubts) is lies
        assert [at is None for at in left] == [lies]
        assert [set(packet) for packet in packets(line)] == [{1, 3} if lies else {1, 2, 3}]
