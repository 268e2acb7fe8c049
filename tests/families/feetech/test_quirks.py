"""The page of quirks is whole: 27 rows in order, each with what is done about it and tests that are there."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import NamedTuple

import pytest

HERE = Path(__file__).parent
PAGE = HERE.parents[2] / "docs" / "reference" / "feetech-quirks.md"
MOST = 27


class Quirk(NamedTuple):
    """A row of the page."""

    number: int
    happens: str
    seen: str
    done: str
    tests: tuple[str, ...]


def quirks() -> list[Quirk]:
    rows = [
        line.strip("|").split("|")
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line[:1] == "|"
    ]
    return [
        Quirk(
            int(number), happens.strip(), seen.strip(), done.strip(), tuple(re.findall(r"`([^`]+)`", tests))
        )
        for number, happens, seen, done, tests in rows[2:]
    ]


def functions_of(file: str) -> dict[str, str]:
    """Its tests by name, with their docstrings."""
    tree = ast.parse((HERE / file).read_text(encoding="utf-8"))
    return {
        node.name: ast.get_docstring(node) or "" for node in tree.body if isinstance(node, ast.FunctionDef)
    }


def written() -> dict[str, str]:
    """Every test of a quirk that there is, as FILE::NAME, with its docstring."""
    return {
        f"{file.name}::{name}": told
        for file in sorted(HERE.glob("test_quirks_*.py"))
        for name, told in functions_of(file.name).items()
        if name.startswith("test_")
    }


def test_all_of_them_are_there_in_order() -> None:
    assert [one.number for one in quirks()] == list(range(1, MOST + 1))


@pytest.mark.parametrize("one", quirks(), ids=lambda one: str(one.number))
def test_a_row_says_what_happens_who_saw_it_and_what_is_done(one: Quirk) -> None:
    assert one.happens.endswith(".")
    assert one.done.endswith((".", '".'))
    assert one.seen


@pytest.mark.parametrize("one", quirks(), ids=lambda one: str(one.number))
def test_its_tests_exist_and_have_its_number_and_say_what_servos_do(one: Quirk) -> None:
    assert one.tests
    for name in one.tests:
        assert name.partition("::")[2].startswith(f"test_quirk_{one.number:02}_")
        assert len(written()[name]) > 40


def test_every_test_of_a_quirk_is_on_the_page() -> None:
    assert set(written()) == {name for one in quirks() for name in one.tests}
