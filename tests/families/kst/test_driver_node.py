"""One servo by its id: what it may be called, and angles as counts, exactly."""

from __future__ import annotations

import math
from typing import Any

import pytest

from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.families.kst.driver.node import checked_ids, hexadecimal
from tests.families.kst.bench import node


@pytest.mark.parametrize(
    ("text", "raw"),
    [
        ("10.85deg", 109),
        ("-10.85deg", -109),
        ("10.84deg", 108),
        ("-10.9deg", -109),
        ("0.8deg", 8),
        ("90deg", 900),
        ("-90deg", -900),
        ("0.05deg", 1),
        ("0.049deg", 0),
    ],
)
def test_half_a_count_goes_away_from_zero(text: str, raw: int) -> None:
    one = node()
    assert one.raw(one.table["goal_position"], units.parse(text, "position")) == raw


def test_a_value_and_its_counts_are_the_same_both_ways() -> None:
    for profile in ("kst", "kst-ext", "xqpower"):
        one = node(profile)
        for row in one.table.values():
            for raw in {row.low, 1, row.high // 2, row.high} & set(range(row.low, min(row.high, 1000) + 1)):
                assert one.raw(row, one.value(row, raw)) == raw, (profile, row.name)


@pytest.mark.parametrize("value", [math.nan, math.inf, True, "1", None, pytest.param(10**400, id="huge")])
def test_what_is_no_number_is_refused(value: Any) -> None:
    one = node()
    with pytest.raises(RequestError, match="goal_position"):
        one.raw(one.table["goal_position"], value)


def test_nothing_is_known_of_a_new_node() -> None:
    one = node("kingmax", 0x25)
    assert (one.node, one.alarm, one.limits, one.at) == (0x25, (), None, -math.inf)
    assert one.table is one.profile.table
    assert one.profile.name == "kingmax"


def test_ids() -> None:
    assert checked_ids([3, 1, 3]) == [3, 1]
    with pytest.raises(RequestError, match="addresses everyone"):
        checked_ids([1, 0])
    assert hexadecimal(37) == "0x25 (37)"
