"""Nobody is ordered anywhere of whom nobody knows where he is; the others go on, and he comes back from where he is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians, tau
from typing import Any

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Quality
from motorbus.errors import NoReply
from motorbus.motion.loop.faces import Loop
from motorbus.motion.loop.place import STALE
from motorbus.motion.loop.readings import PATIENCE
from motorbus.session.robot import Robot
from tests.motion.loop.lines import Doubtful
from tests.motion.loop.test_rounds import RATE, cycles, looping
from tests.support.machines import machine

SLOW = 20.0
"""Hz: a bus leaves a device that it doubts alone for a while, which at this rate is four cycles and not eleven."""
STEP = radians(90) / SLOW
FAR = 1000  # counts: more than a motor can do between two cycles


@contextmanager
def doubtful(**made: Any) -> Iterator[tuple[Loop, Doubtful, Any]]:
    """A loop under way on a line that can be made to fail, without a watch: that asks for more than is counted here."""
    how = {"watch": False, **made.pop("how", {})}
    with looping(how=how, **{"arm": "1-3", "exit": "leave", **made}) as (robot, loop, sims):
        line = Doubtful()
        for sim in sims.values():
            sim.line = line
        yield loop, line, (robot, sims)


def packets(data: bytes) -> Iterator[bytes]:
    """The packets of one write: goals may leave with the next request."""
    while data:
        size = data[3] + 4
        yield data[:size]
        data = data[size:]


def ordered(line: Doubtful) -> list[set[int]]:
    """Whom each packet of goals that was sent since this was asked last orders."""
    found = []
    for data in line.sent:
        if isinstance(data, CanFrame):
            if data.data[0] in (0x22, 0x2B, 0x23):
                found.append({data.id & 0x7F})
            continue
        for frame in packets(data):
            if frame[4] == 0x83:  # SYNC WRITE: head of 7 bytes, then id and goal of each
                size = frame[6] + 1
                found.append(set(frame[7:-1:size]))
    line.sent.clear()
    return found


def test_who_is_silent_for_too_long_is_left_out_and_the_others_go_on() -> None:
    with doubtful(rate=SLOW) as (loop, line, _):
        loop.goal.update(dict.fromkeys(loop.axes, 2.0))
        cycles(loop, 12)
        line.mute = {2}
        ordered(line)
        cycles(loop, STALE + 1)
        assert ordered(line) == [{1, 2, 3}] * (STALE + 1)
        place: Any = loop._rounds.places["a2"]
        before = place.sent
        others: Any = loop._rounds.places["a1"].sent
        cycles(loop, 2)
        assert ordered(line) == [{1, 3}] * 2
        assert place.sent == before
        assert loop._rounds.places["a1"].sent == pytest.approx(others + 2 * STEP)
        assert loop.statistics.unordered == {"a1": 0, "a2": 2, "a3": 0}
        assert loop.statistics.lost["a2"] == STALE + 3
        assert "not ordered: a2 2" in str(loop.statistics)


def test_who_comes_back_goes_on_from_where_it_is_measured_to_be() -> None:
    with doubtful(rate=SLOW) as (loop, line, (_, sims)):
        loop.goal.update(dict.fromkeys(loop.axes, 2.0))
        cycles(loop, 12)
        line.mute = {2}
        cycles(loop, STALE)
        line.mute = set()  # the bus leaves it alone for as long again
        while (state := cycles(loop, 1)).missing:
            sims["arm"][2].raw_position = 2048 + 100  # and somebody turns it by hand
        assert state.quality["a2"] is Quality.CONFIRMED  # nobody had looked for long, and it is elsewhere
        place: Any = loop._rounds.places["a2"]
        assert place.sent == place.position == pytest.approx(100 / 4096 * tau, abs=0.02)
        line.sent.clear()
        cycles(loop, 1)
        assert ordered(line) == [{1, 2, 3}]
        assert 0 < place.sent - state.position["a2"] < STEP
        assert cycles(loop, 80).position["a2"] == pytest.approx(2.0, abs=0.02)


def test_the_limit_after_which_it_is_an_error_stays_and_comes_again() -> None:
    with doubtful(rate=SLOW) as (loop, line, _):
        loop.goal.update(dict.fromkeys(loop.axes, 1.0))
        cycles(loop, 20)
        line.mute = {2}
        for silent in (PATIENCE + 1, 2 * (PATIENCE + 1)):
            cycles(loop, PATIENCE)
            with pytest.raises(NoReply, match=f"a2: no reading in {silent} cycles"):
                next(loop)
        line.sent.clear()
        cycles(loop, 3)
        assert ordered(line) == [{1, 3}] * 3  # it is not ordered after the error either
        line.mute = set()
        assert cycles(loop, 150).position["a2"] == pytest.approx(1.0, abs=0.02)


def test_can_nodes_are_left_out_as_well() -> None:
    with doubtful(arm="", can="0x21-0x22", rate=SLOW) as (loop, line, _):
        loop.goal.update(dict.fromkeys(loop.axes, 0.7))
        cycles(loop, 20)
        line.mute = {0x21}
        cycles(loop, STALE + 1)
        ordered(line)
        cycles(loop, 2)
        assert ordered(line) == [{0x22}] * 2
        line.mute = set()
        assert cycles(loop, 150).position == pytest.approx({"c1": 0.7, "c2": 0.7}, abs=0.02)


def test_a_direct_loop_goes_on_from_there_too() -> None:
    with doubtful(how={"direct": True}, rate=SLOW) as (loop, line, _):
        goals = dict.fromkeys(loop.axes, 0.0)

        def lead(count: int) -> None:
            for _ in range(count):
                for name in goals:
                    goals[name] += 0.6 * STEP
                loop.goal.update(goals)
                next(loop)

        loop.goal.update(goals)
        cycles(loop, 2)
        lead(20)
        line.mute = {2}
        lead(STALE)
        line.mute = set()
        lead(20)
        assert loop.statistics.unordered["a2"] > 0
        assert loop._rounds.places["a2"].sent == pytest.approx(goals["a2"])


def test_while_leaving_the_silent_one_is_left_and_the_others_brake() -> None:
    with machine(arm="1-2", exit="leave") as (made, sims), Robot.of(made) as robot:
        line = Doubtful()
        with robot.loop(RATE, watch=False) as loop:
            loop.goal.update({"a1": 2.0, "a2": 2.0})
            cycles(loop, 60)
            sims["arm"].line = line
            line.mute = {2}
            cycles(loop, STALE)
        assert {1} in ordered(line)
        assert not robot["a1"].under_way
        assert robot["a2"].under_way  # nobody has seen it come to rest


# -- what cannot be believed ---------------------------------------------------------------------------------------


def test_a_reading_that_no_motor_can_have_come_to_is_suspect_and_holds_its_axis() -> None:
    with doubtful() as (loop, line, _):
        loop.goal.update(dict.fromkeys(loop.axes, 2.0))
        before = cycles(loop, 40)
        line.lying = {2: lambda raw: raw + FAR}
        state = cycles(loop, 1)
        assert state.quality == {"a1": Quality.FRESH, "a2": Quality.SUSPECT, "a3": Quality.FRESH}
        assert state.position["a2"] == before.position["a2"]
        assert state.age["a2"] == pytest.approx(state.at - before.at, abs=0.001)
        assert state.age["a1"] == 0.0
        assert state.missing == frozenset()
        assert "a2 suspect" in repr(state)
        line.lying = {}
        ordered(line)
        state = cycles(loop, 1)
        assert ordered(line) == [{1, 3}]  # it was held until another reading was in
        assert state.quality["a2"] is Quality.FRESH
        cycles(loop, 1)
        assert ordered(line) == [{1, 2, 3}]
        places = loop._rounds.places
        assert places["a2"].sent == pytest.approx(places["a1"].sent)  # what was missed is made good
        assert loop.statistics.suspect == {"a1": 0, "a2": 1, "a3": 0}
        assert loop.statistics.unordered["a2"] == 1
        assert loop.statistics.lost["a2"] == 0
        assert "readings not believed: a2 1" in str(loop.statistics)


def test_two_that_agree_are_believed_and_it_goes_on_from_there() -> None:
    with doubtful() as (loop, line, _):
        loop.goal.update(dict.fromkeys(loop.axes, 0.0))
        cycles(loop, 20)
        line.lying = {2: lambda raw: raw - FAR // 2}
        seen = [next(loop).quality["a2"] for _ in range(3)]
        assert seen == [Quality.SUSPECT, Quality.CONFIRMED, Quality.FRESH]
        place: Any = loop._rounds.places["a2"]
        there = -FAR // 2 / 4096 * tau
        assert place.position == pytest.approx(there, abs=0.01)
        assert there <= place.sent < there + STEP


def test_who_is_never_believed_ends_it_as_who_is_never_heard() -> None:
    with doubtful(rate=400.0) as (loop, line, _):
        loop.goal.update(dict.fromkeys(loop.axes, 0.0))
        cycles(loop, 20)
        turn = iter(range(1000))
        line.lying = {2: lambda raw: 300 + 3500 * (next(turn) % 2)}
        ordered(line)
        cycles(loop, PATIENCE)
        with pytest.raises(NoReply, match="a2: no reading"):
            next(loop)
        assert all(2 not in nodes for nodes in ordered(line)[1:])


def test_who_was_not_heard_is_repeated() -> None:
    with doubtful() as (loop, line, _):
        cycles(loop, 2)
        line.mute = {3}
        state = cycles(loop, 1)
        assert state.quality == {"a1": Quality.FRESH, "a2": Quality.FRESH, "a3": Quality.REPEATED}


def test_the_quickest_axis_is_believed() -> None:
    quick = {"max_velocity": "500 deg/s", "max_acceleration": "4000 deg/s2"}
    with doubtful(arm="1", rate=50.0, axes={"a1": quick}) as (loop, _, _made):
        loop.goal["a1"] = 2.0
        cycles(loop, 60)
        loop.goal["a1"] = -2.0
        cycles(loop, 100)
        assert loop.statistics.suspect == {"a1": 0}


# -- following -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("silent", [True, False])
def test_a_follower_stays_while_its_leader_is_not_heard_or_not_believed(silent: bool) -> None:
    with machine(arm="1-2") as (made, sims), Robot.of(made) as robot:
        line, sent = Doubtful(), []
        turn, lies = iter(range(1000)), iter(range(1000))

        def until() -> bool:
            number = next(turn)
            if number == 5:
                sims["arm"].line = line
                if silent:
                    line.mute = {1}
                else:
                    line.lying = {1: lambda raw: raw + FAR * (1 + next(lies) % 2)}
            if number == 9:
                line.mute, line.lying = set(), {}
                sent.extend(ordered(line))
                return True
            return False

        found = robot.follow({"a1": "a2"}, until=until)
        assert found.held["a2"] >= 2
        assert found.apart["a2"] == pytest.approx(0.0, abs=0.01)
        assert robot["a2"].position() == pytest.approx(0.0, abs=0.01)
        assert all(nodes == {2} for nodes in sent)  # it is told to stay
