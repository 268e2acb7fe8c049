"""A mistyped flag is told of as one, with the flag that may be meant; an option that buses have goes to them."""

from __future__ import annotations

import pytest

from tests.cli.conftest import Bench, Run


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
