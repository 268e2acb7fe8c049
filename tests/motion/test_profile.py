"""Profiles keep their limits, end together and end exactly at their goals."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.profile import Kind, Limits, Move, SetpointGenerator, synchronize

places = st.floats(-10, 10)
limits = st.builds(Limits, st.floats(0.1, 10), st.floats(0.1, 50))
moves = st.builds(Move, places, places, limits)


@given(
    st.lists(moves, min_size=1, max_size=4), st.sampled_from(["trapezoid", "minimum_jerk"]), st.floats(1, 3)
)
def test_moves_end_together_within_their_limits(found: list[Move], kind: Kind, longer: float) -> None:
    named = {str(number): move for number, move in enumerate(found)}
    shortest = synchronize(named, kind=kind).duration
    made = synchronize(named, kind=kind, duration=shortest * longer)
    assert made.positions(made.duration) == {name: move.goal for name, move in named.items()}
    step = made.duration / 400
    for name, profile in made.profiles.items() if step > 1e-6 else ():
        course = [profile.position(number * step) for number in range(401)]
        speeds = [(b - a) / step for a, b in pairwise([course[0], *course, course[-1]])]
        gains = [(b - a) / step for a, b in pairwise(speeds)]
        most = named[name].limits
        assert max(map(abs, speeds)) <= most.velocity * 1.001 + 1e-6
        assert max(map(abs, gains)) <= most.acceleration * 1.01 + 1e-6 / step


def test_a_duration_that_is_too_short_names_the_axis() -> None:
    with pytest.raises(RequestError, match="too short") as caught:
        synchronize({"pan": Move(0, 1, Limits(1, 1)), "tilt": Move(0, 0.1, Limits(1, 1))}, duration=0.5)
    assert "pan" in caught.value.cause


@given(limits, st.lists(places, min_size=1, max_size=8))
def test_the_generator_follows_any_targets_within_its_limits(most: Limits, targets: list[float]) -> None:
    generator = SetpointGenerator(0.0, most)
    course = [0.0]
    for target in targets:
        course += [generator.step(0.01, target) for _ in range(20)]
    speeds = [(b - a) / 0.01 for a, b in pairwise(course)]
    assert max(map(abs, speeds)) <= most.velocity * 1.001 + 1e-6
    assert all(abs(b - a) <= most.acceleration * 0.0101 + 1e-6 for a, b in pairwise([0.0, *speeds]))
    end = generator.brake()
    assert generator.step(1000.0, end) == end
    assert generator.arrived
