"""What is fixed in every time that is taken, and the clock: the two things that runs of a known time tell.

From the answer to a start until the notice there is what the project takes, less the time after which the start was
answered. Two controls that differ in their pause alone give the rate of the controller's clock, and then that rest.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.steps import Sleep
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.characterising.experiments import Seen, Trial
from motorbus.families.stepper.driver.characterising.findings import Case
from motorbus.families.stepper.driver.characterising.listening import Heard, listened, write
from motorbus.families.stepper.driver.characterising.trials import controls
from motorbus.families.stepper.driver.exchanges import timed
from motorbus.families.stepper.driver.reading import dump_once, read_input

MARGIN: Final = 1.0
"""s that are waited beyond the latest moment at which any reading says anything: commands may leave late, for a bus may
have something to ask first.
"""
STEADY: Final = 0.03
"""s by which two runs of the same, or two answers, may differ."""
QUESTION: Final = 0.35
"""s that a bus may take to read a project, when it makes sure that the next answer is no old one."""
CLOCK: Final = 0.1
"""Part by which the clock of a controller may be off."""


class Timing(NamedTuple):
    """s that every run takes besides, s here for one of the controller, and s until a command is answered.

    `turnaround` is the part of the last that is not spent on the wire.
    """

    offset: float
    clock: float
    latency: float
    turnaround: float

    def seen(self, heard: Heard) -> tuple[tuple[float, ...], Seen]:
        """When the commands were heard, and what came of them, in s of the controller since the start was."""
        begin = _answer(heard)
        at = tuple(
            (sent - heard.sent[0] if came is None else came - begin) / self.clock
            for sent, came in zip(heard.sent, heard.answered, strict=True)
        )
        ends = tuple((end - begin - self.offset) / self.clock for end in heard.notices)
        return at, Seen(tuple(came is not None for came in heard.answered), ends)


async def controlled(case: Case) -> Timing | None:
    """Run both controls; None, and a doubt, when they do not agree with themselves and each other."""
    took: list[tuple[float, float]] = []
    latency = float("inf")
    for trial in controls(case.motor, case.scratch):
        await write(case.node, trial.project)
        known = trial.longest({})
        times = []
        for _ in range(2):
            heard = await once(case, trial, known * (1 + CLOCK) + MARGIN, 1, latency)
            if heard is None or len(heard.notices) != 1:
                case.found.doubt("a project of known time was not seen to begin and to end")
                return None
            times.append(heard.notices[0] - _answer(heard))
            latency = min(latency, _answer(heard) - heard.sent[0])
        if abs(times[0] - times[1]) > STEADY:
            case.found.doubt("a project of known time took another time when it was run again")
            return None
        took.append((known, sum(times) / 2))
    return await _timing(case, took, latency)


async def _timing(case: Case, took: list[tuple[float, float]], latency: float) -> Timing | None:
    (short, first), (long, second) = took
    clock = (second - first) / (long - short)
    if abs(clock - 1) > CLOCK:
        case.found.doubt(f"a pause of 1 s takes {clock:.2f} s")
        return None
    turnaround = await _turnaround(case)
    found = Timing(first - clock * short, clock, latency, turnaround)
    measured = {"overhead": found.offset, "turnaround": turnaround, "clock": clock}
    case.found.measured.update({name: round(value, 5) for name, value in measured.items()})
    if "read_view" not in case.found.known:
        why = "a project that was edited reads as before, and runs as edited"
        case.found.settle("read_view", "stored", why)
    return found


async def _turnaround(case: Case) -> float:
    """s that it thinks: a short answer and a long one tell what a byte takes, and with that what is no byte."""
    await read_input(case.node, 1)
    begin = await Sleep(0.0)
    short = await timed(read_input(case.node, 1)) - begin
    begin = await Sleep(0.0)
    whole = await timed(dump_once(case.node, case.scratch)) - begin
    byte = max(0.0, whole - short) / (wire.DUMP_LENGTH - wire.REPLY_LENGTH)
    return max(0.0, short - byte * (wire.REQUEST_LENGTH + wire.REPLY_LENGTH))


async def once(case: Case, trial: Trial, seconds: float, wanted: int, latency: float) -> Heard | None:
    """Carry it out once, `latency` being how soon its commands should be answered; None, and a doubt, when they were
    not, or when a notice came that cannot be of this run.
    """
    heard = await listened(case.node, case.watch, trial.project, trial.acts, seconds, wanted)
    if heard.answered[0] is None:
        case.found.doubt("a start was not acknowledged")
    elif _is_late(trial, heard, latency):
        case.found.doubt("an acknowledgement came late")
    elif any(end < heard.answered[0] - STEADY for end in heard.notices):
        case.found.doubt("a notice came before the project was started")
    else:
        return heard
    return None


def _is_late(trial: Trial, heard: Heard, latency: float) -> bool:
    """Whether a command left or was answered late; behind a stop a bus may have a question first."""
    behind = [False, *(act.command.startswith("stop") for act in trial.acts)]
    for act, sent, came, asks in zip(trial.acts, heard.sent, heard.answered, behind, strict=False):
        if sent - heard.sent[0] > act.at + STEADY + QUESTION:
            return True
        if came is not None and came - sent > latency + STEADY + QUESTION * asks:
            return True
    return False


def _answer(heard: Heard) -> float:
    begin = heard.answered[0]
    assert begin is not None, "a run that was not acknowledged is none"
    return begin
