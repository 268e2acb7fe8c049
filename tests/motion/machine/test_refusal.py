"""Words of refusals: places as the file has them, values no longer than a line, suggestions that are near."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.motion.machine.refusal import listed, nearest, path, refused, said, to_do


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        (("axis", "shoulder", "low"), "axis.shoulder.low"),
        (("axis", "a b"), 'axis."a b"'),
        (("axis", ""), 'axis.""'),
        (("x" * 100,), '"' + "x" * 39 + "…"),
    ],
)
def test_a_place_is_written_as_in_the_file(keys: tuple[str, ...], text: str) -> None:
    assert path(*keys) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ({"a": {}}, "a table"),
        ([1], "a list"),
        (True, "true"),
        ("x", "'x'"),
        (1.5, "1.5"),
        pytest.param(10**5000, "an integer of thousands of digits", id="digits"),
    ],
)
def test_what_was_written_is_shown_in_short(value: Any, text: str) -> None:
    assert said(value) == text


def test_a_list_of_words_ends() -> None:
    assert listed([], "an axis") == "an axis"
    assert listed(["a"]) == "a"
    assert listed("ab") == "one of a, b"
    assert listed(map(str, range(20))).endswith("10, 11 and 8 more")


def test_only_what_is_near_is_suggested() -> None:
    assert nearest("Sholder", ["elbow", "shoulder"]) == "did you mean shoulder?"
    assert nearest("wrist", ["elbow", "shoulder"], "take it out") == "take it out"
    assert nearest("", []) == ""


def test_a_refusal_says_where_what_and_what_to_do() -> None:
    error = refused("axis.a", "is missing", "a table", "add it")
    assert str(error) == ("axis.a: is missing\n  expected: a table\n  what to do: add it; nothing was opened")
    assert refused("", "the file is odd", "TOML", "x").summary == "the file is odd"


@pytest.mark.parametrize(
    ("advice", "told"),
    [
        ("see to that", "see to that; nothing was opened"),
        ("see to that; nothing was sent", "see to that; nothing was opened"),
        ("see to that; or leave it; nothing was opened", "see to that; or leave it; nothing was opened"),
        ("nothing was sent", "change it; nothing was opened"),
        ("", "change it; nothing was opened"),
    ],
)
def test_what_was_not_done_is_said_once_and_what_to_do_always(advice: str, told: str) -> None:
    assert refused("bus.arm.address", "no", "yes", advice).advice == told


def test_where_nothing_is_to_be_done_something_else_may_be_said() -> None:
    assert to_do("nothing was opened", "turn back") == "turn back"
