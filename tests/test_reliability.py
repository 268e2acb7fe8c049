"""The page on reliability is the one that its figures make, and new figures take the place of old ones."""

from __future__ import annotations

import ast
import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from scripts import reliability, soaked, tests_told
from scripts.fault_rows import ROWS

COMMIT = soaked.commit
CROWDS = ("threads-virtual", "threads-pseudo-terminal", "tasks-virtual", "tasks-pseudo-terminal")


@pytest.fixture
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Figures and page are somewhere else for once."""
    monkeypatch.setattr(soaked, "FRESH", tmp_path / "build" / "soak.jsonl")
    monkeypatch.setattr(soaked, "KEPT", tmp_path / "reliability.json")
    monkeypatch.setattr(soaked, "commit", lambda: "0123456789")
    monkeypatch.setattr(reliability, "PAGE", tmp_path / "reliability.md")
    monkeypatch.setattr(tests_told, "cases", lambda: [name for name, _ in tests_told.telling()])
    return tmp_path


def written(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> str:
    monkeypatch.setattr("sys.argv", ["reliability", *arguments])
    assert reliability.main() == 0
    return reliability.PAGE.read_text("utf-8")


def test_the_page_is_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["reliability", "--check"])
    assert reliability.main() == 0, "python -m scripts.reliability makes it"


def test_what_a_run_tells_is_on_the_page(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    soaked.record(
        "L7 late replies", family="kst", promise=3, test="tests/x.py::y[a|b]", exchanges=12345, wrong=0
    )
    page = written(monkeypatch, "--take")
    part = page[page.index("## Promise 3") : page.index("## Promise 4")]
    assert "| L7 late replies | kst | exchanges 12 345, wrong 0 | `tests/x.py::y` 2" in part


def test_figures_come_in_one_order(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    soaked.record("one", longest=0.123456, wrong=1, held="8 KiB", seed=4)
    assert "| seed 4, wrong 1, longest 0.1235, held 8 KiB |" in written(monkeypatch, "--take")


def test_a_newer_run_takes_the_place_of_an_older_one(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    soaked.record("L9 garbage", family="kst", promise=6, wrong=1)
    soaked.record("L9 garbage", family="feetech", promise=6, wrong=2)
    written(monkeypatch, "--take")
    soaked.FRESH.unlink()
    soaked.record("L9 garbage", family="kst", promise=6, wrong=3)
    page = written(monkeypatch, "--take")
    assert ("wrong 1" in page, "wrong 2" in page, "wrong 3" in page) == (False, True, True)


def test_many_of_a_kind_are_one_row(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, kind in enumerate(("ping", "read", "write", "action")):
        soaked.record(
            f"L1 faults, {kind}, toward us",
            family="kst",
            test=f"t.py::x[{kind}]",
            faults=10,
            wrong=0,
            longest_s=number,
        )
    soaked.record("L1 faults, else", family="kst", test="u.py::y", faults=7, wrong=0, longest_s=9)
    page = written(monkeypatch, "--take")
    assert "| L1 faults, toward us | kst | kinds 4, faults 40, wrong 0, longest s 3 | `t.py::x` 2" in page
    assert "| L1 faults, else | kst | faults 7, wrong 0, longest s 9 | `u.py::y` 2" in page


@pytest.mark.parametrize("flags", [(), ("--dirty",)])
def test_figures_of_files_that_differ_are_taken_only_by_whoever_says_so(
    flags: tuple[str, ...], apart: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    soaked.record("L9 garbage", test="t.py::clean", wrong=1)
    monkeypatch.setattr(soaked, "commit", lambda: "abc+")
    soaked.record("L8 echoes", test="t.py::dirty", wrong=2)
    monkeypatch.setattr("sys.argv", ["reliability", "--take", *flags])
    assert reliability.main() == (0 if flags else reliability.REFUSED)
    assert (reliability.PAGE.exists(), soaked.KEPT.exists()) == (bool(flags),) * 2
    said = capsys.readouterr().err
    assert ("1 of 2 figures were measured with files that differ from abc" in said) is not bool(flags)
    assert ("t.py::dirty" in said) is not bool(flags)


def test_a_long_run_begins_anew_and_says_at_once_that_its_figures_will_not_be_taken(
    apart: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(soaked, "ROOT", apart)
    soaked.record("L9 garbage", wrong=1)
    assert soaked.begin() == ""
    assert soaked.fresh() == []
    monkeypatch.setattr(soaked, "commit", lambda: "abc+")
    assert "files differ from abc: figures are printed and kept in build/soak.jsonl" in soaked.begin()
    assert soaked.begin("--dirty") == ""


def test_without_being_told_to_it_takes_nothing_over(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    soaked.record("L9 garbage", wrong=1)
    assert "L9 garbage" not in written(monkeypatch)


def test_rows_come_in_the_order_of_the_matrix() -> None:
    names = ("else", "D1 b", "L10 c", "L2 d")
    runs = [{"what": what, "family": "", "promise": 0} for what in names]
    assert [run["what"] for run in soaked.merged([], runs)] == ["L2 d", "L10 c", "D1 b", "else"]


def test_a_page_that_is_behind_is_noticed(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(monkeypatch)
    soaked.KEPT.write_text(json.dumps({"format": 1, "runs": [soaked.record("new", wrong=0)]}), "utf-8")
    monkeypatch.setattr("sys.argv", ["reliability", "--check"])
    assert reliability.main() == 1


def test_figures_name_the_commit_they_belong_to(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soaked, "commit", COMMIT)
    assert soaked.record("one", wrong=0)["commit"] == COMMIT()
    assert [run["what"] for run in soaked.fresh()] == ["one"]


def test_a_file_that_differs_is_a_plus_but_not_what_a_long_run_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*words: str) -> None:
        who = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    monkeypatch.setattr(soaked, "ROOT", tmp_path)
    assert COMMIT() == "", "outside a repository"
    (tmp_path / "docs").mkdir()
    for name in ("docs/reliability.md", "docs/reliability.json", "code.py"):
        (tmp_path / name).write_text("1")
    git("init")
    git("add", ".")
    git("commit", "--message", "one")
    clean = COMMIT()
    assert len(clean) == 10
    for name in ("docs/reliability.md", "docs/reliability.json"):
        (tmp_path / name).write_text("2")
    assert COMMIT() == clean
    (tmp_path / "code.py").write_text("2")
    assert COMMIT() == f"{clean}+"


def test_every_kind_of_fault_has_its_tests() -> None:
    found = tests_told.of_rows()
    assert [row for row in ROWS if row not in found] == []
    assert [row for row in found if row not in ROWS] == []


def test_the_rows_are_those_of_the_matrix() -> None:
    assert list(ROWS) == [*(f"L{n}" for n in range(1, 19)), *(f"D{n}" for n in range(1, 16))]


def test_whoever_tells_figures_is_in_the_long_runs_which_bring_them_to_the_page() -> None:
    told = dict(tests_told.telling())
    assert len(told) > 40
    never = [
        name
        for name, one in told.items()
        if "rounds" not in tests_told.taken(one)
        and not any("soak" in ast.unparse(mark) for mark in one.decorator_list)
    ]
    assert never == []


def test_a_figure_that_is_0_was_counted() -> None:
    zeros = [
        f"{name}: {word.arg}"
        for name, one in tests_told.telling()
        for call in ast.walk(one)
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "figures"
        for word in call.keywords
        if word.arg != "promise" and isinstance(word.value, ast.Constant) and word.value.value == 0
    ]
    assert zeros == []


def test_a_test_that_names_several_rows_stands_under_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources(tmp_path, monkeypatch, "def test_l3_l4_two(): ...\n", "async def test_l15_d15_frozen(): ...\n")
    assert tests_told.of_rows() == {
        "L3": ["tests/test_0.py::test_l3_l4_two"],
        "L4": ["tests/test_0.py::test_l3_l4_two"],
        "L15": ["tests/test_1.py::test_l15_d15_frozen"],
        "D15": ["tests/test_1.py::test_l15_d15_frozen"],
    }


def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *texts: str) -> None:
    """The tests are these for once."""
    monkeypatch.setattr(soaked, "ROOT", tmp_path)
    monkeypatch.setattr(tests_told, "TESTS", tmp_path / "tests")
    (tmp_path / "tests").mkdir()
    for number, text in enumerate(texts):
        (tmp_path / "tests" / f"test_{number}.py").write_text(text, "utf-8")


def test_a_long_run_without_figures_is_seen_to_be_absent(
    apart: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources(apart, monkeypatch, "def test_a(rounds, figures): ...\ndef test_b(rounds, figures): ...\n")
    soaked.record("A", test="tests/test_0.py::test_a[1]", wrong=0)
    page = written(monkeypatch, "--take")
    part = page[page.index("## Not measured at length yet") : page.index("## What may pass")]
    assert "| `tests/test_0.py::test_b` | 1 of 1 |  |" in part
    soaked.record("A", test="tests/test_0.py::test_a", wrong=0)
    soaked.record("B", test="tests/test_0.py::test_b", wrong=0)
    assert "None: every case of every long run has figures" in written(monkeypatch, "--take")


def parametrized(monkeypatch: pytest.MonkeyPatch, **count: int) -> None:
    """These tests have so many cases for once."""
    names = [f"t.py::{test}[{number}|]" for test, many in count.items() for number in range(many)]
    monkeypatch.setattr(tests_told, "cases", lambda: names)


def test_a_case_of_a_long_run_without_figures_is_seen_to_be_absent(
    apart: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parametrized(monkeypatch, a=3, b=2, c=1)
    for case in ("a[0|]", "c[0|]"):
        soaked.record(f"L1 {case}", test=f"t.py::{case}", wrong=0)
    part = written(monkeypatch, "--take").partition("## Not measured at length yet")[2]
    assert "4 of the 6 cases of long runs" in part
    assert "| `t.py::a` | 2 of 3 | `1\\|`<br>`2\\|` |" in part
    assert "| `t.py::b` | 2 of 2 |  |" in part
    assert "t.py::c" not in part


def test_a_sum_of_some_kinds_says_of_how_many(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parametrized(monkeypatch, some=16, all=4, parted=9)
    for number in range(4):
        figures: dict[str, Any] = {"cuts": 10, "neither_but_told": 1}
        for test in ("some", "all"):
            what = f"D10 {test}, {number}"
            soaked.record(what, promise=4, test=f"t.py::{test}[{number}|]", **figures)
        for half in (0, 4):
            soaked.record(f"D10 {half}, {number}", test=f"t.py::parted[{half + number}|]", cuts=2)
            soaked.record(f"D10 both {half}, {number}", test="t.py::parted[0|]", cuts=3)
    page = " ".join(written(monkeypatch, "--take").split())
    assert "| D10 some | | kinds 4 of 16, cuts 40, " in page
    assert "| D10 all | | kinds 4, cuts 40, " in page
    assert "| D10 0 | | kinds 4, cuts 8 |" in page, "of how many is not known where a test has several rows"
    assert "| D10 both 0 | | kinds 4, cuts 12 |" in page, "nor where one case tells several runs"
    assert "after 4 of 40 cuts and after 4 of 40 cuts (4 of 16 kinds).**" in page


def test_the_cases_of_a_test_are_those_that_long_runs_have(monkeypatch: pytest.MonkeyPatch) -> None:
    told = dict(tests_told.telling())
    names = [name for name in told if "/test_switched_off.py" in name or "/test_crowd.py" in name]
    monkeypatch.setattr(tests_told, "telling", lambda: iter([(name, told[name]) for name in names]))
    crowd = "tests/faults/test_crowd.py::test_l16_a_crowd_"
    assert sorted(tests_told.cases()) == [
        *(f"{crowd}on_one_bus[{kind}]" for kind in sorted(CROWDS)),
        f"{crowd}where_several_fly_at_once",
        "tests/faults/test_switched_off.py::test_no_test_of_a_fault_passes_without_its_fault[all]",
    ]


def test_cases_that_cannot_be_collected_are_no_empty_list(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", "false")
    with pytest.raises(RuntimeError, match="cannot say which cases there are"):
        tests_told.cases()


def test_whoever_needs_no_fault_is_on_the_page_with_the_reason(
    apart: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    some = '@pytest.mark.parametrize("a", [pytest.param(1, marks=pytest.mark.faultless("not lost")), 2])\n'
    whole = '@pytest.mark.faultless("why one")\ndef test_one(): ...\n'
    sources(
        apart,
        monkeypatch,
        'pytestmark = pytest.mark.faultless("why all")\n',
        f"{whole}{some}def test_two(a): ...",
    )
    part = written(monkeypatch).partition("## What may pass")[2]
    assert "| why all | `tests/test_0.py` |" in part
    assert "| why one | `tests/test_1.py::test_one` |" in part
    assert "| not lost | `tests/test_1.py::test_two, some of its cases` |" in part
    for name in (*tests_told.PROCESSES, *tests_told.NO_FAULTS):
        assert f"`{name}" in part


def test_every_mark_of_that_kind_is_found() -> None:
    """As many as there are in the text: one that is put on in another way would be left out, and told nowhere."""
    told = [one for why, left in tests_told.exempt().items() for one in left if why != tests_told.KILLED]
    files = [file for file in tests_told.TESTS.rglob("test_*.py") if file != Path(__file__)]
    marks = sum(file.read_text("utf-8").count("mark.faultless(") for file in files)
    assert len(told) - len(tests_told.NO_FAULTS) == marks


def test_a_deviation_is_told_with_its_figures(apart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for byte, neither in enumerate((12, 3)):
        soaked.record(
            f"D10 write cut, {byte}", family="stepper", promise=4, cuts=20_000, neither_but_told=neither
        )
    said = " ".join(written(monkeypatch, "--take").partition("## Promise 4")[2].partition("|")[0].split())
    assert said.startswith("**One deviation from what was asked")
    assert "is left neither old nor new after 15 of 40 000 cuts.**" in said
