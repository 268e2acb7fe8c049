"""Every doubt has a name, a default and a source, and can be said in a bus string."""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from typing import Any

import pytest

from motorbus.core.switches import options, switched
from motorbus.errors import RequestError
from motorbus.families.kst.simulator import Quirks

chosen = partial(switched, Quirks, "kst")


def test_text_and_values_mean_the_same() -> None:
    text = chosen({"accept_sized": "no", "flash_time": "0.05", "x1": "0x10", "pending_id": "active"})
    values = chosen({"accept_sized": False, "flash_time": 0.05, "x1": 16, "pending_id": "active"})
    assert text == values == Quirks(accept_sized=False, flash_time=0.05, x1=16, pending_id="active")


@pytest.mark.parametrize(
    ("name", "value", "says", "expected"),
    [
        ("out_of_reach", "abort", "no option 'out_of_reach'", "out_of_range"),
        ("out_of_range", "both", "'both' is not possible", "abort, clamp"),
        ("accept_sized", "maybe", "neither yes nor no", "yes or no"),
        ("flash_time", "long", "'long' is not possible", "a number, 0 or more"),
        ("flash_time", "-1", "'-1' is not possible", "a number"),
        ("flash_time", "nan", "'nan' is not possible", "a number"),
        ("speed", "0", "'0' is not possible", "a number"),
        ("bit_rate", "300000", "'300000' is not possible", "20000, 50000, 100000, 125000, 250000, 500000"),
        ("bit_rate", "fast", "'fast' is not possible", "whole number"),
        ("x1", "256", "'256' is not possible", "a whole number, 0 to 255"),
        ("position", "40000", "'40000' is not possible", "-32768 to 32767"),
        ("id_format", "29", "'29' is not possible", "asked, std, ext"),
    ],
)
def test_nonsense_is_refused_by_name(name: str, value: str, says: str, expected: str) -> None:
    with pytest.raises(RequestError) as caught:
        chosen({name: value})
    assert says in caught.value.summary
    assert expected in caught.value.expected


@pytest.mark.parametrize("one", fields(Quirks), ids=lambda one: one.name)
def test_each_has_a_help_text_a_source_and_a_default_among_its_choices(one: Any) -> None:
    assert one.metadata["help"]
    assert one.metadata["source"]
    assert not one.metadata["choices"] or one.default in one.metadata["choices"]
    assert chosen({one.name: one.default}) == Quirks()


def test_every_choice_can_be_chosen() -> None:
    for one in fields(Quirks):
        for choice in one.metadata["choices"]:
            assert getattr(chosen({one.name: str(choice)}), one.name) == choice


def test_every_switch_is_an_option_with_its_choices_and_its_source() -> None:
    found = {option.name: option for option in options(Quirks)}
    assert set(found) == {one.name for one in fields(Quirks)}
    assert found["id_format"].choices == ("asked", "std", "ext")
    assert all(option.source for option in found.values())
    assert (found["flash_time"].kind, found["x1"].kind, found["accept_sized"].kind) == (float, int, bool)
