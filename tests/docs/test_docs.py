"""The pages are true: their Python runs, their links have targets, their tables are complete."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from motorbus import errors
from motorbus.cli import main
from motorbus.families.stepper import Program
from motorbus.motion.machine import MachineConfig
from tests.docs.pages import PAGES, ROOT, blocks, missing, name_of

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


@pytest.mark.parametrize("name", ["README.md", "docs/index.md"])
def test_python_of_the_first_pages_prints_what_they_show(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    (found,) = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(ROOT)
    exec(compile(found[0], "<page>", "exec"), {"__name__": "__main__"})
    assert missing(tuple(found[1].splitlines()), capsys.readouterr().out) == []


MACHINE = 'format = 1\n[bus.arm]\naddress = "feetech:sim,ids=1-9"\n'
NEEDED = 'device = "arm#9"\nmax_velocity = "1 rad/s"\n'
TABLES = [
    pytest.param(text, id=f"{name_of(page)}-{number}")
    for page in PAGES
    for number, text in enumerate(blocks(page, "toml"))
]


@pytest.mark.parametrize("text", TABLES)
def test_toml_is_valid(text: str) -> None:
    """A whole file is read as it is; tables of an axis get a bus, and the keys that an axis needs."""
    if "[[step]]" in text:
        assert Program.parse(text).lint() is not None
        return
    data = tomllib.loads(text)
    if "format" not in data:
        for name, axis in data["axis"].items():
            lines = [line for line in NEEDED.splitlines() if line.split(" = ")[0] not in axis]
            device = f'device = "arm#{len(name)}"'
            wanted = "\n".join(line.replace('device = "arm#9"', device) for line in lines)
            text = text.replace(f"[axis.{name}]", f"[axis.{name}]\n{wanted}")
        text = MACHINE + text
    assert MachineConfig.parse(text).axes


def test_json_is_valid() -> None:
    texts = [text for page in PAGES for text in blocks(page, "json")]
    assert all(json.loads(text) for text in texts)


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


def test_every_option_of_every_command_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    shared = {"--json", "--machine", "--bus", "--preset", "--port", "--arm"}
    rows = re.findall(r"^\| `([a-z-]+(?: [a-z-]+)?)[^`]*` \| .*? \| ?([^|]*)\|$", text, re.MULTILINE)
    for words, options in rows:
        assert main([*words.split(), "--help"]) == 0
        heads = re.findall(r"^  (-.*?):", capsys.readouterr().out, re.MULTILINE)
        has = {*re.findall(r"--[a-z-]+", " ".join(heads))}
        wanted = {*re.findall(r"--[a-z-]+", options), *({"--yes", "--dry-run"} if "W" in options else ())}
        assert has - shared == wanted - shared, words
    assert len(rows) > 40


def test_every_error_has_an_exit_code() -> None:
    text = (ROOT / "docs" / "reference" / "exit-codes.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([A-Z]\w+)`", text))
    tree = {name for name, kind in vars(errors).items() if isinstance(kind, type)}
    assert {name for name in tree if issubclass(getattr(errors, name), errors.MotorbusError)} <= named
