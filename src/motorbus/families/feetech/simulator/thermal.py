"""How warm a servo gets: one body that is heated by the square of its current and cools towards its surroundings.

Of a 12 V STS3215 a user reports +15 °C after 10 minutes with 1.5 kg on a lever of 10 cm, half of its stall torque of
30 kg·cm, and of the same torque held at rest that it was at 48 °C after 10 minutes and stayed there for more than an
hour (SO-ARM100#134). So after 10 minutes it is about where it ends; that 95 % of the way are behind it then is assumed,
and makes 63 °C above its surroundings for a motor that gave its stall torque for ever. Moving to and fro for two hours
brought it to 71 °C in that report; what turning costs is left out here, and so is a second, slower body.
"""

from __future__ import annotations

from math import exp, inf, log
from typing import Final

RISE: Final = 63.15
"""°C above the surroundings in the end, at stall torque for ever: 15 = RISE * 0.5² * (1 - exp(-600 / LAG))."""
LAG: Final = 200.0
"""s for 63 % of the way to where it ends; 600 s are 95 %. Assumed so far."""


def end(ambient: float, torque: float) -> float:
    """Where the temperature ends (°C) when it gives this share of the stall torque for ever."""
    return ambient + RISE * torque * torque


def after(elapsed: float, degrees: float, end: float) -> float:
    """The temperature (°C) after so many seconds on the way from `degrees` to `end`."""
    return end + (degrees - end) * exp(-elapsed / LAG)


def until(limit: float, degrees: float, end: float) -> float:
    """Seconds until it is at `limit` on the way from `degrees` to `end`; infinity when it never is."""
    if degrees == limit:
        return 0.0
    if (limit - degrees) * (end - limit) <= 0:
        return inf
    return LAG * log((degrees - end) / (limit - end))
