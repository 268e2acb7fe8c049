"""The pages are true: their Python runs, their links have targets, their tables are complete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from motorbus import errors
from tests.docs.pages import PAGES, ROOT, blocks, name_of

PROGRAMS = [
    pytest.param(text, id=f"{name_of(page)}-{number}")
    for page in PAGES
    for number, text in enumerate(blocks(page, "python"))
]


@pytest.mark.parametrize("text", PROGRAMS)
def test_python_runs(text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    exec(compile(text, "<page>", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_have_targets(page: Path) -> None:
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


def test_every_error_has_an_exit_code() -> None:
    text = (ROOT / "docs" / "reference" / "exit-codes.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([A-Z]\w+)`", text))
    tree = {name for name, kind in vars(errors).items() if isinstance(kind, type)}
    assert {name for name in tree if issubclass(getattr(errors, name), errors.MotorbusError)} <= named
