"""What `python -m scripts.mutants` does: which faults it knows, that it notices what tests notice, that its page is so.

The trial itself is long (`python -m scripts.mutants --keep`); here one small file is tried with a few faults.
"""

from __future__ import annotations

import ast
import os
from time import process_time
from typing import Any

import pytest

from scripts.mutants import forks, inside, record
from scripts.mutants.changes import mutants
from scripts.mutants.subjects import ROOT, Subject, Verdict, Wish, faults, subjects
from scripts.mutants.trial import trial

ABORT = Subject(
    "abort",
    ("src/motorbus/families/kst/wire/abort.py",),
    ("tests/families/kst/test_wire_abort.py",),
    0.5,
    {},
)


def after(source: str) -> set[str]:
    """What the one place that is changed becomes."""
    return {one.name.partition(": ")[2].partition(" → ")[2] for one in mutants(ast.parse(source))}


@pytest.mark.parametrize(
    ("body", "wanted"),
    [
        ("return a < b", {"return a <= b", "return a >= b", "return None"}),
        ("return a and b", {"return a or b", "return a", "return b", "return None"}),
        ("return a + b", {"return a - b", "return None"}),
        ("return a[1:b]", {"return a[:b]", "return a[1:]", "return a[2:b]", "return a[0:b]", "return None"}),
        ("return min(a, b)", {"return max(a, b)", "return None"}),
        ("return -a", {"return a", "return None"}),
        ("a.b = c", {"nothing"}),
        ("a += c", {"a -= c", "nothing"}),
        ("raise a", {"nothing"}),
        ("return a['b']", {"return a['b_']", "return None"}),
        ("return True", {"return False"}),
        ("return b'ab'", {"return b'ac'"}),
        ("return 0.5", {"return 1.0", "return 0.25"}),
        ("if a(): b = c", {"not a()"}),
        ("if not a(): b = c", {"a()"}),
        ("for a in b: c = a", {"()"}),
        ("return [a for a in b if a]", {"return [a for a in b if not a]", "return None"}),
        ("try: a = b\n except c: a = d", {"except (): a = d"}),
        ("with suppress(a): b = c", {"suppress()"}),
    ],
)
def test_what_becomes_of_a_statement(body: str, wanted: set[str]) -> None:
    assert after(f"def f(a, b, c):\n {body}\n") == wanted


@pytest.mark.parametrize(
    "source",
    [
        '"""Why."""\nimport a',
        "def f(a: 'b') -> 'c':\n 'Why.'\n assert a",
        "class C:\n __slots__ = ('a',)",
        "a = 'words for people'",
        "A: TypeAlias = b[1]",
        "T = TypeVar('T')",
        "if TYPE_CHECKING:\n a = 1",
    ],
)
def test_what_no_run_can_show_is_left_alone(source: str) -> None:
    assert mutants(ast.parse(source)) == []


def test_each_fault_has_a_name_of_its_own_and_leaves_the_tree_as_it_was() -> None:
    told = faults(ABORT, Wish())
    assert len({fault.name for fault in told}) == len(told) > 60
    for fault in told[-12:]:
        before = ast.dump(fault.tree)
        fault.mutant.code(fault.tree, fault.path)
        assert ast.dump(fault.tree) == before


def test_a_name_outlives_the_lines_around_it() -> None:
    source = "class C:\n def f(self):\n  return 1\n"
    (one, *_), (other, *_) = mutants(ast.parse(source)), mutants(ast.parse(f"import a\n\n{source}"))
    assert one.name == other.name == "C.f: return 1 → return 2"
    assert one.lines != other.lines


@pytest.mark.parametrize(
    ("source", "inside"),
    [
        ("def f(a):\n return a", True),
        ("def f(a):\n a.b = c", True),
        ("class C:\n def f(self, a):\n  return a", True),
        ("a.b = c", False),
        ("class C:\n a: int = 1", False),
        ("def f(a=1):\n pass", False),
    ],
)
def test_what_is_in_the_body_of_a_function_takes_no_new_import(source: str, inside: bool) -> None:
    """Else a share of tables would be a share of the statements of functions, too."""
    found = mutants(ast.parse(f"{source}\n"))
    assert found
    assert {one.swapped for one in found} == {inside}


# --- processes ----------------------------------------------------------------------------------------------------


def test_a_child_tells_its_result_and_one_that_dies_none() -> None:
    def work(job: int) -> int:
        return job * job if job else os._exit(3)

    assert dict(forks.each(range(4), work, 1.0)) == {0: None, 1: 1, 2: 4, 3: 9}


def test_a_child_that_comes_to_no_end_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forks, "START", 0.05)
    unread, _ = os.pipe()
    assert list(forks.each(["never"], lambda _: os.read(unread, 1), 0.0)) == [("never", None)]


class Slow:
    """In place of a test that is the first to need what others have found imported."""

    nodeid = "slow"

    def __init__(self) -> None:
        self.config = self.hook = self

    def pytest_runtest_protocol(self, **_: object) -> None:
        begun = process_time()
        while process_time() < begun + 1.0:
            pass


def test_a_test_that_is_slow_because_it_is_the_first_has_not_noticed_anything() -> None:
    def work(item: Any) -> str:
        return inside._Tests().run([item], {"slow": 0.001})

    ((_, by),) = forks.each([Slow()], work, 20.0)
    assert by == ""


def test_a_trial_says_which_test_noticed_and_which_fault_none() -> None:
    """One fault in a function, one in a table that is made at import, and one that changes nothing."""
    swapped, anew = "abort_text: return ABORTS[code] → return None", "84082688 → 84082689"
    alike = "abort_text: 0 <= code <= 4294967295 → 0 < code <= 4294967295"
    found: dict[str, str] = {}
    for name in (swapped, anew, alike):
        found |= {one.fault: one.by for one in trial(ABORT, Wish(only=f"abort.py {name}"))}
    assert set(found) == {f"abort.py {name}" for name in (swapped, anew, alike)}
    assert [name for name, by in found.items() if not by] == [f"abort.py {alike}"]
    noticed = (found[f"abort.py {swapped}"], found[f"abort.py {anew}"])
    assert all(by.startswith("tests/families/kst/test_wire_abort.py::") for by in noticed)


# --- what is kept of it -------------------------------------------------------------------------------------------


def test_what_survives_needs_a_reason_and_a_reason_something_that_survives() -> None:
    told = record.outcome([Verdict("a", "test_x"), Verdict("b", ""), Verdict("c", "time")], 3)
    assert (told["there are"], told["faults"], told["noticed"], told["without end"]) == (3, 3, 2, 1)
    subject = ABORT._replace(reasons={"c": "it does the same"})
    said = list(record.complaints(subject, told))
    assert [line for line in said if "66.6 % of the faults are noticed" in line]
    assert [line for line in said if "nobody says why: b" in line]
    assert [line for line in said if "does not survive: c" in line]
    assert list(record.complaints(ABORT._replace(reasons={"b": "x"}), {**told, "noticed": 3})) == []


def test_the_page_says_what_was_tried_by_an_older_script() -> None:
    told = record.outcome([Verdict("a", "test_x")], 1)
    assert record.OLDER not in record.page({"abort": ABORT}, {"abort": told})
    del told["rules"]
    assert f"{record.OLDER}`abort`.\n" in record.page({"abort": ABORT}, {"abort": told})


def test_the_page_is_made_of_what_is_kept() -> None:
    known, told = subjects(), record.kept()
    assert record.PAGE.read_text(encoding="utf-8") == record.page(known, told)
    assert set(told) <= set(known)


@pytest.fixture(scope="module")
def there_are() -> dict[str, list[str]]:
    """The names of all faults today, by subject."""
    return {name: [one.name for one in faults(subject, Wish())] for name, subject in subjects().items()}


def test_every_reason_is_of_a_fault_that_there_is(there_are: dict[str, list[str]]) -> None:
    """Else the line was changed since, and what was said of it is of nothing."""
    for name, subject in subjects().items():
        assert subject.reasons.keys() <= set(there_are[name])


CHANGED_SINCE: set[str] = set()
"""Subjects that have more or fewer faults today than when they were tried; none is to be added."""


def test_what_is_kept_is_of_the_files_as_they_are(there_are: dict[str, list[str]]) -> None:
    """Else a module was changed since, and what is new in it has had no trial: `--keep` with its name tries it."""
    kept = {name: told["there are"] for name, told in record.kept().items()}
    assert {name for name, names in there_are.items() if len(names) != kept[name]} == CHANGED_SINCE


def test_whatever_keeps_motion_safe_is_tried() -> None:
    """But for the package itself, which only says what is in it."""
    safety = {path.relative_to(ROOT).as_posix() for path in ROOT.glob("src/motorbus/motion/safety/**/*.py")}
    tried = {file for subject in subjects().values() for file in subject.files}
    assert safety - tried == {"src/motorbus/motion/safety/__init__.py"}


def test_every_survivor_has_its_reason() -> None:
    known = subjects()
    assert [
        line for name, told in record.kept().items() for line in record.complaints(known[name], told)
    ] == []
