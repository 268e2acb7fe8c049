"""The tests of the net and their helpers name nothing of the engine and nothing private, so they outlast both."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from tests.net import ADAPTERS, NET, ROOT

ENGINE = {"turns", "relay", "stopper"}
"""Attributes of a bus that belong to its engine."""
STANDARD = {"_asdict", "_exit", "_fields", "_make", "_replace"}
"""Documented names of the standard library."""


def sources() -> Iterator[tuple[Path, ast.Module]]:
    """The tests of the net, and every file of `tests` that one of them imports."""
    found = [ROOT / path for path in (*NET, "tests/support", "tests/conftest.py", "tests/cli/conftest.py")]
    files = {file for path in found for file in (path.rglob("*.py") if path.is_dir() else [path])}
    waiting, seen = sorted(file for file in files if file.exists()), set[Path]()
    while waiting:
        file = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        tree = ast.parse(file.read_text(encoding="utf-8"))
        yield file, tree
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tests"):
                named = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
                paths = (ROOT / f"{name.replace('.', '/')}.py" for name in named if name)
                waiting += [path for path in paths if path.exists()]


def defined(tree: ast.Module) -> set[str]:
    """Names that this file defines itself, attributes of its own classes included."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    names = {node.name for node in ast.walk(tree) if isinstance(node, kinds)}
    names |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    stored = (
        node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
    )
    return names | {
        node.attr for node in stored if isinstance(node.value, ast.Name) and node.value.id == "self"
    }


def offence(node: ast.AST, own: set[str]) -> str | None:
    """What this node names that it must not."""
    if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "motorbus":
        names = [f"{node.module}.{alias.name}" for alias in node.names]
    elif isinstance(node, ast.Import):
        names = [alias.name for alias in node.names if alias.name.partition(".")[0] == "motorbus"]
    elif isinstance(node, ast.Constant):  # a string: the code of a child process, the target of a patch
        return "motorbus.bus." if "motorbus.bus." in str(node.value) else None
    elif isinstance(node, ast.Attribute):
        private = node.attr.startswith("_") and not node.attr.startswith("__")
        hidden = node.attr in ENGINE or (private and node.attr not in own | STANDARD)
        return f".{node.attr}" if hidden else None
    else:
        return None
    wrong = (name for name in names if name.startswith("motorbus.bus") or "._" in name.replace(".__", "."))
    return next(wrong, None)


def test_the_net_names_no_engine_and_nothing_private() -> None:
    adapters = {ROOT / path for path in ADAPTERS}
    found: list[str] = []
    for path, tree in sources():
        if path in adapters:
            continue
        own = defined(tree)
        named = ((node, offence(node, own)) for node in ast.walk(tree))
        place = path.relative_to(ROOT)
        found += [f"{place}:{getattr(node, 'lineno', 0)}: {name}" for node, name in named if name]
    advice = "use a public name, or a function of tests/support/world.py"
    assert not found, "\n".join((advice, *sorted(found)))
