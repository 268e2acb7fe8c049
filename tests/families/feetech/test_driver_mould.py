"""What comes out of a mould is what is made in full, byte for byte; what is not plain, it leaves alone."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.aimed import Aimed
from motorbus.core.operation import Answer, Exchange
from motorbus.errors import MotorbusError
from motorbus.families.feetech.driver import Node, sync_write, sync_write_positions
from motorbus.families.feetech.driver.mould import Mould, mould
from tests.families.feetech.maps import HEADS, met

NAMES = ("goal_position", "goal_time", "goal_velocity")


def made(nodes: Sequence[Node], *names: str) -> Mould | None:
    return mould(nodes, [[node.table[name] for name in names] for node in nodes if node.table is not None])


def same(cast: Aimed, full: Exchange[Any]) -> None:
    """Do they say the same, to whoever asks?"""
    assert isinstance(cast.request, bytes)
    assert isinstance(full.request, bytes)
    assert cast.request.hex(" ") == full.request.hex(" ")
    assert repr(cast.goals) == repr(full.goals)
    for name in (
        "goals",
        "effect",
        "rank",
        "replies",
        "lane",
        "timeout",
        "repeatable",
        "later",
        "tells_position",
    ):
        assert getattr(cast, name) == getattr(full, name), name
    assert list(cast.ordered) == list(dict.fromkeys(full.ordered))
    assert (cast.refusal is None) == (full.refusal is None)
    for goal in cast.goals:  # it says of itself that it is sure
        assert goal.low is not None
        assert goal.high is not None
        assert goal.low <= goal.value <= goal.high


def fully(
    nodes: Sequence[Node], names: Sequence[str], rows: Sequence[Sequence[float]]
) -> Exchange[Any] | str:
    """As `sync_write` makes it; the first line of its error where it refuses."""
    values = {node: dict(zip(names, row, strict=True)) for node, row in zip(nodes, rows, strict=True)}
    try:
        step = next(sync_write(values))
    except MotorbusError as error:
        return str(error)
    assert isinstance(step, Exchange)
    return step


NUMBERS = (
    st.floats(-1, 8)
    | st.floats()
    | st.integers(-5, 5)
    | st.booleans()
    | st.sampled_from((nan, inf, -inf, -0.0))
)
TIMES = st.integers(-3, 1002).map(float) | NUMBERS
KINDS = st.sampled_from(
    [(name, {}) for name in HEADS] + [(name, {"min_position_limit": 300}) for name in HEADS]
)


@given(KINDS, st.integers(1, 3), st.data())
def test_goals_are_those_that_are_made_in_full(
    kind: tuple[str, dict[str, int]], many: int, draw: st.DataObject
) -> None:
    nodes = [met(kind[0], id, max_position_limit=1000, **kind[1]) for id in range(1, many + 1)]
    form = made(nodes, "goal_position")
    assert form is not None
    values = [draw.draw(NUMBERS) for _ in nodes]
    cast = form.cast(values)
    if cast is not None:
        same(cast, sync_write_positions(nodes, values))
    elif all(type(value) is float and 0.5 <= value <= 1.5 for value in values) and kind[0][:3] != "scs":
        raise AssertionError("these are plain")


@given(st.sampled_from(("sts", "smbl", "smcl", "scs", "scs2")), st.data())
def test_several_registers_are_those_that_are_made_in_full(name: str, draw: st.DataObject) -> None:
    nodes = [met(name, 1), met(name, 2, max_position_limit=700)]
    form = made(nodes, *NAMES)
    assert form is not None
    rows = [[draw.draw(NUMBERS), draw.draw(TIMES), draw.draw(NUMBERS)] for _ in nodes]
    cast = form.cast([value for row in rows for value in row])
    if cast is not None:
        full = fully(nodes, NAMES, rows)
        assert isinstance(full, Exchange), full
        same(cast, full)


ODD = st.sampled_from((nan, 1, True, -1.0))
FEW = [st.sampled_from((0.5, 0.6)), st.sampled_from((0.0, 5.0)), st.sampled_from((0.0, -0.0, 0.7))]


@given(st.sampled_from(("sts", "smcl", "scs")), st.data())
def test_whatever_was_written_before_makes_no_difference(name: str, draw: st.DataObject) -> None:
    """Of several writes some bring values that are as they were; what was made before stays what it was."""
    nodes = [met(name, 1), met(name, 2, max_position_limit=700)]
    form = made(nodes, *NAMES)
    assert form is not None
    before: list[tuple[Aimed, Exchange[Any]]] = []
    for _ in range(4):
        rows: list[list[float]] = [[draw.draw(few) for few in FEW] for _ in nodes]
        if draw.draw(st.integers(0, 4)) == 4:
            rows[draw.draw(st.integers(0, 1))][draw.draw(st.integers(0, 2))] = draw.draw(ODD)
        values = [value for row in rows for value in row]
        fresh = made(nodes, *NAMES)
        assert fresh is not None
        cast = form.cast(values)
        assert (cast is None) == (fresh.cast(values) is None)
        if cast is not None:
            full = fully(nodes, NAMES, rows)
            assert isinstance(full, Exchange), full
            before.append((cast, full))
    for one, full in before:
        same(one, full)


@pytest.mark.parametrize("name", HEADS)
def test_every_count_between_the_limits_is_plain_and_none_outside(name: str) -> None:
    nodes = [met(name, 1, min_position_limit=20, max_position_limit=900)]
    form = made(nodes, "goal_position")
    assert form is not None
    assert nodes[0].table is not None
    scale = nodes[0].table["goal_position"].scale
    for raw in range(1024):
        cast = form.cast([raw * scale])
        assert (cast is not None) == (20 <= raw <= 900), raw
        if cast is not None:
            same(cast, sync_write_positions(nodes, [raw * scale]))


def test_angular_resolution_and_many_turns_are_heeded() -> None:
    for settings in ({"at_30": 2}, {"at_30": 3}, {"at_9": 0, "at_10": 0, "at_11": 0, "at_12": 0}):
        nodes = [met("sts", 1, **settings), met("sts", 2)]
        form = made(nodes, "goal_position")
        assert form is not None
        for value in (0.0, 0.1, 1.0, 3.3333, 6.2):
            cast = form.cast([value, value])
            assert cast is not None
            same(cast, sync_write_positions(nodes, [value, value]))


@pytest.mark.parametrize(
    "values", [[], [1.0], [1.0] * 3, [1, 1], [True, 1.0], ["1", 1.0], [None, 1.0], [[1.0], [1.0]]]
)
def test_what_is_not_as_many_plain_numbers_as_it_takes_is_left_alone(values: Any) -> None:
    form = made([met("sts", 1), met("sts", 2)], "goal_position")
    assert form is not None
    assert form.cast(values) is None


def test_a_kind_of_float_is_looked_at_closely() -> None:
    class Precise(float): ...

    form = made([met("sts", 1)], "goal_position")
    assert form is not None
    assert form.cast([Precise(1.0)]) is None


def test_there_is_none_where_nothing_so_simple_holds() -> None:
    big = [met("sts", id) for id in range(84)]
    assert made(big[:83], "goal_position") is not None
    assert made(big, "goal_position") is None
    assert made([met("sts", 1), met("scs", 2)], "goal_position") is None  # two orders of bytes
    assert made([met("sts", 1), met("hls", 2)], "goal_position") is not None
    assert made([met("sts", 1, operating_mode=1)], "goal_position") is None
    assert made([met("sts", 1, operating_mode=1)], "goal_velocity") is None
    assert made([met("scs", 1, min_position_limit=0, max_position_limit=0)], "goal_position") is None
    assert made([met("smcl", 1, min_position_limit=0, max_position_limit=0)], "goal_position") is None
    assert made([met("sts", 1)], "goal_position", "goal_velocity") is None  # they do not adjoin
    assert made([met("hls", 1)], "goal_torque") is None
    assert made([met("sts", 1)], "torque_enable") is None


def test_it_holds_as_long_as_the_settings_are_the_same() -> None:
    node = met("sts", 1)
    form = made([node], "goal_position")
    assert form is not None
    assert form.holds()
    node.settings = met("sts", 1).settings  # read again, and nothing has changed
    assert form.holds()
    node.settings = met("sts", 1, at_30=2).settings
    assert not form.holds()
    node.forget_settings()
    assert not form.holds()


@pytest.mark.parametrize("names", [NAMES[:1], NAMES])
def test_what_was_made_before_a_change_says_still_what_it_meant_and_does_not_leave(
    names: Sequence[str],
) -> None:
    nodes = [met("sts", 1)]
    form = made(nodes, *names)
    assert form is not None
    row = [1.0, 100.0, 2.0][: len(names)]
    cast, full = form.cast(row), fully(nodes, names, [row])
    assert isinstance(full, Exchange)
    assert cast is not None
    for settings in (None, met("sts", 1, at_30=2).settings, met("sts", 1, operating_mode=1).settings):
        nodes[0].settings = settings
        assert cast.goals == full.goals
        assert full.refusal is not None
        refused, as_full = cast.refusal(lambda _: 0), full.refusal(lambda _: 0)
        assert refused is not None
        assert str(refused) == str(as_full)
    assert cast.read(Answer((), (), 0.0)) is None
