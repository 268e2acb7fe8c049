"""Rules of procedures that only a look at the code can hold: where they may await, and what they may not use."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import motorbus

SOURCE = Path(motorbus.__file__).parent
FILES = [
    path for folder in ("core", "families", "motion") for path in sorted((SOURCE / folder).rglob("*.py"))
]
FORBIDDEN = {
    "asynccontextmanager": "its clean-up is lost when `enter` is interrupted; write a Guard",
    "contextvars": "a procedure runs in no context of its own",
    "current_task": "a procedure is no task of asyncio",
    "asyncio": "time belongs to the link",
}
INTERRUPTIONS = {"BaseException", "GeneratorExit", "KeyboardInterrupt", "SystemExit", "CancelledError"}
AWAITS = (ast.Await, ast.AsyncWith, ast.AsyncFor)


def awaits_where_cleanup_is_lost(node: ast.AST, place: str = "") -> Iterator[tuple[int, str]]:
    """Line and place of each `await` in a bare `finally`, or where an interruption is caught."""
    if isinstance(node, AWAITS) and place:
        yield node.lineno, place
    if isinstance(node, ast.comprehension) and node.is_async and place:
        yield node.target.lineno, place
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
        place = ""
    for field, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST):
                continue
            inside = place
            if isinstance(node, ast.Try | ast.TryStar) and field == "finalbody":
                inside = "finally"
            elif isinstance(child, ast.ExceptHandler):
                caught = "BaseException" if child.type is None else ast.unparse(child.type)
                names = {name.strip("() ").split(".")[-1] for name in caught.split(",")}
                inside = f"except {caught}" if names & INTERRUPTIONS else place
            yield from awaits_where_cleanup_is_lost(child, inside)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_a_procedure_cleans_up_in_guards_only(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    guards = {node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == "Guard"}
    found = [one for node in tree.body if node not in guards for one in awaits_where_cleanup_is_lost(node)]
    assert found == []
    for node in ast.walk(tree):
        if isinstance(node, ast.AsyncFunctionDef):
            own = [one for one in ast.walk(node) if isinstance(one, ast.Yield)]
            assert own == [], f"{node.name} is an async generator"
        name = getattr(node, "id", getattr(node, "attr", getattr(node, "name", "")))
        assert name not in FORBIDDEN, FORBIDDEN[name]
