"""What the tests say of themselves in their source, for docs/reliability.md: rows, figures, and why no fault is needed.

Nothing is run for it: names, marks and parameters are read; which cases a test has, pytest says, which collects them.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from scripts import soaked

TESTS: Final = soaked.ROOT / "tests"
NAMED: Final = re.compile(r"^(?:async )?def (test_((?:[ld]\d+_)+)\w+)", re.M)
ROW: Final = re.compile(r"[ld]\d+")
PROCESSES: Final = (
    "tests/link/test_lock.py",
    "tests/motion/safety/test_killed.py",
    "tests/session/test_attended_frozen.py",
)
"""Files that are not tried without their fault."""
KILLED: Final = "it kills or stops a process of the system, and looks what became of that very process"
NO_FAULTS: Final = {
    "D8": "somebody asks for what is refused",
    "D9": "the same is written again",
    "D12": "a bus runs at another rate",
}
"""Rows in which nothing breaks. Those of their tests that stand among the tests of faults are judged all the same."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def of_rows() -> dict[str, list[str]]:
    """The tests of each row, by the names of their functions; one that names several rows is a test of each."""
    found: dict[str, list[str]] = {}
    for file in sorted(TESTS.rglob("test_*.py")):
        for name, rows in NAMED.findall(file.read_text("utf-8")):
            for row in ROW.findall(rows):
                found.setdefault(row.upper(), []).append(f"{_named(file)}::{name}")
    return found


def telling() -> Iterator[tuple[str, Function]]:
    """Every test that tells figures, with its name."""
    for file in sorted(TESTS.rglob("test_*.py")):
        text = file.read_text("utf-8")
        if "figures" in text:
            yield from (
                (f"{_named(file)}::{one.name}", one) for one in _tests(text) if "figures" in taken(one)
            )


def cases() -> list[str]:
    """Every case of the tests that tell figures, as long runs have them. Raises RuntimeError where pytest cannot say.

    Collecting them takes some seconds; whoever tells figures in no long run has no case here.
    """
    names = list(dict.fromkeys(name for name, _ in telling()))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--collect-only", "-q", "--soak", "-p", "no:cacheprovider", *names],
        cwd=soaked.ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(
            f"pytest cannot say which cases there are:\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        )
    return [line for line in done.stdout.splitlines() if line.partition("[")[0] in names]


def taken(function: Function) -> set[str]:
    """The fixtures and parameters that a test takes."""
    return {one.arg for one in (*function.args.args, *function.args.kwonlyargs)}


def exempt() -> dict[str, list[str]]:
    """What may pass while its fault is switched off, by the reason why: files, rows, and tests with the mark."""
    found = {KILLED: list(PROCESSES)}
    for row, why in NO_FAULTS.items():
        found.setdefault(why, []).append(f"{row}, outside of tests/faults")
    for file in sorted(TESTS.rglob("test_*.py")):
        text = file.read_text("utf-8")
        if "mark.faultless" in text:
            for where, why in _marked(text):
                found.setdefault(why, []).append(f"{_named(file)}{where}")
    return found


def _marked(text: str) -> Iterator[tuple[str, str]]:
    """Where the mark stands in a file, and the reason that it gives; one for the whole file stands nowhere in it."""
    tree = ast.parse(text)
    for one in tree.body:
        if isinstance(one, ast.Assign) and ast.unparse(one.targets[0]) == "pytestmark":
            yield from (("", why) for why in _reasons(one.value))
    for test in _tests(text):
        for decorator in test.decorator_list:
            whole = ast.unparse(decorator).startswith("pytest.mark.faultless")
            where = f"::{test.name}" if whole else f"::{test.name}, some of its cases"
            yield from ((where, why) for why in _reasons(decorator))


def _reasons(tree: ast.AST) -> Iterator[str]:
    for one in ast.walk(tree):
        if isinstance(one, ast.Call) and ast.unparse(one.func) == "pytest.mark.faultless":
            (why,) = one.args
            assert isinstance(why, ast.Constant), f"a reason is a text: {ast.unparse(one)}"
            yield str(why.value)


def _tests(text: str) -> Iterator[Function]:
    for one in ast.walk(ast.parse(text)):
        if isinstance(one, Function) and one.name.startswith("test_"):
            yield one


def _named(file: Path) -> str:
    return str(file.relative_to(soaked.ROOT))
