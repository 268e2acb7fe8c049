"""The house rules that a person would otherwise have to remember: size, prologues, names, a test for every file.

These read the files, never import them, so they also judge what other tests would only meet by accident.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "src" / "motorbus"
TESTS = ROOT / "tests"
FOLDERS = ("src", "tests", "bench", "examples", "scripts")
LONGEST_FILE = 400
LONGEST_FUNCTION = 50
ROOMS = ("wire", "table", "driver", "simulator")
IMPORTED_AS = {"python-can": "can"}
EMPTY_WORDS = re.compile(r"(Manager|Helper|Utils?|Handler)(?![a-z])")
# file: why it may hold a test that does not always run
MAY_SKIP: dict[str, str] = {}

Function: TypeAlias = "ast.FunctionDef | ast.AsyncFunctionDef"


def python_files(*folders: str) -> list[Path]:
    return sorted(file for folder in folders for file in (ROOT / folder).rglob("*.py"))


def name_of(file: Path) -> str:
    return str(file.relative_to(ROOT))


def parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"), str(file))


def functions(tree: ast.AST) -> Iterator[Function]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def does_something(function: Function) -> bool:
    """Has it a body beyond a docstring, `...` and `pass`? A protocol's methods have none."""
    return not all(
        isinstance(line, ast.Pass) or (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
        for line in function.body
    )


def places_of_its_test(file: Path) -> list[Path]:
    """Where the test of a source file may be.

    a/b.py is tested by tests/a/test_b.py. A package is tested, as to its `__init__`, by the file named after it,
    inside or beside its folder; a room of a family that has outgrown one file may be tested as one room, or file by
    file beside its folder (wire/stream.py by test_wire_stream.py).
    """
    path = file.relative_to(SOURCES)
    if path == Path("__init__.py"):
        return [TESTS / "test_imports.py"]
    folder = TESTS / path.parent
    beside = folder.parent / f"test_{folder.name}.py"
    if path.name == "__init__.py":
        return [folder / f"test_{folder.name}.py", beside]
    own = folder / f"test_{path.stem}.py"
    split = folder.parent / f"test_{folder.name}_{path.stem}.py"
    return [own, beside, split] if folder.name in ROOMS else [own]


FILES = python_files(*FOLDERS)
BUILT_IN = python_files("src")


@pytest.mark.parametrize("file", BUILT_IN, ids=name_of)
def test_every_source_file_has_its_test(file: Path) -> None:
    if file.name == "__main__.py" or not any(map(does_something, functions(parsed(file)))):
        return  # declares only: there is no behaviour to test
    places = places_of_its_test(file)
    assert any(place.exists() for place in places), f"expected {' or '.join(map(name_of, places))}"


@pytest.mark.parametrize("file", FILES, ids=name_of)
def test_no_file_is_long(file: Path) -> None:
    if file.stem == "table" or file.parent.name == "table":
        return  # a table is data, however long
    assert len(file.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE


@pytest.mark.parametrize("file", FILES, ids=name_of)
def test_no_function_is_long(file: Path) -> None:
    lengths = {found.name: (found.end_lineno or 0) - found.lineno + 1 for found in functions(parsed(file))}
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST_FUNCTION} == {}


@pytest.mark.parametrize("file", FILES, ids=name_of)
def test_every_file_says_why_it_is_there(file: Path) -> None:
    tree = parsed(file)
    assert not tree.body or ast.get_docstring(tree), "a short prologue in prose is missing"


@pytest.mark.parametrize("file", BUILT_IN, ids=name_of)
def test_what_is_public_has_a_docstring(file: Path) -> None:
    public = [
        node
        for node in parsed(file).body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        and not node.name.startswith("_")
    ]
    assert [node.name for node in public if not ast.get_docstring(node)] == []


@pytest.mark.parametrize("file", FILES, ids=name_of)
def test_no_name_is_an_empty_word(file: Path) -> None:
    classes = [node.name for node in ast.walk(parsed(file)) if isinstance(node, ast.ClassDef)]
    assert [name for name in [*classes, file.stem.title()] if EMPTY_WORDS.search(name)] == []


@pytest.mark.parametrize("file", python_files("tests"), ids=name_of)
def test_no_test_is_skipped_in_silence(file: Path) -> None:
    marks = {"skip", "skipif", "xfail", "importorskip"}
    tree = parsed(file)
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)} & marks
    assert not used or name_of(file) in MAY_SKIP, f"{used}: give the reason in MAY_SKIP"


def decisions() -> list[Path]:
    return sorted((ROOT / "docs" / "explanation" / "decisions").glob("[0-9]*.md"))


def test_decision_records_are_numbered_without_a_gap() -> None:
    numbers = [int(record.name[:4]) for record in decisions()]
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) >= 14


@pytest.mark.parametrize("record", decisions(), ids=lambda record: record.stem)
def test_a_decision_record_is_complete(record: Path) -> None:
    text = record.read_text(encoding="utf-8")
    assert re.findall(r"^## (.+)$", text, re.MULTILINE) == ["Context", "Decision", "Consequences"]
    assert record.name in (record.parent / "index.md").read_text(encoding="utf-8")


def test_the_lock_names_no_address_and_hashes_everything() -> None:
    for name in ("requirements.lock", "peers.txt"):
        text = (ROOT / name).read_text(encoding="utf-8")
        entries = re.split(r"\n(?=\S)", text.strip())
        assert "://" not in text
        assert [entry for entry in entries if "==" not in entry or "--hash=sha256:" not in entry] == []


def test_what_is_depended_upon_is_used() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    extras = [name for names in project["optional-dependencies"].values() for name in names]
    names = {re.split(r"[<>=\[;]", name)[0] for name in [*project["dependencies"], *extras]}
    declared = {IMPORTED_AS.get(name, name) for name in names}
    text = "\n".join(file.read_text(encoding="utf-8") for file in BUILT_IN)
    assert {name for name in declared if not re.search(rf"^\s*(import|from) {name}\b", text, re.M)} == set()


def test_every_page_is_in_the_navigation() -> None:
    with (ROOT / "zensical.toml").open("rb") as file:
        navigation = str(tomllib.load(file)["project"]["nav"])
    docs = ROOT / "docs"
    pages = {page.relative_to(docs).as_posix() for page in docs.rglob("*.md")}
    assert {page for page in pages if f"'{page}'" not in navigation} == set()
