"""The pages are true: their Python runs, their commands parse, their links lead somewhere, their tables are whole."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from motorbus.cli import build, main, parse

from motorbus import errors
from tests.docs.test_readme import LINES as README

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("changelog.d/*.md")])
WITHOUT_HARDWARE = re.compile(
    r"(feetech|kst|stepper):sim|^motorbus decode|^motorbus ports"
    r"|^motorbus feetech (registers|models)|^motorbus stepper \w+ \S+\.toml$"
)


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(language: str) -> list[tuple[str, str]]:
    """Every fenced block of this language: where it stands, and its text."""
    pattern = re.compile(rf"^```{language}\n(.*?)^```", re.MULTILINE | re.DOTALL)
    return [
        (f"{name_of(page)}-{number}", text)
        for page in PAGES
        for number, text in enumerate(pattern.findall(page.read_text(encoding="utf-8")))
    ]


def commands() -> list[str]:
    lines = [line for _, text in blocks("console") for line in text.splitlines()]
    shown = {line[2:].partition("  #")[0].strip() for line in lines if line.startswith("$ motorbus ")}
    return sorted(shown)


@pytest.mark.parametrize("text", [pytest.param(text, id=where) for where, text in blocks("python")])
def test_python_runs(text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    exec(compile(text, "<page>", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().err == ""


def test_there_are_commands_to_judge() -> None:
    assert len(commands()) > 15


@pytest.mark.parametrize("line", commands())
def test_a_command_parses(line: str) -> None:
    words = shlex.split(line)[1:]
    command, _, _ = parse(build(), words)
    name = words[0].replace("-", "_")
    assert f"{command.__module__}.".startswith((f"motorbus.cli.{name}.", f"motorbus.families.{name}.cli."))


@pytest.mark.parametrize(
    "line", [line for line in commands() if WITHOUT_HARDWARE.search(line) and line not in README]
)
def test_a_command_that_needs_no_hardware_succeeds(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Those of the README are run by its own tests."""
    assert main(shlex.split(line)[1:]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []


def test_every_error_is_explained() -> None:
    text = (ROOT / "docs" / "reference" / "errors.md").read_text(encoding="utf-8")
    explained = re.findall(r"^\| `(\w+)` \| (?:`(\w+)`)? ?\|", text, re.MULTILINE)
    tree = [
        kind
        for kind in vars(errors).values()
        if isinstance(kind, type) and kind.__module__ == errors.__name__
    ]
    parents = {
        kind.__name__: kind.__bases__[-1].__name__ for kind in tree if kind is not errors.MotorbusError
    }
    assert dict(explained) == {
        name: "" if parent == "MotorbusError" else parent for name, parent in parents.items()
    }
