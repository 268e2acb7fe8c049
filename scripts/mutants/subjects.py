"""What is tried: the modules of scripts/mutants.toml, their files and fast tests, and every fault of them."""

from __future__ import annotations

import ast
import random
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from scripts.mutants.changes import Mutant, mutants

ROOT = Path(__file__).resolve().parent.parent.parent
DATA = ROOT / "scripts" / "mutants.toml"


class Subject(NamedTuple):
    """A module that is tried: its files, its test files, the longest that a fast test may last (s), and reasons.

    `reasons` say of faults that no test notices why that is so, by the names of these faults.
    """

    name: str
    files: tuple[str, ...]
    tests: tuple[str, ...]
    longest: float
    reasons: dict[str, str]


class Fault(NamedTuple):
    """A mutant of a file, and the tree that it is a change of."""

    file: str
    tree: ast.Module
    mutant: Mutant

    @property
    def name(self) -> str:
        """Its file and its name there: what a reason is kept under."""
        return f"{Path(self.file).name} {self.mutant.name}"

    @property
    def path(self) -> str:
        """The file as code objects name it."""
        return str(ROOT / self.file)


class Verdict(NamedTuple):
    """What became of a fault: noticed by that test, by "time" when it came to no end; "" when by none."""

    fault: str
    by: str


class Wish(NamedTuple):
    """How much is tried and how: only names with a text in them, or all with the module imported anew.

    `tables` is the share (0 to 1) that is tried, by chance, of what a module does while it is imported: its tables,
    constants and defaults, each of which takes a process that imports everything anew.
    With `swapped` what survives is not tried once more with a new import, and counts as surviving: a lower bound, soon.
    `known` are tests that have noticed faults in an earlier run, by the faults; these are not tried again.
    """

    only: str = ""
    anew: bool = False
    tables: float = 1.0
    swapped: bool = False
    at_once: int = 2
    known: Mapping[str, str] = {}
    tell: Callable[[str], None] = lambda _: None


def subjects() -> dict[str, Subject]:
    """All of them, by name. Raises ValueError for a file or test that is not there."""
    told = tomllib.loads(DATA.read_text(encoding="utf-8"))
    return {name: _subject(name, one) for name, one in told.items()}


def _subject(name: str, told: dict[str, object]) -> Subject:
    files, tests = (_found(name, told[key]) for key in ("files", "tests"))
    longest, reasons = told.get("longest", 0.5), told.get("survivors", {})
    assert isinstance(longest, float)
    assert isinstance(reasons, dict)
    return Subject(name, files, tests, longest, reasons)


def _found(name: str, patterns: object) -> tuple[str, ...]:
    assert isinstance(patterns, list)
    found: dict[str, None] = {}
    for pattern in patterns:
        paths = sorted(ROOT.glob(pattern))
        if not paths:
            raise ValueError(f"{name}: there is no {pattern}")
        found |= dict.fromkeys(path.relative_to(ROOT).as_posix() for path in paths)
    return tuple(found)


def faults(subject: Subject, wish: Wish) -> list[Fault]:
    """All that are to be tried; a share of them is the same one as long as the files stay as they are."""
    found = []
    for file in subject.files:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        found += [Fault(file, tree, one) for one in mutants(tree)]
    found = [one for one in found if wish.only in one.name]
    at_import = [one.name for one in found if not one.mutant.swapped]
    tables = set(random.Random(1).sample(at_import, round(len(at_import) * wish.tables)))
    return [one for one in found if one.mutant.swapped or one.name in tables]
