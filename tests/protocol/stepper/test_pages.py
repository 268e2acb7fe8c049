"""The pages on this family are whole: every switch, every rule, and files that are read as they are printed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from motorbus.families.stepper import Conditions, Program
from motorbus.families.stepper.program import RULES
from motorbus.families.stepper.simulator import Switches

DOCS = Path(__file__).resolve().parents[3] / "docs"
ASSUMPTIONS = (DOCS / "reference" / "stepper-assumptions.md").read_text(encoding="utf-8")
HOW_TO = (DOCS / "how-to" / "stepper-program.md").read_text(encoding="utf-8")


def shown(value: object) -> str:
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


@pytest.mark.parametrize("name", list(Switches.__dataclass_fields__))
def test_every_switch_is_listed_with_its_default(name: str) -> None:
    field = Switches.__dataclass_fields__[name]
    assert f"| `{name}` | {shown(field.default)} |" in ASSUMPTIONS
    assert field.metadata["help"] in ASSUMPTIONS
    assert field.metadata["source"] in ASSUMPTIONS


def test_no_switch_is_listed_that_there_is_not() -> None:
    listed = re.findall(r"^\| `(\w+)` \|", ASSUMPTIONS, re.MULTILINE)
    assert listed == list(Switches.__dataclass_fields__)


@pytest.mark.parametrize("rule", list(RULES))
def test_every_rule_is_listed_with_its_reason(rule: str) -> None:
    level, title, reason = RULES[rule]
    assert f"| {rule} | {level} | {title} | {reason} |" in HOW_TO


def test_the_file_on_the_page_is_one_and_has_no_findings() -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", HOW_TO, re.DOTALL)
    program = Program.parse(text)
    assert program.name == "Feed"
    assert program.lint(Conditions()) == []
    assert str(program.estimate()).startswith("at least ")
