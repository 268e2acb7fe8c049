"""Every public command of every family sends the recorded bytes and returns the recorded result.

A difference that is meant: `python -m tests.golden --write` records again; then read the diff of the traces.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

import motorbus
from tests.golden.catalogue import CASES, EXCLUDED, VARIANTS
from tests.golden.recording import (
    DEVICE,
    Case,
    difference,
    load,
    public_commands,
    public_functions,
    trace,
)

recorded = cache(load)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_command_sends_the_recorded_bytes_and_returns_the_recorded_result(case: Case) -> None:
    found = difference(recorded(case.family)[case.id], trace(case))
    assert not found, f"{case.id}: {found}; if it is meant: python -m tests.golden --write {case.family}"


@pytest.mark.parametrize("family", VARIANTS)
def test_every_public_command_has_a_case_on_every_map_and_profile(family: str) -> None:
    module: Any = getattr(motorbus, family)
    commands = set(public_commands(getattr(module, DEVICE[family]))) | set(public_functions(module))
    assert set(EXCLUDED[family]) <= commands, "an exclusion without a command"
    for variant in VARIANTS[family]:
        of_variant = [case for case in CASES if (case.family, case.variant) == (family, variant)]
        covered = {case.call.name for case in of_variant if case.call.on != "group"}
        assert covered == commands - set(EXCLUDED[family]), variant


@pytest.mark.parametrize("family", VARIANTS)
def test_traces_and_cases_are_the_same_in_number_and_order(family: str) -> None:
    assert list(recorded(family)) == [case.id for case in CASES if case.family == family]
