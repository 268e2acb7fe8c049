"""The low pass, judged by what it does to waves, steps and mirrors, not by how it is worked out."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, sin, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.motion.trajectory.smoothing import smooth

steps = st.lists(st.tuples(st.floats(0.001, 1), st.floats(-100, 100)), min_size=2, max_size=60)
cutoffs = st.floats(0.01, 100)


def grid(count: int, rate: float = 200.0) -> list[float]:
    return [number / rate for number in range(count)]


def unrolled(samples: list[tuple[float, float]]) -> tuple[list[float], list[float]]:
    at, times = 0.0, []
    for gap, _ in samples:
        times.append(at)
        at += gap
    return times, [place for _, place in samples]


@pytest.mark.parametrize(("share", "power"), [(0.05, 0.9981), (1.0, 0.5), (4.0, 0.0038)])
def test_a_wave_keeps_its_phase_and_loses_what_it_must(share: float, power: float) -> None:
    """Amplitude and phase by correlation with sine and cosine over whole waves, far from the ends."""
    cutoff = 2.0
    wave = 2 * pi * cutoff * share
    times = grid(20_001)
    places = smooth(times, [sin(wave * at) for at in times], cutoff)
    inner = range(4_000, 16_000)  # 60 s: a whole number of waves of each of the three
    in_phase = 2 / len(inner) * sum(places[n] * sin(wave * times[n]) for n in inner)
    shifted = 2 / len(inner) * sum(places[n] * cos(wave * times[n]) for n in inner)
    assert in_phase == pytest.approx(sqrt(power), rel=1e-2)
    assert abs(shifted) < 1e-6


def test_power_at_the_cutoff_does_not_hang_on_when_samples_were_taken() -> None:
    wave = 2 * pi * 2.0
    times = [number / 400 + (number % 3) * 0.0006 for number in range(16_001)]
    places = smooth(times, [sin(wave * at) for at in times], 2.0)
    assert max(places[4_000:12_000]) == pytest.approx(sqrt(0.5), rel=5e-3)


@given(steps, cutoffs)
def test_it_stays_in_range_and_keeps_the_mean(samples: list[tuple[float, float]], cutoff: float) -> None:
    times, places = unrolled(samples)
    smoothed = smooth(times, places, cutoff)
    assert len(smoothed) == len(places)
    assert min(places) <= min(smoothed) <= max(smoothed) <= max(places)

    def area(values: list[float]) -> float:
        stretches = zip(pairwise(times), pairwise(values), strict=True)
        return sum((end - begin) * (one + two) / 2 for (begin, end), (one, two) in stretches)

    assert area(smoothed) == pytest.approx(area(places), rel=1e-6, abs=1e-6 * times[-1] * 100)


@given(steps, cutoffs)
def test_backwards_it_does_the_same(samples: list[tuple[float, float]], cutoff: float) -> None:
    times, places = unrolled(samples)
    back = [times[-1] - at for at in reversed(times)]
    forth = smooth(times, places, cutoff)
    assert smooth(back, places[::-1], cutoff)[::-1] == pytest.approx(forth, rel=1e-6, abs=1e-6)


@given(st.floats(-100, 100), st.integers(2, 50), cutoffs)
def test_what_stands_still_stays(place: float, count: int, cutoff: float) -> None:
    assert smooth(grid(count), [place] * count, cutoff) == [place] * count


def test_it_begins_and_ends_at_rest() -> None:
    times = grid(2_001)
    places = smooth(times, list(times), 1.0)  # a ramp, from the first moment on
    rates = [(after - before) * 200 for before, after in pairwise(places)]
    assert max(abs(rates[0]), abs(rates[-1])) < 0.02
    assert max(rates) == pytest.approx(1.0, abs=1e-3)


def test_the_steps_of_a_sensor_lose_their_acceleration() -> None:
    times = grid(801)
    true = [1 - cos(pi * at / 4) for at in times]
    seen = [round(place / 0.001534) * 0.001534 for place in true]  # 4096 steps for a turn

    def hardest(values: list[float]) -> float:
        triples = zip(values[:-2], values[1:-1], values[2:], strict=True)
        return max(abs(first - 2 * second + third) for first, second, third in triples) * 200**2

    smoothed = smooth(times, seen, 4.0)
    assert hardest(seen) > 50
    assert hardest(smoothed) < 2
    assert max(abs(one - two) for one, two in zip(smoothed, true, strict=True)) < 0.01
