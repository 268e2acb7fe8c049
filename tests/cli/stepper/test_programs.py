"""check, estimate and order: what they print, in prose and as JSON, and with which code they end."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.protocol.stepper.projects import MOTOR, file
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B


@pytest.fixture
def dump(tmp_path: Path) -> str:
    path = tmp_path / "b.bin"
    path.write_bytes(DUMP_B)
    return str(path)


@pytest.fixture
def broken(tmp_path: Path) -> str:
    """A program without a start frequency."""
    path = tmp_path / "broken.toml"
    path.write_text(file(top="project = 2").replace('start = "200 Hz"', ""), encoding="utf-8")
    return str(path)


def test_a_good_program_has_no_findings(run: Run) -> None:
    ran = run("stepper", "check", EXAMPLE)
    assert (ran.code, ran.out) == (0, "no findings\n")


def test_findings_are_told_with_rule_and_reason(run: Run, dump: str) -> None:
    ran = run("stepper", "check", dump)
    assert ran.code == 0  # warnings only
    for word in ("L11", "L3", "warning", "72721.9 pulses, 0.92 lost each time", "--rounding"):
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
    assert run("stepper", "estimate", EXAMPLE).out.startswith(
        "at least 52.8 s + 6 waits; 49.7 s to 98.4 s if "
    )


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
        (("check", "--highest", "nan", EXAMPLE), "--highest nan is not possible"),
        (("check", "--longest", "0", EXAMPLE), "--longest 0 is not possible"),
        (
            ("check", "--longest", "-5", EXAMPLE),
            "error: --longest -5 is not possible\n  expected: a number above 0\n",
        ),
        (("check", "--longest-total", "0", EXAMPLE), "--longest-total 0 is not possible"),
        (("check", "--before", EXAMPLE, EXAMPLE), "--before holds project 2"),
        (("check", "--before", "nowhere.bin", EXAMPLE), "nowhere.bin cannot be read"),
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
        (file(motor=MOTOR.replace("1.8 deg", "2.56 deg")), "0.01 deg to 2.55 deg"),
        (file('delay = "4 h 40 min"'), "4 h 39 min 37.215 s"),
        (file("wait_for = 3"), "step 1, wait_for: 3"),
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


@pytest.mark.parametrize("command", ["check", "estimate", "order", "show"])
def test_a_bad_file_hides_nothing_of_a_good_one(run: Run, tmp_path: Path, broken: str, command: str) -> None:
    bad = [tmp_path / name for name in ("bad.toml", "worse.toml")]
    for path in bad:
        path.write_text("format = 9", encoding="utf-8")
    ran = run("stepper", command, str(bad[0]), broken, str(bad[1]))
    assert ran.code == 2
    assert ran.out == run("stepper", command, broken).out != ""
    assert [f"error: {path}: format: 9 is not known" in ran.err for path in bad] == [True, True]
    told = run("stepper", command, "--json", str(bad[0]), broken)
    assert broken in told.out
    assert str(bad[0]) not in told.out
    none = run("stepper", command, *map(str, bad))
    assert (none.code, none.out, none.err.count("error: ")) == (2, "", 2)


def test_a_program_for_project_1_is_told_what_jog_loses(run: Run, tmp_path: Path, dump: str) -> None:
    program, before = tmp_path / "one.toml", tmp_path / "one.bin"
    program.write_text(file(), encoding="utf-8")
    before.write_bytes(DUMP_A)
    told = run("stepper", "check", str(program))
    assert told.code == 0
    assert "from now on they go at 60 rpm, from 200 Hz on by 100 Hz" in told.out
    sharper = run("stepper", "check", str(program), "--before", str(before), "--json").document["findings"]
    assert [(one["rule"], one["step"]) for one in sharper] == [("L16", 1)]
    assert "speed 100 becomes 60" in sharper[0]["text"]
    assert run("stepper", "check", str(before), "--before", str(before)).out == "no findings\n"
    assert "jog" not in run("stepper", "check", dump, "--before", str(before)).out


def test_what_a_carried_pulse_does_is_said_without_a_contradiction(run: Run, dump: str) -> None:
    for rounding, says in (("trunc", "0.92 lost"), ("nearest", "0.08 too many"), ("carry", "is carried on")):
        ran = run("stepper", "check", "--rounding", rounding, dump)
        assert says in ran.out
        assert ("lost" in ran.out) is (rounding == "trunc")


def test_limits_of_pauses_are_heeded(run: Run) -> None:
    ran = run("stepper", "check", "--longest-total", "5", "--json", EXAMPLE)
    (found,) = ran.document["findings"]
    assert (found["rule"], found["step"]) == ("L19", None)
    assert found["text"].endswith("s of pauses in all, more than 5 s")


def test_a_motor_that_is_stored_otherwise_is_told(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "full.toml"
    motor = MOTOR.replace('step_angle = "1.8 deg"', "full_steps = 48").replace("= 8", "= 25")
    path.write_text(file(top="project = 2", motor=motor), encoding="utf-8")
    assert "are stored as 1.8 deg and 6 microsteps" in run("stepper", "check", str(path)).out


@pytest.mark.parametrize("command", ["order", "show", "estimate"])
def test_a_cleared_project_is_called_that(run: Run, tmp_path: Path, command: str) -> None:
    path = tmp_path / "cleared.bin"
    path.write_bytes(bytes.fromhex("FFAA3E030000") + bytes(220))
    ran = run("stepper", command, str(path))
    assert ran.code == 0
    assert "no steps: the project has been cleared" in ran.out
