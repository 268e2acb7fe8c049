"""What common commands use of this family: words for its verbs, and what there is to watch."""

from __future__ import annotations

import motorbus
from motorbus.cli import build
from motorbus.cli.stepper.offers import COMMANDS, sample
from motorbus.families.stepper import Controller, Program
from tests.cli.conftest import Run
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


def test_what_a_write_costs_is_told_before_it_and_what_it_proves_after(run: Run, line: Line) -> None:
    words = ("write", line.url, "step_1_delay=500ms")
    asked = run(*words)
    assert (asked.code, line.orders()) == (8, [])
    assert "project 1: 3 commands and 4 dumps, about " in asked.out
    assert "step_1_delay: 1 s -> 0.5 s" in asked.out
    assert "write step_1_delay to the project it has stored" in asked.err
    assert "EEPROM" not in asked.err
    ran = run(*words, "--yes")
    assert ran.out.index("3 commands and 4 dumps, about") < ran.out.index("Written to #1")
    assert ran.out.count("step_1_delay: 1 s -> 0.5 s") == 1
    assert "that it is stored is proved by a power cycle only" in ran.out
    told = run("write", line.url, "step_1_delay=400ms", "--yes", "--json").document["result"]
    assert (told["commands"], told["dumps"], told["proof"], told["saved"]) == (3, 4, "acknowledged", True)


def test_its_inputs_are_what_there_is_to_watch(line: Line) -> None:
    line.simulation[1].set_input(2, True)
    with motorbus.open(line.url) as bus:
        assert sample(Controller(bus)) == {f"input_{port}": port == 2 for port in range(1, 6)}
