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


def has_its_test(file: Path, tree: ast.Module) -> Iterator[str]:
    """Every source file has a test where one looks for it."""
    if not file.is_relative_to(ROOT / "src") or file.name == "__main__.py":
        return
    places = places_of_its_test(file)
    if any(map(does_something, functions(tree))) and not any(place.exists() for place in places):
        yield f"has no test; expected {' or '.join(map(name_of, places))}"


def no_file_is_long(file: Path, tree: ast.Module) -> Iterator[str]:
    """A table is data, however long."""
    lines = len(file.read_text(encoding="utf-8").splitlines())
    if lines > LONGEST_FILE and "table" not in (file.stem, file.parent.name):
        yield f"has {lines} lines"


def no_function_is_long(file: Path, tree: ast.Module) -> Iterator[str]:
    """It fits a screen."""
    for found in functions(tree):
        lines = (found.end_lineno or 0) - found.lineno + 1
        if lines > LONGEST_FUNCTION:
            yield f"{found.name} has {lines} lines"


def it_says_why_it_is_there(file: Path, tree: ast.Module) -> Iterator[str]:
    """In its docstring."""
    if tree.body and not ast.get_docstring(tree):
        yield "a short prologue in prose is missing"


def what_is_public_has_a_docstring(file: Path, tree: ast.Module) -> Iterator[str]:
    """In what is built in; a test says it by its name."""
    public = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    for node in tree.body if file.is_relative_to(ROOT / "src") else ():
        if isinstance(node, public) and not node.name.startswith("_") and not ast.get_docstring(node):
            yield f"{node.name} has no docstring"


def no_name_is_an_empty_word(file: Path, tree: ast.Module) -> Iterator[str]:
    """Neither that of a class nor that of a file."""
    classes = [node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    for name in [*classes, file.stem.title()]:
        if EMPTY_WORDS.search(name):
            yield f"{name} says nothing"


def no_test_is_skipped_in_silence(file: Path, tree: ast.Module) -> Iterator[str]:
    """The reason is in `MAY_SKIP`."""
    marks = {"skip", "skipif", "xfail", "importorskip"}
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)} & marks
    if file.is_relative_to(TESTS) and used and name_of(file) not in MAY_SKIP:
        yield f"{used}: give the reason in MAY_SKIP"


RULES = (
    has_its_test,
    no_file_is_long,
    no_function_is_long,
    it_says_why_it_is_there,
    what_is_public_has_a_docstring,
    no_name_is_an_empty_word,
    no_test_is_skipped_in_silence,
)


def faults_of(file: Path) -> list[str]:
    """What each rule has against this file, which is read once for all of them."""
    tree = parsed(file)
    return [f"{name_of(file)}: {rule.__name__}: {fault}" for rule in RULES for fault in rule(file, tree)]


@pytest.mark.parametrize("folder", sorted({file.parent for file in FILES}), ids=name_of)
def test_every_file_of_a_folder_keeps_every_rule(folder: Path) -> None:
    assert [fault for file in FILES if file.parent == folder for fault in faults_of(file)] == []


WRONG = {
    "src/motorbus/untested.py": (
        '"""Why."""\n\nclass IdHandler:\n    def do(self) -> int:\n        return 1\n',
        ["has_its_test", "what_is_public_has_a_docstring", "no_name_is_an_empty_word"],
    ),
    "tests/test_long.py": (
        "import pytest\n\n@pytest.mark.skip\ndef test_it() -> None:\n" + "    assert 1\n" * 400,
        [
            "no_file_is_long",
            "no_function_is_long",
            "it_says_why_it_is_there",
            "no_test_is_skipped_in_silence",
        ],
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_breaks_a_rule_is_found(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, broken = WRONG[name]
    for place, folder in (("ROOT", ""), ("SOURCES", "src/motorbus"), ("TESTS", "tests")):
        monkeypatch.setitem(globals(), place, tmp_path / folder)
    file = tmp_path / name
    file.parent.mkdir(parents=True)
    file.write_text(text, encoding="utf-8")
    assert [fault.split(": ")[1] for fault in faults_of(file)] == broken


def test_every_rule_is_known_to_find_something() -> None:
    assert {rule for _, broken in WRONG.values() for rule in broken} == {rule.__name__ for rule in RULES}


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
