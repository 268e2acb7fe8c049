"""Each stretch of a move against the same thing added up pulse by pulse."""

from __future__ import annotations

from fractions import Fraction
from math import inf, log

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.families.stepper.execution.pieces import Piece, Stair, Steady, Straight, digamma, periods, whole

EULER = 0.5772156649015329


@pytest.mark.parametrize(
    ("x", "value"),
    [(1.0, -EULER), (2.0, 1 - EULER), (0.5, -EULER - 2 * log(2)), (10.0, 2.251752589066721)],
)
def test_digamma_is_what_is_known_of_it(x: float, value: float) -> None:
    assert digamma(x) == pytest.approx(value, rel=1e-14)


@given(st.floats(1e-3, 1e6))
def test_digamma_grows_by_one_part_of_x(x: float) -> None:
    assert digamma(x + 1) - digamma(x) == pytest.approx(1 / x, rel=1e-7, abs=1e-14)


@given(st.integers(1, 65535), st.integers(0, 65535), st.integers(0, 400))
def test_ever_shorter_periods_are_added_up(start: int, rise: int, count: int) -> None:
    exact = sum((Fraction(1, start + rise * i) for i in range(count)), Fraction(0))
    assert periods(start, rise, count) == pytest.approx(float(exact), rel=1e-9, abs=1e-15)


PIECES: list[Piece] = [
    Steady(1000.0, 0.5),
    Straight(50.0, 30_000.0, 0.08),
    Straight(2450.0, -30_000.0, 0.08),
    Stair(50.0, 30.0, 88),
    Stair(50.0, 30.0, 88, falling=True),
    Stair(200.0, 0.5, 1000),
]


@pytest.mark.parametrize("piece", PIECES, ids=repr)
def test_pulses_only_grow_and_end_where_they_should(piece: Piece) -> None:
    moments = [piece.duration * n / 500 for n in range(501)]
    counts = [piece.done(at) for at in moments]
    assert counts[0] == 0
    assert counts == sorted(counts)
    assert counts[-1] == pytest.approx(piece.pulses)


@pytest.mark.parametrize("piece", PIECES, ids=repr)
def test_the_frequency_is_how_fast_pulses_come(piece: Piece) -> None:
    width = piece.duration / 10
    for n in range(9):
        came = piece.done((n + 1) * width) - piece.done(n * width)
        ends = piece.frequency(n * width), piece.frequency((n + 1) * width)
        assert min(ends) * width - 1.01 <= came <= max(ends) * width + 1.01


def test_a_falling_stair_is_a_rising_one_backwards() -> None:
    up, down = Stair(50.0, 30.0, 88), Stair(50.0, 30.0, 88, falling=True)
    assert up.duration == down.duration
    assert [up.frequency(up.moment(n)) for n in range(88)] == [50.0 + 30 * n for n in range(88)]
    assert [down.frequency(down.moment(n)) for n in range(88)] == [50.0 + 30 * n for n in reversed(range(88))]
    assert [down.done(down.moment(n)) for n in range(89)] == list(range(89))
    assert [up.done(up.moment(n)) for n in range(89)] == list(range(89))


def test_a_steady_piece_may_have_no_end() -> None:
    assert Steady(10.0, inf).done(3.0) == 30
    assert Steady(10.0, inf).pulses == inf


@pytest.mark.parametrize(("pulses", "out"), [(0.0, 0), (2.9999999999, 3), (2.99, 2), (1e9 - 1e-3, 10**9)])
def test_a_pulse_that_is_due_is_out(pulses: float, out: int) -> None:
    assert whole(pulses) == out
