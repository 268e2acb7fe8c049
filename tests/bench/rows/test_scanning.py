"""A scan that misses a servo is a scan that misses a servo, whatever time it took."""

from __future__ import annotations

import pytest

from bench.row import met
from bench.rows import scanning
from bench.rows.scanning import THERE, misjudged


def test_who_is_there_is_every_twentieth() -> None:
    assert THERE == (20, 40, 60, 80, 100, 120, 140, 160, 180, 200, 220, 240)
    assert misjudged(THERE) == ""


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (THERE[1:], "missed [20], found nobody who is not there"),
        ((*THERE, 241), "missed nobody, found [241] who is not there"),
        ((), f"missed {list(THERE)}, found nobody who is not there"),
    ],
)
def test_what_is_wrong_is_said(found: tuple[int, ...], said: str) -> None:
    assert misjudged(found) == said


def test_one_scan_that_missed_somebody_misses_the_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    results = iter([THERE, THERE[:-1], THERE, THERE, THERE])
    monkeypatch.setattr(scanning, "_run", lambda program: {"seconds": 0.8, "found": list(next(results))})
    time, wrong = scanning.rows(5, lambda text: None)
    assert met(time)
    assert time.value == 0.8
    assert not met(wrong)
    assert wrong.note == "missed [240], found nobody who is not there"
