"""What common commands use of this family: words for its verbs, and what there is to watch."""

from __future__ import annotations

import motorbus
from motorbus.cli import build
from motorbus.cli.stepper.offers import COMMANDS, sample
from motorbus.families.stepper import Controller, Program
from tests.cli.stepper.conftest import Line


def test_every_verb_that_is_named_is_there_and_so_is_its_command() -> None:
    app = build()
    for call, said in COMMANDS.items():
        if not said.startswith("`motorbus "):
            continue
        name = call.removesuffix("()")
        assert hasattr(Controller, name) or hasattr(Program, name)
        words = [word for word in said.strip("`").split()[1:] if word.islower() and "#" not in word]
        command = app
        for word in words:
            command = command[word]
        assert command.default_command is not None


def test_its_inputs_are_what_there_is_to_watch(line: Line) -> None:
    line.simulation[1].set_input(2, True)
    with motorbus.open(line.url) as bus:
        assert sample(Controller(bus)) == {f"input_{port}": port == 2 for port in range(1, 6)}
