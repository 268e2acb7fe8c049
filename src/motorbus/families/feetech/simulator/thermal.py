"""How warm a servo gets: one body that is heated by the square of its current and cools towards its surroundings.

Of a 12 V STS3215 a user reports +15 °C after 10 minutes with 1.5 kg on a lever of 10 cm, half of its stall torque of
30 kg·cm (SO-ARM100#134). One figure cannot tell two constants: that it needs 15 minutes for 63 % of the way is
assumed, and then a motor that gave its stall torque for ever would end 123 °C above its surroundings. What turning
without load costs is left out: it would be a fraction of a degree.
"""

from __future__ import annotations

from math import exp, inf, log
from typing import Final

RISE: Final = 123.3
"""°C above the surroundings in the end, at stall torque for ever: 15 = RISE * 0.5² * (1 - exp(-600 / LAG))."""
LAG: Final = 900.0
"""s for 63 % of the way to where it ends. Assumed."""


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
