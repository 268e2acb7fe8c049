"""A program goes into a file and into an image, and comes back from each; and it can be asked about."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import Conditions, Program
from motorbus.families.stepper.table import Project
from tests.protocol.stepper.projects import MOTOR, file, projects
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

EXAMPLE = Path(__file__).resolve().parents[4] / "examples" / "pick_and_place.toml"


@given(projects(), st.text(max_size=20).filter(lambda text: text.isprintable()))
def test_file_image_and_dump_say_the_same(project: Project, name: str) -> None:
    program = Program(project=project, name=name)
    assert Program.parse(program.text()).project == project
    assert Program.parse(program.text()).name == name
    assert Program.from_dump(program.image()).project == project
    assert Program.from_dump(program.dump()).project == project


@pytest.mark.parametrize("data", [DUMP_A, DUMP_B])
def test_a_dump_goes_through_a_file_without_loss(data: bytes) -> None:
    program = Program.from_dump(data, name="from a controller")
    assert Program.parse(program.text()).dump() == data


def test_bytes_that_nobody_knows_are_kept_with_a_dump() -> None:
    data = DUMP_B[:18] + b"\x12\x34" + DUMP_B[20:]
    program = Program.from_dump(data)
    assert program.dump() == data
    assert [finding.rule for finding in program.lint()] == ["L11", "L18", "L3"]
    assert Program.parse(program.text()).dump() == DUMP_B


def test_the_example_is_what_its_readme_says(tmp_path: Path) -> None:
    program = Program.load(str(EXAMPLE))
    assert program.name == "Pick and place"
    assert program.project.total_steps == 10
    assert program.order() == [1, 2, 3, 4, 5, 6, 7, 8, 3, 4, 5, 6, 7, 8, 9, 10]
    assert program.lint() == []
    assert str(program.estimate()).startswith("at least 52.8 s + 6 waits")
    assert len(program.frames()) == 9 + 7 * 10
    copy = tmp_path / "copy.toml"
    copy.write_text(program.text(), encoding="utf-8")
    assert Program.load(str(copy)) == program


def test_a_plan_has_the_name_and_the_readings() -> None:
    program = Program.load(str(EXAMPLE))
    plan = program.plan(Behaviour(seg_loop="extra"))
    assert plan.name == "Pick and place"
    assert len(plan.order) == 10 + 2 * 6
    assert program.estimate(Behaviour(proj_loop="extra")).waits == 8


def test_conditions_of_a_lint_are_heeded() -> None:
    found = Program.load(str(EXAMPLE)).lint(Conditions(unattended=True, highest=1000))
    assert {finding.rule for finding in found} == {"L22", "L4"}


def test_an_estimate_costs_the_same_however_long_the_way_is() -> None:
    """Sixteen million turns with the slowest of all ramps: added up pulse by pulse it would take hours."""
    project = Program.load(str(EXAMPLE)).project
    slow = {"distance": 0xFFFFFF, "acceleration": 1, "speed": 0xFFFF}
    for step in range(1, 11):
        project = project.with_step(step, **slow)
    long = Program(project=replace(project, turn_distance=1))
    assert long.estimate(Behaviour(ramp="pulse")).seconds > 100_000


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: None, "cannot be read"),
        (lambda path: path.mkdir(), "cannot be read"),
        (lambda path: path.write_bytes(b"\xff\xfe"), "is no text"),
        (lambda path: path.write_text("format = 3"), "format: 3 is not known"),
        (lambda path: path.write_text("#" * (1 << 20) + "##"), "characters"),
    ],
)
def test_a_file_that_cannot_be_is_refused(make: object, says: str, tmp_path: Path) -> None:
    path = tmp_path / "program.toml"
    assert callable(make)
    make(path)
    with pytest.raises(RequestError, match=says):
        Program.load(str(path))


def test_a_motor_that_is_stored_otherwise_is_found() -> None:
    motor = MOTOR.replace('step_angle = "1.8 deg"', "full_steps = 48").replace(
        "microsteps = 8", "microsteps = 25"
    )
    found = [
        str(one) for one in Program.parse(file(motor=motor, top="project = 2")).lint() if one.rule == "L23"
    ]
    assert len(found) == 1
    assert "48 full steps of 25 microsteps are stored as 1.8 deg and 6 microsteps" in found[0]


def test_an_expert_stays_one() -> None:
    program = Program.parse(file("wait_for = 4", top="expert = true"))
    assert program.expert
    assert Program.parse(program.text()) == program


def test_a_program_without_a_project_is_refused_where_it_matters() -> None:
    with pytest.raises(RequestError, match="no project 0"):
        Program(project=Project()).dump()
    with pytest.raises(RequestError, match="project 0 has been cleared"):
        Program(project=Project()).text()
