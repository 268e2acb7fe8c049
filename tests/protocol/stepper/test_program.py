"""Program files and backups: what is read, what is refused and how, and that what is written reads the same."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.families.stepper.parameters import Project, Step
from motorbus.families.stepper.program.backup import Backup
from motorbus.families.stepper.program.file import Program
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

MOTOR = '[motor]\nmicrosteps = 8\nstep_angle = "1.8 deg"\nturn_distance = 5000\nlead = "5 mm"\n'
STEP = '[[step]]\nmove = "10 mm"\nspeed = "60 rpm"\nstart = "200 Hz"\nacceleration = "100 Hz"\n'


def file(*parts: str, top: str = "", motor: str = MOTOR, steps: int = 1) -> str:
    """A program file with these parts behind a motor and some steps."""
    return f"format = 1\n{top}\n{motor}\n{STEP * steps}" + "\n".join(parts)


def test_a_file_is_read() -> None:
    found = Program.parse(
        file(
            '[[step]]\nmove = "-90 deg"\nspeed = "100 rpm"\nwait_for = "go"\nstop_on = 5\noutput = "valve off"',
            'delay = "1.5 s"\n[loop]\nfirst = 1\nlast = 2\ncount = 4\n[inputs]\ngo = 2\n[outputs]\nvalve = 3',
            top='name = "Ärm"\nproject = 4\nrepeat = "endless"',
        )
    )
    project = found.project
    assert (found.name, found.inputs, found.outputs) == ("Ärm", {"go": 2}, {"valve": 3})
    assert (project.number, project.total_steps, project.project_loop) == (4, 2, 255)
    assert (project.loop_first, project.loop_last, project.loop_count) == (1, 2, 4)
    assert (project.microsteps, project.step_angle, project.turn_distance) == (8, 180, 5000)
    assert project.step(1) == Step(distance=10_000, speed=60, start_frequency=200, acceleration=100)
    assert project.step(2) == Step(
        distance=1250, direction=1, speed=100, start_input=2, stop_input=5, output=7, delay=1500
    )


@pytest.mark.parametrize(
    ("speed", "rpm"), [("2 rpm", 2), ("1600 Hz", 60), ("6 deg/s", 1), ("10 mm/s", 120), ("0.5 cm/s", 60)]
)
def test_the_units_of_a_speed(speed: str, rpm: int) -> None:
    assert Program.parse(file().replace("60 rpm", speed)).project.step(1).speed == rpm


@pytest.mark.parametrize(
    ("source", "says", "allows"),
    [
        ("format = 1\n[motor", "^the file is not TOML", "TOML|file"),
        ("a = " + "[" * 5000, "^the file is not TOML", ""),
        ("a = " + "9" * 5000, "^the file is not TOML", ""),
        ("", "^the file: Object missing required field `format`", "format, name"),
        (file().replace("format = 1", "format = 2"), "^format: 2 is not possible", "enum value 2"),
        (file(top="colour = 3"), "^the file: unknown field `colour`", "format, name"),
        (file("dealy = 3"), "^step 1: unknown field `dealy`", "delay"),
        (file(steps=11), "^step: .* is not possible", "length <= 10"),
        (file(steps=0), "missing required field `step`", ""),
        (file(top="project = 5"), "^project: 5 is not possible", "<= 4"),
        (file(top="project = 1.5"), "^project: 1.5 is not possible", "int"),
        (file(top="repeat = 255"), "^repeat: 255 is not possible", "<= 254"),
        (file(top='repeat = "often"'), "^repeat: 'often' is not possible", "often"),
        (file("[loop]\nfirst = 11\nlast = 12\ncount = 2"), "^loop, first: 11 is not possible", "<= 10"),
        (file("[loop]\nfirst = 1\nlast = 1"), "^loop: Object missing required field `count`", "first, last"),
        (file(motor=MOTOR.replace("= 8", "= 65536")), "^motor, microsteps: 65536 is", "<= 65535"),
        (
            file(motor=MOTOR.replace("1.8 deg", "2.56 deg")),
            "^motor, step_angle: '2.56 deg'",
            "0.01 to 2.55 deg",
        ),
        (file(motor=MOTOR.replace("turn_distance = 5000", "")), "^motor: .* field `turn_distance`", "lead"),
        (file(motor=MOTOR + "stop = 'hard'"), "^motor, stop: 'hard' is not possible", "hard"),
        (file(motor=MOTOR.replace("5 mm", "5 rpm")), "^motor, lead: '5 rpm' is no length", "5 mm"),
        (file().replace("10 mm", "10"), "^step 1, move: '10' is not possible", "with a unit in quotes"),
        (file().replace('"10 mm"', "10"), "^step 1, move: 10 is not possible", "with a unit in quotes"),
        (
            file().replace("10 mm", "1 inch"),
            "^step 1, move: '1 inch' has no unit",
            "units, pulses, turns, deg, mm",
        ),
        (
            file(motor=MOTOR.replace('lead = "5 mm"', "")),
            "^step 1, move: '10 mm' has no unit",
            "mm needs a lead",
        ),
        (file().replace("10 mm", "16777216 units"), "^step 1, move: '16777216 units'", "0 to 16777215 units"),
        (
            file().replace("10 mm", "0.0001 mm"),
            "'0.0001 mm' is 0.1, and the controller counts",
            "0 or 0.001 mm",
        ),
        (file().replace('speed = "60 rpm"', ""), "^step 1, speed: it is missing", "rpm"),
        (file().replace("60 rpm", "-60 rpm"), "^step 1, speed: '-60 rpm' is negative", "rpm"),
        (file().replace("60 rpm", "65536 rpm"), "^step 1, speed: '65536 rpm'", "0 to 65535 rpm"),
        (
            file().replace("200 Hz", "70 kHz"),
            "^step 1, start: '70 kHz'",
            r"0 to 65.535 kHz \(raw 0 to 65535\)",
        ),
        (file('delay = "5 h"'), "^step 1, delay: '5 h' is not possible", "raw 0 to 16777215"),
        (file("wait_for = 3"), "^step 1, wait_for: 3 is input 3", "expert = true"),
        (file('stop_on = "input 4"'), "^step 1, stop_on: 'input 4' is input 4", "1, 2, 5"),
        (file("wait_for = 6", top="expert = true"), "^step 1, wait_for: 6", "1, 2, 3, 4, 5"),
        (file('output = "lamp on"'), "^step 1, output: 'lamp on' is not possible", "output 1 on"),
        (file("[inputs]\nx = 6"), "^inputs: .* is not possible", "<= 5"),
    ],
)
def test_a_wrong_file_is_one_error_with_step_field_value_and_limit(
    source: str, says: str, allows: str
) -> None:
    with pytest.raises(RequestError, match=says) as caught:
        Program.parse(source)
    assert "\n" not in caught.value.summary
    assert re.search(allows, caught.value.expected)


def test_an_expert_may_use_inputs_3_and_4() -> None:
    found = Program.parse(file("wait_for = 3", top="expert = true"))
    assert found.project.step(1).start_input == 3
    assert "expert = true" in replace(found, expert=False).text()


def test_a_word_of_the_format_is_no_name() -> None:
    """Else a step without `wait_for` would wait for the input that is called none."""
    for kind, name in product(("inputs", "outputs"), ("none", "input 2", "output 1", "all", " go", "")):
        with pytest.raises(RequestError, match="is no name"):
            Program.parse(file(f'[{kind}]\n"{name}" = 2'))


@given(projects(), st.sampled_from(["", 'a "name" \\ \n\x1b']))
def test_what_is_written_reads_the_same(project: Project, name: str) -> None:
    program = Program(project=project, name=name, inputs={"go on": 2}, outputs={"lamp": 1})
    assert Program.parse(program.text()) == program
    assert Program.parse(program.text()).text() == program.text()


def test_what_no_file_may_hold_is_refused() -> None:
    for steps in (0, 255):
        with pytest.raises(RequestError, match="project 1 has no steps: it was cleared or"):
            Program(project=Project(number=1, total_steps=steps)).text()
    with pytest.raises(RequestError, match="step 1, output: 9"):
        Program(project=Program.parse(file()).project.with_step(1, output=9)).text()


def test_a_program_is_read_from_a_dump_and_from_a_file(tmp_path: Path) -> None:
    found = Program.from_dump(DUMP_B, name="B")
    assert (found.project.number, found.project.total_steps, found.name) == (2, 3, "B")
    for data in (DUMP_B[:-1], DUMP_B[6:], b"\xff\xaa\x4e" + DUMP_B[3:]):
        with pytest.raises(RequestError, match="no dump of a project"):
            Program.from_dump(data)
    path = tmp_path / "b.toml"
    path.write_text(found.text(), encoding="utf-8")
    assert Program.load(str(path)).project == found.project
    path.write_bytes(b"\xff")
    with pytest.raises(RequestError, match=r"b\.toml cannot be read: it is not utf-8 text"):
        Program.load(str(path))
    with pytest.raises(RequestError, match="cannot be read: no such file"):
        Program.load(str(tmp_path / "none"))


@given(st.data())
def test_a_damaged_file_is_read_or_refused(data: st.DataObject) -> None:
    source = file("[loop]\nfirst = 1\nlast = 1\ncount = 3", top='name = "x"\nrepeat = 3', steps=2)
    start = data.draw(st.integers(0, len(source)))
    cut = data.draw(st.integers(0, 3))
    try:
        program = Program.parse(source[:start] + data.draw(st.text(max_size=3)) + source[start + cut :])
    except RequestError:
        return
    assert Program.parse(program.text()).project == program.project


# -- backups -------------------------------------------------------------------------------------------

BACKUP = Backup(dumps={1: DUMP_A, 2: DUMP_B, 4: b"\xff\xaa\x3e\x04\0\0" + bytes(220)})


def test_a_backup_reads_the_same() -> None:
    assert Backup.parse(BACKUP.text()) == BACKUP
    assert BACKUP.projects == (1, 2, 4)
    assert BACKUP.project(2) == Program.from_dump(DUMP_B).project
    assert "# microsteps = 16" in BACKUP.text()
    assert "# no program: " in BACKUP.text()
    with pytest.raises(RequestError, match="no project 3 in this backup"):
        BACKUP.project(3)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("b4 01", "b5 01", "project 1: its dump and its sha256 do not match"),
        ("number = 2", "number = 3", "project 3: its dump"),
        ("number = 2", "number = 5", "<= 4"),
        ("format = 1", "format = 3", "enum value 3"),
        ("stepper backup", "stepper copy", "enum value 'stepper copy'"),
        ("ff aa 3e 01", "ff aa 3e 0", "project 1: its dump"),
        ("dump_order", "dump_ordre", "unknown field `dump_ordre`"),
    ],
)
def test_a_damaged_backup_is_refused(old: str, new: str, says: str) -> None:
    assert old in BACKUP.text()
    with pytest.raises(RequestError, match=says):
        Backup.parse(BACKUP.text().replace(old, new, 1))
