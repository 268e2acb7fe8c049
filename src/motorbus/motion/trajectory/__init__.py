"""Movements of several axes over time: through waypoints, from a file, or taught by hand.

    route = interpolated([Waypoint({"lift": 0.0}), Waypoint({"lift": 1.0}, at=2.0)])
    plan = sampled(route, 200)                    # what a loop of 200 Hz sends
    check(plan, machine.axes)                     # raises LimitExceeded for the first sample that goes too far
    taught = Trajectory.load("wave.csv", machine.axes).smoothed(5.0)

Time is in s from the beginning, positions are in rad (m on a linear axis). There is no blending: a waypoint is passed
exactly, at its time.
"""

from __future__ import annotations

from motorbus.motion.trajectory.limits import Violation, check, first_violation
from motorbus.motion.trajectory.samples import Course, Trajectory, sampled
from motorbus.motion.trajectory.waypoints import Interpolation, Route, Waypoint, interpolated

__all__ = [
    "Course",
    "Interpolation",
    "Route",
    "Trajectory",
    "Violation",
    "Waypoint",
    "check",
    "first_violation",
    "interpolated",
    "sampled",
]
