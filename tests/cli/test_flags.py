"""A mistyped flag is told of as one, with the flag that may be meant; an option that buses have goes to them."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Bench, Run
from tests.support.machines import listened, said


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("move a1=10deg --durration 3", "--durration: no such flag\n  expected: did you mean --duration?"),
        ("hold a1 --dry-runn yes", "--dry-runn: no such flag\n  expected: did you mean --dry-run?"),
        ("stop a1 --colour red", "--colour: no such flag, and the bus has no such option"),
        ("read feetech:sim#1 --colour red", "--colour: no such flag, and the bus has no such option"),
    ],
)
def test_a_mistyped_flag_is_told_of_as_one(words: str, told: str, bench: Bench, run: Run) -> None:
    ran = run(*words.split())
    assert (ran.code, ran.out) == (2, "")
    assert told in ran.err


def test_an_option_of_a_bus_is_one(bench: Bench, run: Run) -> None:
    assert run("ping", "feetech:sim#1", "--ids", "1").code == 0
    assert "fast" in run("hold", "a1", "--baud", "fast").err


@pytest.mark.parametrize(
    "words",
    [
        "jog a1=1deg/s -5 --seconds 1",
        "follow a1 a2 -5",
        "replay a.csv -5",
        "calibrate arm#1 -5",
        "set-id arm#1 2 -5",
        "recover arm -5",
    ],
)
def test_a_word_too_many_is_one_clear_line(words: str, bench: Bench, run: Run) -> None:
    listened(bench.simulations)
    ran = run(*words.split())
    assert (ran.code, ran.out) == (2, "")
    first, *more = ran.err.splitlines()
    command = words.partition(" a")[0].partition(" stage")[0]
    assert first == f"error: `motorbus {command}` has no place for '-5'"
    assert [line.partition(":")[0] for line in more] == ["  expected", "  what to do"]
    assert not said(bench.simulations)


@pytest.mark.parametrize(
    "name", ["hold", "park", "home", "teach", "move", "pose", "loop-stats", "stop", "torque"]
)
def test_where_any_number_of_names_may_stand_a_word_too_many_is_a_name_that_nobody_has(
    name: str, bench: Bench, run: Run
) -> None:
    ran = run(
        name, *(["on"] if name == "torque" else []), "extra", *(["--output", "w.csv"] * (name == "teach"))
    )
    assert (ran.code, ran.out) == (2, "")
    assert "extra" in ran.err.splitlines()[0]
    assert "Tokens" not in ran.err
