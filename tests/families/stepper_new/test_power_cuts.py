"""A command that is cut off leaves project 1 and the stored projects old or new, and within reach of the next host."""

from __future__ import annotations

from random import Random

import pytest

from tests.conformance.cuts import Command, violations
from tests.families.stepper_new.cuts import COMMANDS

MOST = 20


@pytest.mark.timeout(600)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_command_cut_once_leaves_old_or_new_state(command: Command) -> None:
    cuts = command.single_cuts()
    for number, cut in enumerate(Random(command.name).sample(cuts, min(len(cuts), MOST))):
        assert violations(command, cut, then=number % 10 == 0) == [], cut


@pytest.mark.timeout(600)
@pytest.mark.parametrize("command", [one for one in COMMANDS if one.pairs], ids=lambda command: command.name)
def test_command_cut_twice_leaves_old_or_new_state(command: Command) -> None:
    for pair in command.double_cuts(8):
        assert violations(command, *pair) == [], pair
