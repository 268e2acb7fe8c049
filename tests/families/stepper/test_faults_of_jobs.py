"""Whole jobs on a line with every kind of fault: runs, writes, copies, clearing, jogs. What is told of them is so.

A run is completed only if the controller has carried the project out, and whenever its notice came through in time; a
project that is said to be written is stored as it was meant; a project that nobody has named is never touched.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.driver.waiting import Outcome, Ran
from motorbus.families.stepper.program import Program
from motorbus.families.stepper.table import Project, Step, decode_image, with_steps
from tests.conftest import Figures, Rounds
from tests.support.lines import NOTICES, REPLIES, REQUESTS, Mischief
from tests.support.rigs.stepper import UNMOVED, FalseWord, Rig

FAULTS = (*REQUESTS, *(kind for kind in REPLIES if not kind.startswith("notice")), *NOTICES)
"""All but notices out of nothing: one at a moment at which it may be true is undistinguishable from a true one."""
LOTS = ("run", "run", "write", "write", "backup", "clear", "jog", "select")


def short(number: int, delay: int = 20) -> Project:
    """A project of two steps that takes some tenths of a second."""
    step = Step(distance=400, start_frequency=400, acceleration=50, speed=300, delay=delay)
    base = Project(number=number, microsteps=8, step_angle=180, turn_distance=1600)
    return with_steps(base, (step, replace(step, direction=1)))


class Jobs(Rig):
    """One job after the other. Between two of them the line is good, and what may still go on is stopped.

    `untouched` counts jobs that no fault has met, `refused` runs of projects without steps.
    """

    def __init__(self, line: Mischief) -> None:
        super().__init__(line, 21)
        self.mischief = line
        self.share = line.share
        self.refused = 0
        self.outcomes: Counter[Outcome] = Counter()
        self.untouched = 0
        for number in (1, 2, 3):
            self.there.put(number, short(number))

    def tidy(self) -> None:
        """Bring it to rest over a good line, when all that is late has come; what was not saved is lost."""
        self.mischief.share = 0.0
        self.link.advance(2 * self.mischief.late_by)
        self.device.stop()
        self.there.power_cycle()
        self.mischief.share = self.share

    def job(self) -> None:
        """One job drawn by lot, judged; one that no fault touched must succeed."""
        self.tidy()
        name = self.random.choice(LOTS)
        project = self.random.randrange(1, 5) if name == "run" else self.random.randrange(2, 4)
        faults = self.mischief.count
        others = {n: image for n, image in self.there.store.stored.items() if n != project}
        done = {
            "run": self.started,
            "write": self.written,
            "backup": self.copied,
            "clear": self.emptied,
            "jog": self.jogged,
            "select": self.selected,
        }[name](project)
        if self.mischief.count == faults:
            self.untouched += 1
            assert done, f"{name} of project {project} failed without a fault: {self.errors[-1:]}"
        if {n: image for n, image in self.there.store.stored.items() if n != project} != others:
            raise FalseWord(f"{name} of project {project} has touched another one")

    def started(self, project: int) -> bool:
        """Start it and wait. One that was cleared is refused."""
        began, notices = self.link.now(), len(self.mischief.noticed)
        cleared = decode_image(self.there.store.image(project)).is_cleared
        ran = self._judged("run", type(self.device).run.function(self.device, project), 60.0)
        if not isinstance(ran, Ran):
            if self.errors and isinstance(self.errors[-1], RequestError):
                self.refused += 1
                return cleared
            return False
        self.outcomes[ran.outcome] += 1
        ended = [one.at for one in self.there.told if one.kind == "completed" and one.at >= began]
        came = [at for at in self.mischief.noticed[notices:] if at <= self.link.now()]
        if ran.outcome is Outcome.COMPLETED and not ended:
            raise FalseWord(f"project {project} was told to be completed")
        if came and ran.outcome is not Outcome.COMPLETED:
            raise FalseWord(f"the notice of project {project} came and it was told {ran}")
        if cleared:
            raise FalseWord("a project without steps was started")
        return ran.outcome is Outcome.COMPLETED

    def written(self, project: int) -> bool:
        """Write a program that differs in a number or in all."""
        meant = short(project, self.random.randrange(1, 60))
        told = self._judged(
            "write", type(self.device).write_project.function(self.device, Program(project=meant)), 120.0
        )
        held = decode_image(self.there.store.stored[project])
        if told is not None and replace(held, steps=held.steps[:2]) != replace(meant, steps=meant.steps[:2]):
            raise FalseWord(f"project {project} was told to be written: {told}")
        if told is None:
            self.there.put(project, short(project))
        return told is not None

    def copied(self, project: int) -> bool:
        """Copy it."""
        told = self._judged("backup", type(self.device).backup.function(self.device, (project,)), 30.0)
        if told is not None and told.image(project) != self.there.store.image(project):
            raise FalseWord(f"the copy of project {project} is not what it holds")
        return told is not None

    def emptied(self, project: int) -> bool:
        """Clear it; what it had is put back over a good line."""
        told = self._judged("clear", type(self.device).clear.function(self.device, project), 60.0)
        if told is not None and any(self.there.store.stored[project]):
            raise FalseWord(f"project {project} was told to be cleared")
        self.there.put(project, short(project))
        return told is not None

    def jogged(self, project: int) -> bool:
        """Turn a little, which borrows project 1 and gives it back."""
        before = self.there.store.image(1)
        told = self._judged("jog", type(self.device).jog.function(self.device, 6.283185, 0.2), 120.0)
        if told is not None and self.there.store.image(1) != before:
            raise FalseWord("a jog has left project 1 another one")
        if told is not None and self.there.state.phase not in UNMOVED:
            raise FalseWord(f"a jog has ended and it is {self.there.state.phase.value}")
        return told is not None

    def selected(self, project: int) -> bool:
        """Select it without damage. A controller that loses its supply after that tells nobody."""
        before, cuts = self.there.store.stored[project], self.mischief.fired["cut"]
        told = self._judged("select", type(self.device).select.function(self.device, project), 60.0)
        whole = self.mischief.fired["cut"] == cuts
        if told is not None and whole and self.there.store.selected != project:
            raise FalseWord(f"project {project} was told to be selected")
        if self.there.store.stored[project] != before:
            raise FalseWord(f"selecting project {project} has damaged it")
        return told is not None


ENOUGH = 5_000
"""Ten times the jobs that bring every outcome."""


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("share", [0.01, 0.1])
def test_l7_jobs_among_all_faults_are_as_they_are_told(
    share: float, rounds: Rounds, figures: Figures
) -> None:
    total = max(rounds(100_000, ENOUGH), ENOUGH) // 10
    line = Mischief(31, share, *FAULTS)
    jobs = Jobs(line)
    jobs.open()
    for _ in range(total):
        jobs.job()
    sent = sum(ledger.sent for ledger in jobs.bus.statistics.nodes.values())
    ends = {outcome.value: count for outcome, count in sorted(jobs.outcomes.items(), key=str)}
    figures(
        f"L7 L18 whole jobs, {share:.0%} of all that is said struck",
        family="stepper",
        exchanges=sent,
        faults=line.count,
        jobs=total,
        without_a_fault_and_done=jobs.untouched,
        **{f"runs_{name}": count for name, count in ends.items()},
    )
    assert line.count > total / 10
    assert set(jobs.outcomes) >= {Outcome.COMPLETED, *([Outcome.UNKNOWN] if share >= 0.1 else [])}
    assert jobs.outcomes[Outcome.COMPLETED] > total / 20
    assert jobs.refused > 0
    assert jobs.untouched > total / 50
