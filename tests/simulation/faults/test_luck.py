"""Chance strikes as often as it says, alike with one seed, and every time at a hundred percent."""

from __future__ import annotations

import pytest

from motorbus.simulation.faults import Fault
from motorbus.simulation.faults.luck import Luck, chance


def struck(percent: float, sizes: list[int], seed: int = 1) -> list[tuple[int, int]]:
    luck = Luck(Fault(action="drop", percent=percent, per_byte=True), seed, index=0)
    return [(packet, place) for packet, size in enumerate(sizes) for place in luck.strikes(size)]


@pytest.mark.parametrize(
    ("percent", "low", "high"), [(1.0, 850, 1150), (50.0, 49_000, 51_000), (0.01, 2, 25)]
)
def test_it_strikes_as_often_as_it_says(percent: float, low: int, high: int) -> None:
    assert low <= len(struck(percent, [10] * 10_000)) <= high


def test_however_the_bytes_are_cut_the_same_ones_suffer() -> None:
    whole = [place for _, place in struck(5.0, [1000])]
    assert [100 * packet + place for packet, place in struck(5.0, [100] * 10)] == whole != []
    assert struck(5.0, [1000], seed=2) != struck(5.0, [1000])


def test_at_a_hundred_percent_it_strikes_every_time() -> None:
    assert struck(100.0, [2, 0, 1]) == [(0, 0), (0, 1), (2, 0)]


def test_equal_faults_have_chances_of_their_own() -> None:
    fault = Fault(action="drop", percent=1.0)
    assert chance(fault, 1, 0).random() != chance(fault, 1, 1).random()
    assert chance(fault, 1).random() == chance(fault, 1).random()


@pytest.mark.parametrize("percent", [5e-324, 1e-322, 1e-306, 1e-290])
def test_a_chance_too_small_for_a_number_is_never(percent: float) -> None:
    assert struck(percent, [10**9] * 3) == []
