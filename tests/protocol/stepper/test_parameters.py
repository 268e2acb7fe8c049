"""Rows, projects and images: every number in its place, every range with its field."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.register import Access
from motorbus.errors import RequestError
from motorbus.families.stepper import parameters
from motorbus.families.stepper.parameters import BASE, PARAMETERS, STEP, STEPS, TABLE, Project, Step
from motorbus.families.stepper.protocol import COMMANDS, edited, edits, edits_between, encode
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMPS, name_of
from tests.protocol.vectors import Vector

IMAGES = st.binary(min_size=220, max_size=220)
ORDERS: tuple[Literal["little", "big"], ...] = ("little", "big")


def test_the_rows_cover_the_image_but_for_45_bytes() -> None:
    named = [at for row in TABLE.values() for at in range(row.address, row.address + row.size)]
    assert len(named) == len(set(named)) == 220 - 45
    assert max(named) < 220
    assert len(TABLE) == len(BASE) + 10 * len(STEP) == 102


def test_every_row_is_set_by_one_command_and_has_its_item_as_source() -> None:
    for row in (*BASE, *STEP):
        setters = [command for command in COMMANDS.values() if row.name in command.fields]
        assert len(setters) == (row.access is not Access.READ), row.name
        for command in setters:
            assert f"item {command.number};" in row.source
        assert "item 15 [" in row.source


@pytest.mark.parametrize("vector", DUMPS, ids=name_of)
def test_a_known_dump_is_decoded_and_encoded(vector: Vector) -> None:
    expected = dict(vector.expected["parameters"])
    steps = tuple(Step(**one) for one in expected.pop("steps"))
    project = replace(parameters.with_steps(Project(**expected), steps), total_steps=expected["total_steps"])
    assert parameters.decode_image(vector.data[6:]) == project
    assert parameters.encode_image(project) == vector.data[6:]


@given(IMAGES)
def test_any_image_is_kept(image: bytes) -> None:
    for order in ORDERS:
        project = parameters.decode_image(image, order)
        encoded = parameters.encode_image(project, order)
        named = [at for row in TABLE.values() for at in range(row.address, row.address + row.size)]
        assert [encoded[at] for at in named] == [image[at] for at in named]
        assert parameters.project_of(parameters.values_of(project)) == project


@given(IMAGES, st.sampled_from(list(TABLE)))
def test_a_changed_number_is_the_one_difference(image: bytes, name: str) -> None:
    project = parameters.decode_image(image)
    old = parameters.values_of(project)[name]
    other = parameters.amended(project, {name: old ^ 1})
    assert parameters.differences(project, other) == {name: (old, old ^ 1)}


@given(IMAGES, IMAGES)
def test_edits_turn_one_project_into_another(one: bytes, other: bytes) -> None:
    before, after = parameters.decode_image(one), parameters.decode_image(other)
    commands = edits_between(before, after)
    found = before
    for edit in commands:
        assert set(edit.values) == set(COMMANDS[edit.command].fields)
        found = edited(found, edit.command, edit.values)
    assert found == after
    assert edits_between(after, after) == []
    assert [edit.command for edit in commands[:1]] == ["select_project"] * (before != after)


@given(projects())
def test_a_whole_project_takes_8_commands_and_7_for_each_step(project: Project) -> None:
    commands = edits(project)
    assert len(commands) == 8 + 7 * STEPS
    assert all(len(encode(edit.command, **edit.values)) == 11 for edit in commands)


def test_a_step_that_does_not_exist_changes_nothing() -> None:
    assert edited(Project(), "set_step_delay", {"delay": 5, "step": 11}) == Project()


def test_geometry_is_exact_or_unknown() -> None:
    project = Project(microsteps=8, step_angle=7, turn_distance=3)
    assert project.pulses_per_turn == Fraction(36000 * 8, 7)
    assert project.pulses_per_unit == Fraction(36000 * 8, 21)
    assert replace(project, turn_distance=0).pulses_per_unit is None
    assert replace(project, step_angle=0).pulses_per_turn is None


@pytest.mark.parametrize("loop", [(0, 0, 0), (2, 1, 2), (1, 4, 2), (1, 3, 0)])
def test_a_loop_that_is_no_range_is_none(loop: tuple[int, int, int]) -> None:
    first, last, count = loop
    assert not Project(total_steps=3, loop_first=first, loop_last=last, loop_count=count).has_loop


@pytest.mark.parametrize("name", list(PARAMETERS))
def test_each_limit_is_checked(name: str) -> None:
    row = PARAMETERS[name]
    for limit in {row.low, row.high}:
        parameters.check_value(name, limit)
    wrong: tuple[object, ...] = (row.low - 1, row.high + 1, 1.0, True, None)
    for raw in wrong:
        with pytest.raises(RequestError, match=f"^step 2, {name}: .* is not possible") as caught:
            parameters.check_value(name, raw, step=2)
        assert str(row.high) in caught.value.expected


def test_errors_of_a_project_are_those_of_the_steps_that_it_carries_out() -> None:
    project = Project(total_steps=1, microsteps=8, step_angle=180, turn_distance=1)
    assert parameters.check_project(project.with_step(2, output=9)) == []
    (error,) = parameters.check_project(project.with_step(1, stop_input=3))
    assert (error.summary, error.cause) == (
        "step 1, stop_input: 3 is not possible",
        "inputs 3 and 4 start and stop projects",
    )
    assert parameters.check_project(project.with_step(1, stop_input=3), expert=True) == []


def test_an_unknown_name_or_order_is_refused() -> None:
    with pytest.raises(RequestError, match="no register 'step_11_delay'"):
        parameters.amended(Project(), {"step_11_delay": 1})
    with pytest.raises(RequestError, match="dump_order='middle'"):
        parameters.checked_order("middle")
    with pytest.raises(RequestError, match="219 bytes"):
        parameters.decode_image(bytes(219))


@pytest.mark.parametrize(
    ("action", "outputs"),
    [(0, 2), (1, 3), (2, 2), (3, 6), (4, 7), (5, 2), (6, 0), (7, 2), (8, 0), (9, 2)],
)
def test_the_output_action_of_a_step(action: int, outputs: int) -> None:
    assert parameters.outputs_after_step(2, action) == outputs


@pytest.mark.parametrize(
    ("port", "level", "outputs"), [(1, 1, 3), (2, 0, 0), (3, 1, 6), (4, 1, 7), (4, 0, 0), (5, 1, 2)]
)
def test_the_port_of_set_output(port: int, level: int, outputs: int) -> None:
    assert parameters.outputs_after_port(2, port, level) == outputs
