"""Movements of several axes over time: from a file, or taught by hand.

    wave = Trajectory.load("wave.csv", machine.axes).smoothed(5.0)
    plan = sampled(wave, 200)                     # what a loop of 200 Hz sends
    check(plan, machine.axes)                     # raises LimitExceeded for the first sample that goes too far

Time is in s from the beginning, positions are in rad (m on a linear axis).
"""

from __future__ import annotations

from motorbus.motion.trajectory.limits import Violation, check, first_violation
from motorbus.motion.trajectory.samples import Course, Interpolation, Trajectory, sampled

__all__ = [
    "Course",
    "Interpolation",
    "Trajectory",
    "Violation",
    "check",
    "first_violation",
    "sampled",
]
