"""A project as commands: all of them, only those that differ, and what each changes."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given

from motorbus.errors import RequestError
from motorbus.families.stepper import table, wire
from motorbus.families.stepper.table import Edit, Project, amended, edited, edits, edits_between
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMP_B

B = table.decode_image(DUMP_B[6:])


def carried_out(start: Project, orders: list[Edit]) -> Project:
    for order in orders:
        start = edited(start, order.command, order.values)
    return start


@given(projects())
def test_all_commands_of_a_project_make_it(project: Project) -> None:
    orders = edits(project, rows=10)
    assert len(orders) == 8 + 7 * 10
    assert carried_out(Project(), orders) == project
    assert len(edits(project)) == 8 + 7 * project.total_steps


@given(projects(), projects())
def test_what_differs_makes_one_of_the_other(before: Project, after: Project) -> None:
    before = replace(before, number=after.number)
    orders = edits_between(before, after)
    rows = max(before.total_steps, after.total_steps)
    made = carried_out(before, orders)
    assert made.steps[:rows] == after.steps[:rows]
    assert replace(made, steps=after.steps) == after
    if orders:
        assert orders[0].command == "select_project"


def test_one_field_is_three_words_with_the_save() -> None:
    orders = edits_between(B, B.with_step(2, delay=7))
    assert [order.command for order in orders] == ["select_project", "set_step_delay"]
    assert orders[1].values == {"delay": 7, "step": 2}
    assert edits_between(B, B) == []
    assert [order.command for order in edits_between(B, replace(B, total_steps=2))] == ["select_project"]


def test_rows_that_nobody_carries_out_are_compared_when_that_is_wanted() -> None:
    beyond = B.with_step(9, delay=7)
    assert edits_between(B, beyond) == []
    assert [order.values.get("step") for order in edits_between(B, beyond, rows=10)] == [None, 9]


def test_an_edit_is_a_frame() -> None:
    assert Edit("set_step_delay", {"delay": 1000, "step": 1}).frame().hex() == "ffaa0307e803000000019f"
    assert Edit("set_stop_mode", {"stop_mode": 1}).frame(motor=5)[2] == 5
    with pytest.raises(RequestError):
        Edit("set_step_delay", {"delay": 1 << 24, "step": 1}).frame()


def test_the_order_is_that_of_the_manual_for_a_restore() -> None:
    names = [order.command for order in edits(B)]
    assert names[:8] == [
        "select_project", "set_microstep_and_angle", "set_turn_distance", "set_segment_loop", "set_project_loop",
        "set_stop_mode", "set_mode4", "set_power_on_home",
    ]  # fmt: skip
    assert names[8:15] == [name for name, command in wire.COMMANDS.items() if command.echo == "step"]


def test_a_step_that_has_no_row_changes_nothing() -> None:
    for step in (0, 11):
        assert edited(B, "set_step_delay", {"delay": 5, "step": step}) == B
    assert edited(B, "set_step_delay", {"delay": 5, "step": 10}).step(10).delay == 5


def test_numbers_are_changed_by_the_names_of_the_table() -> None:
    found = amended(B, {"step_10_start_frequency": 77, "turn_distance": 5})
    assert found == replace(B, turn_distance=5).with_step(10, start_frequency=77)


@pytest.mark.parametrize("name", ["step_0_delay", "step_11_delay", "step_1_colour", "delay", "", "steps"])
def test_a_name_that_is_none_changes_nothing(name: str) -> None:
    with pytest.raises(KeyError):
        amended(B, {name: 1})
