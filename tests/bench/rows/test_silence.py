"""A silent servo is timed against the deadline of its request."""

from __future__ import annotations

import os

import pytest

from bench.rows import silence


def test_a_silent_servo_is_judged_by_the_median_and_the_latest_is_told() -> None:
    found = {
        "motorbus": [{"processor": 2e-4, "late": [1e-4, 3e-4, 9e-3]}],
        "rustypot": [{"processor": 1e-4, "late": [0.0]}],
        "feetech-servo-sdk": [{"processor": 0.033, "late": [0.0]}],
    }
    needed, late = silence.judged(found)
    assert needed.note == "feetech-servo-sdk 33000 µs"
    assert needed.value == pytest.approx(2.0)
    assert late.note == "the latest of all 9.00 ms"
    assert late.value == pytest.approx(0.3)
    del found["rustypot"]
    assert [row.unit for row in silence.judged(found)] == ["ms"]


def test_a_time_out_is_timed_against_its_deadline() -> None:
    asked: list[int] = []
    said = silence.timed(lambda: asked.append(os.getpid()), 5, 1000.0)
    assert len(asked) == 5 + silence.WARM_UP
    assert all(-1000 < late < -999 for late in said["late"])
    assert said["processor"] >= 0
