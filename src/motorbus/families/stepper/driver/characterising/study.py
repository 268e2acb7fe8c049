"""The course of a characterisation: which experiment after which, and what each adds to what is known.

First what dumps tell by themselves, then runs of a known time, which say what is fixed in each time. Only where these
agree is there any ground for the rest. Whatever goes wrong on the line is a doubt, and with a doubt nothing is believed
that rests on silence.
"""

from __future__ import annotations

from typing import Final, NamedTuple, TypeVar

from motorbus.core.steps import Emit, Procedure
from motorbus.errors import NoReply, WireError
from motorbus.families.stepper.driver.characterising import views
from motorbus.families.stepper.driver.characterising.experiments import Seen, Trial, Verdict, judged
from motorbus.families.stepper.driver.characterising.findings import UNTRIED, Case
from motorbus.families.stepper.driver.characterising.listening import write
from motorbus.families.stepper.driver.characterising.ramping import ramped
from motorbus.families.stepper.driver.characterising.timing import MARGIN, Timing, controlled, once
from motorbus.families.stepper.driver.characterising.trials import RAMP_SECONDS, RAMP_STEPS, controls, trials
from motorbus.families.stepper.program.profile import KNOWN, Profile

T = TypeVar("T")

REPETITIONS: Final = 2
IN_SILENCE: Final = 3
"""How often an experiment is done whose answer rests on something that did not come."""


class Experiment(NamedTuple):
    """An event, and an entry of the plan: this is about to be tried.

    `settles` are the questions it asks, `turns` how far the motor turns each way in one run, `seconds` how long one run
    takes; what has to be written before comes on top.
    """

    name: str
    what: str
    settles: tuple[str, ...]
    turns: float = 0.0
    seconds: float = 0.0

    @classmethod
    def of(cls, trial: Trial) -> Experiment:
        """What a trial is, told."""
        return cls(trial.name, trial.what, trial.settles, trial.turns, trial.longest({}))


VIEWS: Final = Experiment(
    "edits", "what is edited, and read again", ("read_view", "dump_order", "flags_scope")
)
RAMP: Final = ("ramp", "ramp_tick_ms")
SELECTION: Final = Experiment("selection", "another project selected, and read", ("select",))


def ramp_experiment(travel: float) -> Experiment:
    """The one that times the ramp; `travel` is how many turns it may take."""
    what = "two moves forward and two back, at several speeds and accelerations"
    return Experiment("ramp", what, RAMP, travel, 2 * RAMP_SECONDS * RAMP_STEPS)


async def studied(case: Case) -> Profile:
    """All experiments, one after the other. One that a bad line spoils is given up, and the next is begun."""
    await Emit(VIEWS)
    await views.view(case)
    await _spared(case, ("flags_scope",), views.flags(case))
    for trial in controls(case.motor, case.scratch):
        await Emit(Experiment.of(trial))
    timing = await _spared(case, (), controlled(case))
    if timing is None:
        for name in KNOWN:
            if name not in UNTRIED:
                case.found.leave(name, f"no time could be taken on this line: {case.found.doubts[0]}")
        return case.found.profile()
    await Emit(SELECTION)
    await _spared(case, SELECTION.settles, _selected(case, timing))
    for trial in trials(case.motor, case.scratch, _without_steps(case)):
        await _spared(case, trial.settles, _tried(case, timing, trial))
    await Emit(ramp_experiment(case.travel))
    await _spared(case, RAMP, ramped(case, timing))
    return case.found.profile()


async def _spared(case: Case, names: tuple[str, ...], operation: Procedure[T]) -> T | None:
    """Carry it out; a line that does not answer it leaves these questions open, and is a doubt."""
    try:
        return await operation
    except (NoReply, WireError) as error:
        case.found.doubt(f"an experiment failed: {error.summary}")
        for name in names:
            case.found.leave(name, f"its experiment failed: {error.summary}")
    return None


async def _selected(case: Case, timing: Timing) -> None:
    if case.seen:
        _, last = controls(case.motor, case.scratch)
        await views.select(case, last.project)
    else:
        await views.select_unseen(case, timing.offset, timing.clock)


def _without_steps(case: Case) -> int | None:
    """A project that has no steps and is not lent."""
    empty = [number for number, image in case.stored.items() if number != case.scratch and not image[1]]
    return empty[0] if empty else None


async def _tried(case: Case, timing: Timing, trial: Trial) -> None:
    found = case.found
    if all(name in found.known for name in trial.settles):
        return None
    missing = [name for name, value in trial.needs if found.known.get(name) != value]
    if missing:
        return _leave(case, trial, f"it is tried only where {missing[0]} is {dict(trial.needs)[missing[0]]}")
    await Emit(Experiment.of(trial))
    if trial.project.total_steps:
        await write(case.node, trial.project)
    verdict = await _repeated(case, timing, trial)
    if verdict is None:
        return _leave(case, trial, f"on this line {found.doubts[-1]}")
    if not verdict.fits:
        found.doubt(f"the experiment {trial.name!r} did what no reading does")
    for name in trial.settles:
        if name in verdict.answers:
            why = f"{trial.what}; {verdict.why}"
            found.settle(name, verdict.answers[name], why, silent=verdict.silent)
        else:
            found.leave(name, f"{trial.what}; {verdict.why}")
    return None


def _leave(case: Case, trial: Trial, why: str) -> None:
    for name in trial.settles:
        case.found.leave(name, why)


async def _repeated(case: Case, timing: Timing, trial: Trial) -> Verdict | None:
    """Twice, or three times where the answer rests on silence; None when one of them was not acknowledged in time."""
    found = case.found
    seconds, most = trial.longest(found.known) * timing.clock + MARGIN, trial.most(found.known)
    seen: list[tuple[tuple[float, ...], Seen]] = []
    verdict: Verdict | None = None
    while len(seen) < REPETITIONS or (verdict and verdict.silent and verdict.fits and len(seen) < IN_SILENCE):
        heard = await once(case, trial, seconds, most, timing.latency)
        if heard is None:
            return None
        seen.append(timing.seen(heard))
        if len(seen) >= REPETITIONS:
            verdict = _judged(case, timing, trial, seen)
    return verdict


def _judged(case: Case, timing: Timing, trial: Trial, seen: list[tuple[tuple[float, ...], Seen]]) -> Verdict:
    """What they say; it rests on silence also where it needs an answer that does."""
    found = case.found
    verdict = judged(trial, found.known, seen, timing.turnaround)
    if set(trial.depends) <= found.firm.keys():
        return verdict
    firm = judged(trial, found.firm, seen, timing.turnaround)
    return verdict._replace(silent=verdict.silent or firm.answers != verdict.answers)
