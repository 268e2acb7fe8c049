"""A rate that cannot be is one clear error in every command that takes one, and nothing is sent."""

from __future__ import annotations

import inspect
from importlib import import_module

import pytest

from motorbus.cli import _COMMANDS
from motorbus.cli.rates import check_rate
from motorbus.core.units import MAX_RATE, MIN_RATE
from tests.cli.conftest import Bench, Run
from tests.support.machines import listened, said

TAKING = {
    "teach": "teach a1 --output w.csv --seconds 1",
    "follow": "follow a1 a2 --seconds 1",
    "loop-stats": "loop-stats arm --seconds 1",
    "monitor": "monitor a1 --count 1",
    "budget": "budget arm",
}


def test_every_command_that_takes_a_rate_is_tried() -> None:
    names = [name for group in _COMMANDS.values() for name in group]
    commands = {name: import_module(f"motorbus.cli.{name.replace('-', '_')}").app for name in names}
    assert {name for name, app in commands.items() if _takes_a_rate(app.default_command)} == set(TAKING)


def _takes_a_rate(command: object) -> bool:
    flag = inspect.signature(command).parameters.get("rate") if callable(command) else None
    return flag is not None and flag.kind is flag.KEYWORD_ONLY


@pytest.mark.parametrize("rate", ["1e300", "nan", "inf", "-inf", "0", "-1", "-1e300", "1e-320"])
@pytest.mark.parametrize(
    "command", [*TAKING.values(), "budget kst:sim --ids 1-4", "budget feetech:sim --ids 1"]
)
def test_a_rate_that_cannot_be_is_one_error(command: str, rate: str, bench: Bench, run: Run) -> None:
    listened(bench.simulations)
    ran = run(*command.split(), "--rate", rate)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith(f"error: --rate {float(rate):g}: it cannot be done so often\n")
    assert "expected: cycles per second: 1e-06 to 1e+06" in ran.err
    assert not said(bench.simulations)


def test_every_other_rate_is_left_to_whoever_knows_the_bus() -> None:
    check_rate(MAX_RATE)
    check_rate(MIN_RATE)
