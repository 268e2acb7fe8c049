"""The same motion by hand, in exact arithmetic and pulse by pulse; it shares no line with the product.

Times are Decimals of 40 digits where a square root comes in, and fractions elsewhere. Slow on purpose.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any


def pulses_of(distance: int, turn_distance: int, microsteps: int, step_angle: int) -> int:
    """Pulses, cut off."""
    return distance * 36000 * microsteps // (step_angle * turn_distance)


def running(speed: int, microsteps: int, step_angle: int) -> Fraction:
    """Hz at the running speed."""
    return Fraction(speed * 36000 * microsteps, 60 * step_angle)


def decimal(number: Fraction | int) -> Decimal:
    """An exact number with 40 digits."""
    return Decimal(number.numerator) / Decimal(number.denominator)


def straight_time(pulses: int, start: int, rate: Fraction, run: Fraction) -> Decimal:
    """A move whose frequency grows by `rate` Hz in a second."""
    with localcontext(prec=40):
        first = Fraction(max(start, 1))
        if not pulses or not run:
            return Decimal(0)
        if run <= first or not rate:
            return decimal(pulses / run)
        ramp = (run**2 - first**2) / (2 * rate)
        if 2 * ramp <= pulses:
            return decimal(2 * (run - first) / rate + (pulses - 2 * ramp) / run)
        peak = (decimal(first**2) + decimal(rate * pulses)).sqrt()
        return 2 * (peak - decimal(first)) / decimal(rate)


def order_of(total: int, first: int, last: int, count: int) -> list[int]:
    """The steps of one pass, written out."""
    plain = list(range(1, total + 1))
    if not (1 <= first <= last <= total and count >= 1):
        return plain
    return plain[: first - 1] + plain[first - 1 : last] * count + plain[last:]


def time_of(project: dict[str, Any]) -> Decimal:
    """How long a project takes when every input it waits for is there: all steps of all passes, added up."""
    with localcontext(prec=40):
        total = Decimal(0)
        steps = project["steps"]
        times: dict[int, Decimal] = {}
        for number, step in enumerate(steps, start=1):
            geometry = project["microsteps"], project["step_angle"]
            pulses = pulses_of(step["distance"], project["turn_distance"], *geometry)
            run = running(step["speed"], *geometry)
            rate = Fraction(step["acceleration"] * 1000)
            move = straight_time(pulses, step["start_frequency"], rate, run)
            times[number] = move + Decimal(step["delay"]) / 1000
        for number in order_of(len(steps), *project["loop"]):
            total += times[number]
        return total * Decimal(max(1, int(project["project_loop"])))
