"""check, estimate and order: what they print, in prose and as JSON, and with which code they end."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.families.stepper.program.projects import MOTOR, file
from tests.families.stepper.vectors import DUMP_B


@pytest.fixture
def dump(tmp_path: Path) -> str:
    path = tmp_path / "b.bin"
    path.write_bytes(DUMP_B)
    return str(path)


@pytest.fixture
def broken(tmp_path: Path) -> str:
    """A program without a start frequency."""
    path = tmp_path / "broken.toml"
    path.write_text(file().replace('start = "200 Hz"', ""), encoding="utf-8")
    return str(path)


def test_a_good_program_has_no_findings(run: Run) -> None:
    ran = run("stepper", "check", EXAMPLE)
    assert (ran.code, ran.out) == (0, "no findings\n")


def test_findings_are_told_with_rule_and_reason(run: Run, dump: str) -> None:
    ran = run("stepper", "check", dump)
    assert ran.code == 0  # warnings only
    for word in ("L11", "L3", "warning", "72721.9 pulses", "the rest is lost"):
        assert word in ran.out
    assert run("stepper", "check", "--strict", dump).code == 1


def test_an_error_is_a_failure(run: Run, broken: str) -> None:
    ran = run("stepper", "check", EXAMPLE, broken, "--json")
    assert ran.code == 1
    assert ran.document["schema"] == "motorbus.stepper.check/1"
    (found,) = ran.document["findings"]
    assert (found["rule"], found["level"], found["step"], found["file"]) == ("L5", "error", 1, broken)


def test_conditions_are_heeded(run: Run) -> None:
    ran = run("stepper", "check", "--unattended", "--highest", "1000", "--json", EXAMPLE)
    assert {one["rule"] for one in ran.document["findings"]} == {"L22", "L4"}


def test_an_estimate_is_one_line(run: Run) -> None:
    assert run("stepper", "estimate", EXAMPLE).out.startswith("at least 52.8 s + 6 waits (")


def test_several_are_told_by_their_files(run: Run, dump: str) -> None:
    ran = run("stepper", "estimate", EXAMPLE, dump)
    lines = ran.out.splitlines()
    assert [line.split(": ")[0] for line in lines] == [EXAMPLE, dump]
    facts = run("stepper", "estimate", EXAMPLE, dump, "--json").document["estimates"]
    assert [one["waits"] for one in facts] == [6, 6]
    assert facts[1]["seconds"] == pytest.approx(41.613525, abs=1e-6)


def test_readings_change_an_estimate(run: Run, dump: str) -> None:
    facts = run("stepper", "estimate", "--ramp", "pulse", "--seg-loop=extra", "--json", dump).document[
        "estimates"
    ]
    assert facts[0]["waits"] == 9


def test_the_order_is_written_out(run: Run, dump: str) -> None:
    assert run("stepper", "order", dump).out == "1 2 3 2 3  (3 times)\n"
    document = run("stepper", "order", "--json", dump).document
    assert document["programs"] == [{"file": dump, "order": [1, 2, 3, 2, 3], "passes": 3}]


def test_how_often_is_said(run: Run, tmp_path: Path) -> None:
    for repeat, said in (("0", "(once)"), ('"endless"', "(until it is stopped)")):
        path = tmp_path / "p.toml"
        path.write_text(file(top=f"repeat = {repeat}"), encoding="utf-8")
        assert run("stepper", "order", str(path)).out == f"1  {said}\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("check",), "no file is given"),
        (("estimate", "nowhere.toml"), "cannot be read"),
        (("estimate", "--ramp", "jerk", EXAMPLE), "time, pulse"),
        (("order", "--colour", "red", EXAMPLE), "there is no --colour"),
    ],
)
def test_what_cannot_be_ends_with_2(run: Run, words: tuple[str, ...], says: str) -> None:
    ran = run("stepper", *words)
    assert (ran.code, ran.out) == (2, "")
    assert says in ran.err


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (file(steps=11), "the file has 11 steps"),
        (file(motor=MOTOR.replace("1.8 deg", "2.56 deg")), "2.55°"),
        (file('delay = "4 h 40 min"'), "4 h 39 min 37.215 s"),
        (file("wait_for = 3"), "step 1, start_input: 3"),
        (file(top="project = 5"), "project: 5"),
        ("format = [", "is no TOML"),
    ],
)
def test_a_bad_file_is_one_message_with_its_name(run: Run, tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    ran = run("stepper", "check", str(path))
    assert (ran.code, ran.out) == (2, "")
    assert str(path) in ran.err
    assert says in ran.err
