"""Scripts of inputs: what is read, in order, and what is refused with its line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.families.stepper.simulator import Change, parse


def test_a_script_is_read_in_order_of_time() -> None:
    script = "# a tray\n2.5 1 on\n\n 0.5\t2  off # before\n3,5,on\n"
    assert parse(script) == [Change(0.5, 2, False), Change(2.5, 1, True), Change(3.0, 5, True)]


@pytest.mark.parametrize(
    "line", ["1 on", "1 6 on", "1 0 on", "-1 1 on", "1 1 yes", "nan 1 on", "1 1 on off", "1e3 1 on"]
)
def test_what_is_no_change_is_refused_with_its_line(line: str) -> None:
    with pytest.raises(RequestError, match="inputs, line 2: ") as caught:
        parse(f"1 1 on\n{line}\n")
    assert "2.5 1 on" in caught.value.expected


def test_a_script_has_an_end() -> None:
    with pytest.raises(RequestError, match="more than 100000"):
        parse("1 1 on\n" * 100_001)


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        found = parse(text)
    except RequestError:
        return
    assert found == sorted(found, key=lambda change: change.at)
