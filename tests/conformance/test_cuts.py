"""A command that is cut off at any moment leaves its device in the old or the new state, and within reach.

It is cut by loss of supply, process death, interrupt, cancellation and a lost link, at every frame and in every store,
once and twice. `make test` takes every single cut of each command but a long one (`home` of the stepper), and a choice
for the other models, quirks and arguments of a command; `make soak` takes all, at most `MOST`.
"""

from __future__ import annotations

from random import Random

import pytest

from tests.conformance.cuts import Command, violations
from tests.conftest import Figures, Rounds
from tests.support.catalogue.cuts import COMMANDS, known_faults

MOST = 1_000
LONG = 200
"""Moments; a command that has more is not executed once more after each cut, but after every `SELDOM`-th."""
SELDOM = 10


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_command_cut_once_leaves_old_or_new_state(command: Command, rounds: Rounds, figures: Figures) -> None:
    cuts = command.single_cuts()
    count = min(len(cuts), rounds(MOST, command.cuts or MOST))
    for number, cut in enumerate(Random(command.name).sample(cuts, count)):
        then = len(command.whole.moments) < LONG or number % SELDOM == 0
        assert violations(command, cut, then=then) == [], cut
    figures(f"D10 {command.name} cut once", family=command.subject.name, cuts=count, of=len(cuts))


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("command", [one for one in COMMANDS if one.pairs], ids=lambda command: command.name)
def test_command_cut_twice_leaves_old_or_new_state(
    command: Command, rounds: Rounds, figures: Figures
) -> None:
    pairs = command.double_cuts(rounds(MOST, command.pairs))
    for pair in pairs:
        assert violations(command, *pair) == [], pair
    figures(f"D10 {command.name} cut twice", family=command.subject.name, pairs=len(pairs))


@pytest.mark.parametrize(
    "command",
    [pytest.param(one, id=one.name, marks=pytest.mark.xfail(reason=why)) for one, why in known_faults()],
)
def test_command_called_again_completes_it(command: Command) -> None:
    """After any cut and without a restart of the device."""
    for cut in reversed(command.single_cuts()):
        assert violations(command, cut) == [], cut
