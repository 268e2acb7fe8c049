"""What a forecast costs: a program of ten steps for the stepper controller is estimated, in this process.

    python -m bench.estimates

It is to take less than 50 ms (without drawing). The second program is the longest that ten steps can be, reckoned with
carried pulses, where each of its 645 160 executions is its own. Reading the file is not part of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple

from bench.figures import Spread, spread
from bench.places import ROOT
from motorbus.families.stepper import Behaviour, Program

LIMIT = 0.050
"""s for a ten-step program as it is usually read."""
EXAMPLE = ROOT / "examples" / "pick_and_place.toml"


class Forecast(NamedTuple):
    """A program, how its open questions are read, and what it is called here."""

    name: str
    program: Program
    how: Behaviour


class Cost(NamedTuple):
    """Seconds that estimating takes."""

    name: str
    seconds: Spread


def longest() -> Program:
    """Ten steps of uneven distances, 254 times in each of 254 passes."""
    steps = "".join(
        f'[[step]]\nmove = "{"-" if number % 3 else ""}{997 * number} units"\nspeed = "300 rpm"\nstart = "100 Hz"\n'
        f'acceleration = "{number} Hz"\ndelay = "{number} ms"\n'
        for number in range(1, 11)
    )
    return Program.parse(
        "format = 1\nproject = 2\nrepeat = 254\n[loop]\nfirst = 1\nlast = 10\ncount = 254\n"
        f'[motor]\nmicrosteps = 16\nstep_angle = "0.9 deg"\nturn_distance = 4999\n{steps}'
    )


def forecasts() -> tuple[Forecast, ...]:
    """What is measured."""
    return (
        Forecast("pick_and_place.toml", Program.load(str(EXAMPLE)), Behaviour()),
        Forecast("the same, ramp=pulse", Program.load(str(EXAMPLE)), Behaviour(ramp="pulse")),
        Forecast("the longest of all, rounding=carry", longest(), Behaviour(rounding="carry")),
    )


def costs(times: int, progress: Callable[[str], None]) -> list[Cost]:
    """Each of them so many times. Raises ValueError when one was estimated as nothing."""
    found = []
    for name, program, how in forecasts():
        progress(f"estimates: {name}")
        found.append(Cost(name, spread(_seconds(program, how) for _ in range(times))))
    return found


def _seconds(program: Program, how: Behaviour) -> float:
    began = perf_counter()
    estimate = program.estimate(how)
    lasted = perf_counter() - began
    if not estimate.seconds > 0:
        raise ValueError(f"{program.name}: {estimate}")
    return lasted


def verdict(found: Sequence[Cost]) -> str:
    """Whether the first of them is below the limit, in words."""
    milliseconds = found[0].seconds.median * 1e3
    reached = "reached" if milliseconds < LIMIT * 1e3 else "MISSED"
    return f"A program of ten steps is estimated in {milliseconds:.2f} ms. Less than {LIMIT * 1e3:g} ms: {reached}."


def rows(found: Sequence[Cost]) -> list[tuple[str, str, str]]:
    """As one reads it: what, median in ms, and between which."""
    return [
        (name, f"{seconds.median * 1e3:.2f}", f"{seconds.low * 1e3:.2f} – {seconds.high * 1e3:.2f}")
        for name, seconds in found
    ]


if __name__ == "__main__":
    measured = costs(21, print)
    for row in rows(measured):
        print("  ".join(row))
    print(verdict(measured))
