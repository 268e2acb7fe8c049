"""What a cycle brought tells how old each position is, also where a bus answered long before another."""

from __future__ import annotations

import pytest

from motorbus.core.family import Quality
from motorbus.motion.loop.readings import LoopState
from tests.motion.loop.test_rounds import Slow, cycles, looping


def test_it_says_what_it_is() -> None:
    state = LoopState(2.5, 7, {"a1": 0.1}, frozenset({"a1"}), lambda at: {"a1": at - 2.0})
    assert state.age == {"a1": 0.5}
    assert repr(state) == "<LoopState 7 at 2.5 s, missing a1>"
    assert state.quality == {"a1": Quality.REPEATED}


def test_it_says_how_far_each_can_be_believed() -> None:
    names = ("a1", "a2", "a3", "a4")
    doubts = {"a2": Quality.SUSPECT, "a3": Quality.CONFIRMED}
    state = LoopState(0.0, 1, dict.fromkeys(names, 0.1), frozenset({"a4"}), lambda at: {}, doubts)
    assert list(state.quality.values()) == [
        Quality.FRESH,
        Quality.SUSPECT,
        Quality.CONFIRMED,
        Quality.REPEATED,
    ]
    assert repr(state) == "<LoopState 1 at 0 s, missing a4, a2 suspect, a3 confirmed>"


def test_a_position_of_a_bus_that_answered_early_is_older() -> None:
    with looping(arm="1", can="0x21") as (_, loop, sims):
        sims["can"].line = slow = Slow()
        slow.by = 0.004
        state = cycles(loop, 2)
        assert state.age["c1"] == pytest.approx(0.0, abs=0.0005)
        assert state.age["a1"] == pytest.approx(0.004, abs=0.0005)
        cycles(loop, 3)
        assert state.age["a1"] == pytest.approx(0.004, abs=0.0005)  # that is of its own cycle
