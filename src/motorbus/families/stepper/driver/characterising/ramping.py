"""Timing the ramp: how long moves take whose acceleration is small enough to be seen, and which reading that fits.

Nobody knows how steep a ramp is until one has been timed. So the acceleration goes down from the highest by factors of
four, until the moves take clearly longer than without a ramp; then they are timed at several speeds and from several
start frequencies. In one reading the ramp takes the longer the higher the speed, in the other hardly so.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from motorbus.families.stepper import execution
from motorbus.families.stepper.driver.characterising.experiments import Act, Trial
from motorbus.families.stepper.driver.characterising.findings import Case
from motorbus.families.stepper.driver.characterising.listening import write
from motorbus.families.stepper.driver.characterising.timing import STEADY, Timing, once
from motorbus.families.stepper.driver.characterising.trials import ramp, ramp_speeds
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import Fit, Run, fit
from motorbus.families.stepper.program.plan import seconds_of
from motorbus.families.stepper.table import Project

ACCELERATIONS: Final = (65535, 16384, 4096, 1024, 256, 64, 16, 4, 1)
ENOUGH: Final = 0.4
"""s that a ramp adds to the moves before it is looked at closely."""
LITTLE: Final = 0.1
"""The same with the least acceleration there is."""
LONGEST: Final = 30.0
"""s that the slowest ramp is waited for."""
PRECISE: Final = 0.05
"""Part to which a tick is known."""
_FIT: Final = 0.01
"""s by which the runs may differ from the reading that fits."""
_SEEN: Final = 0.002
"""s by which they must fit worse with a tick that is off by `PRECISE`."""
_FROM: Final = 0.05
"""Part of the running frequency that a ramp begins at."""
_NAMES: Final = ("ramp", "ramp_tick_ms")


async def ramped(case: Case, timing: Timing) -> None:
    """Find the acceleration to use, time the moves, and see which reading fits."""
    acceleration = await _steepness(case, timing)
    if not acceleration:
        return None
    top, *slower = ramp_speeds(case.motor)
    ways = [(top, _FROM), (top, 0.5), (top, 0.25), *((rpm, _FROM) for rpm in slower)]
    runs: list[Run] = []
    for rpm, part in ways:
        project = ramp(case.motor, case.scratch, case.travel, rpm, acceleration, part)
        await write(case.node, project)
        first = await _timed(case, timing, project)
        again = await _timed(case, timing, project)
        if first is None or again is None or abs(first - again) > STEADY:
            case.found.doubt("a move took another time when it was made again")
            return _leave(case, "a move did not take the same time twice")
        runs.append(Run(project, (first + again) / 2))
    _say(case, runs, acceleration)
    return None


async def _steepness(case: Case, timing: Timing) -> int:
    """An acceleration whose ramp can be timed; 0 when there is none, or no time."""
    top = ramp_speeds(case.motor)[0]
    for acceleration in ACCELERATIONS:
        project = ramp(case.motor, case.scratch, case.travel, top, acceleration, _FROM)
        await write(case.node, project)
        seconds = await _timed(case, timing, project)
        if seconds is None:
            _leave(case, "a move with a ramp was not seen to begin and to end")
            return 0
        if seconds - _steady(project) >= (ENOUGH if acceleration > 1 else LITTLE):
            return acceleration
    _leave(case, "with the least acceleration there is the ramp takes too little to be timed")
    return 0


async def _timed(case: Case, timing: Timing, project: Project) -> float | None:
    trial = Trial("ramp", "", (), (), project, (Act(0.0, "start_project"),))
    heard = await once(case, trial, LONGEST, 1, timing.latency)
    if heard is None or not heard.notices:
        case.found.doubt("a move with a ramp was not seen to begin and to end")
        return None
    _, seen = timing.seen(heard)
    return max(seen.ends[0], 1e-3)


def _steady(project: Project) -> float:
    """s that it would take without ramps."""
    return sum(
        float(execution.exact_pulses(project, step)) / execution.frequency(project, step) + step.delay / 1000
        for step in project.steps[: project.total_steps]
    )


def _say(case: Case, runs: list[Run], acceleration: int) -> None:
    best, other = fit(runs)
    what = f"{len(runs)} sorts of moves with {acceleration} Hz"
    close, far = best.off * 1000, other.off * 1000
    why = f"{what} took what this reading says but for {close:.1f} ms; the other is {far:.0f} ms off"
    if best.off > _FIT or abs(best.overhead) > STEADY or other.off < 3 * best.off + _FIT:
        return _leave(
            case, f"{what} fit neither reading, by {best.off * 1000:.1f} and {other.off * 1000:.1f} ms"
        )
    if best.how.ramp == "pulse":
        case.found.settle("ramp", "pulse", why)
        return case.found.leave("ramp_tick_ms", "the frequency grows with every pulse, so there is no tick")
    case.found.settle("ramp", "time", why)
    if not _is_precise(runs, best):
        return case.found.leave("ramp_tick_ms", "a tick that is 5 % longer or shorter would fit as well")
    case.found.measured["tick_ms"] = round(best.tick_ms, 6)
    return case.found.settle("ramp_tick_ms", round(best.tick_ms, 6), why)


def _is_precise(runs: list[Run], best: Fit) -> bool:
    ticks = (best.tick_ms * (1 + PRECISE), best.tick_ms / (1 + PRECISE))
    return all(_off(runs, replace(best.how, ramp_tick_ms=tick)) > best.off + _SEEN for tick in ticks)


def _off(runs: list[Run], how: Behaviour) -> float:
    """s by which the runs differ from this reading, whatever they take besides."""
    left = [run.seconds - seconds_of(run.project, how) for run in runs]
    mean = sum(left) / len(left)
    return float((sum((one - mean) ** 2 for one in left) / len(left)) ** 0.5)


def _leave(case: Case, why: str) -> None:
    for name in _NAMES:
        case.found.leave(name, why)
