"""A failing script is made small, and none of what is left can be left out."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.simulation.faults import Fault, Script, parse, shrink


def many(count: int) -> Script:
    return Script(tuple(Fault(number, 0, "drop") for number in range(1, count + 1)), seed=3)


@given(st.integers(1, 60).flatmap(lambda n: st.tuples(st.just(n), st.sets(st.integers(1, n), max_size=4))))
def test_only_the_reasons_are_left(drawn: tuple[int, set[int]]) -> None:
    count, reasons = drawn

    def fails(script: Script) -> bool:
        return reasons <= {fault.exchange for fault in script}

    small = shrink(many(count), fails)
    assert {fault.exchange for fault in small} == reasons
    assert small.seed == 3


def test_it_takes_few_runs() -> None:
    runs: list[int] = []

    def fails(script: Script) -> bool:
        runs.append(len(script))
        return any(fault.exchange == 700 for fault in script)

    assert shrink(many(1000), fails) == Script((Fault(700, 0, "drop"),), 3)
    assert len(runs) < 100


def test_what_does_not_fail_has_no_reason() -> None:
    with pytest.raises(RequestError, match="does not fail"):
        shrink(parse("exchange 1: drop"), lambda script: False)
