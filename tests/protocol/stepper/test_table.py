"""The parameters: where they stand, that no byte is forgotten, and that table, wire and dump agree."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.register import Access, Storage
from motorbus.core.request import Effect, TimeoutClass
from motorbus.core.units import QUANTITIES
from motorbus.errors import RequestError
from motorbus.families.stepper import table, wire
from tests.protocol.stepper.vectors import DUMPS, name_of
from tests.protocol.vectors import Vector

# the manual's index and size of each parameter of a step: offset in its 20 bytes, size
STEP_LAYOUT = {
    "distance": (0, 3),
    "direction": (3, 1),
    "start_frequency": (4, 2),
    "acceleration": (6, 2),
    "speed": (8, 2),
    "output": (10, 1),
    "delay": (11, 3),
    "start_input": (14, 1),
    "stop_input": (15, 1),
}
# and of the project itself: offset in the 226 bytes, size
BASE_LAYOUT = {
    "number": (6, 1),
    "total_steps": (7, 1),
    "loop_first": (8, 1),
    "loop_last": (9, 1),
    "loop_count": (10, 1),
    "project_loop": (11, 1),
    "microsteps": (12, 2),
    "step_angle": (14, 1),
    "turn_distance": (15, 3),
    "stop_mode": (20, 1),
    "mode4": (21, 1),
    "power_on_home": (22, 1),
}
IMAGES = st.binary(min_size=220, max_size=220)


def test_the_rows_stand_where_the_manual_has_them() -> None:
    assert {
        row.name: (table.dump_offset(table.TABLE[row.name]), row.size) for row in table.BASE
    } == BASE_LAYOUT
    for number in range(1, 11):
        start = 26 + 20 * (number - 1)
        found = {name: table.step_row(number, name) for name in STEP_LAYOUT}
        layout = {name: (table.dump_offset(row) - start, row.size) for name, row in found.items()}
        assert layout == STEP_LAYOUT
    assert len(table.TABLE) == 12 + 10 * 9


def test_every_byte_of_a_dump_is_accounted_for_once() -> None:
    named = [at for row in table.TABLE.values() for at in range(row.address, row.address + row.size)]
    reserved = [at for run in table.RESERVED for at in run]
    assert (len(named), len(reserved)) == (175, 45)
    assert sorted(named + reserved) == list(range(wire.IMAGE_LENGTH))
    assert wire.REPLY_LENGTH + 175 + 45 == wire.DUMP_LENGTH == 226


def test_the_reserved_bytes_are_those_between_the_named_ones() -> None:
    offsets = [6 + run.start for run in table.RESERVED], [6 + run.stop for run in table.RESERVED]
    assert list(zip(*offsets, strict=True))[:4] == [(18, 20), (23, 26), (42, 46), (62, 66)]
    assert [run.start for run in table.RESERVED] == sorted(run.start for run in table.RESERVED)
    assert all(one.stop <= other.start for one, other in pairwise(table.RESERVED))


def test_every_parameter_but_the_number_of_the_project_is_set_by_one_command() -> None:
    assert set(table.SET_BY) == {*BASE_LAYOUT, *STEP_LAYOUT} - {"number"}
    for name, setter in table.SET_BY.items():
        assert setter.place.size == table.PARAMETERS[name].size, name
        assert ("step" in [place.name for place in setter.command.places]) is (name in STEP_LAYOUT)
    assert {setter.command.name for setter in table.SET_BY.values()} == set(table.EDITS)


def test_every_number_of_every_request_has_a_row() -> None:
    used = {place.name for command in wire.COMMANDS.values() for place in command.places}
    assert used == set(table.PARAMETERS) - {"number"}


def test_every_row_says_where_it_is_from() -> None:
    for row in [*table.TABLE.values(), *table.REQUEST_ONLY]:
        assert "manual, item" in row.source
        assert row.unit in {"", *QUANTITIES}
        assert row.storage is Storage.EEPROM
        assert row.effect is (Effect.NONE if row.access is Access.READ else Effect.PERSISTENT)
        assert row.low < row.high <= (1 << 8 * row.size) - 1
        assert all(row.low <= raw <= row.high for raw in row.choices)


def test_what_moves_unasked_or_nobody_understands_is_protected() -> None:
    assert {row.name for row in table.TABLE.values() if row.protected} == {"mode4", "power_on_home"}


@pytest.mark.parametrize(
    ("name", "raw", "value"),
    [
        ("step_angle", 180, pi / 100),
        ("step_1_delay", 1000, 1.0),
        ("step_10_speed", 60, 2 * pi),
        ("step_2_distance", 56814, 56814),
        ("step_2_start_frequency", 50, 50),
    ],
)
def test_a_value_is_in_the_unit_of_the_api(name: str, raw: int, value: float) -> None:
    row = table.TABLE[name]
    assert row.to_value(raw) == pytest.approx(value, rel=1e-12)
    assert row.to_raw(value) == raw


# --- image ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("vector", DUMPS, ids=name_of)
def test_a_known_dump_holds_its_numbers(vector: Vector) -> None:
    project = table.decode_image(wire.decode_dump(vector.data).image)
    wanted = vector.expected["parameters"]
    for name in BASE_LAYOUT:
        assert getattr(project, name) == wanted[name], name
    for number, step in enumerate(wanted["steps"], start=1):
        assert {name: getattr(project.step(number), name) for name in STEP_LAYOUT} == step
    assert set(project.steps[len(wanted["steps"]) :]) == {table.EMPTY}
    assert table.encode_image(project) == vector.data[6:]
    assert table.reserved_bytes(vector.data[6:]) == {}


@given(IMAGES, st.sampled_from(["little", "big"]))
def test_any_image_comes_back_byte_for_byte(image: bytes, order: table.Order) -> None:
    project = table.decode_image(image, order)
    assert table.encode_image(project, order, over=image) == image
    bare = table.encode_image(project, order)
    assert table.reserved_bytes(bare) == {}
    assert table.decode_image(bare, order) == project
    changed = {at for at in range(220) if bare[at] != image[at]}
    assert changed == set(table.reserved_bytes(image))


def test_the_order_of_bytes_shows_in_numbers_of_more_than_one() -> None:
    image = bytes(6) + b"\x02\x01" + bytes(212)
    assert table.decode_image(image).microsteps == 0x0102
    assert table.decode_image(image, "big").microsteps == 0x0201


@pytest.mark.parametrize("length", [0, 219, 221, 226])
def test_an_image_has_220_bytes(length: int) -> None:
    for call in (table.decode_image, table.reserved_bytes):
        with pytest.raises(RequestError, match=f"{length} bytes"):
            call(bytes(length))
    with pytest.raises(RequestError, match=f"{length} bytes"):
        table.encode_image(table.Project(), over=bytes(length))


def test_a_number_that_does_not_fit_is_refused_with_its_step() -> None:
    with pytest.raises(RequestError, match="step 3, delay: 16777216 does not fit"):
        table.encode_image(table.Project().with_step(3, delay=1 << 24))
    with pytest.raises(RequestError, match="^microsteps: -1 does not fit"):
        table.encode_image(table.Project(microsteps=-1))


def test_differences_name_what_differs() -> None:
    one = table.Project(number=1, total_steps=2)
    other = table.Project(number=1, total_steps=3).with_step(2, delay=5)
    assert list(table.differences(one, other)) == [("total_steps", 0, 2, 3), ("delay", 2, 0, 5)]
    assert list(table.differences(one, one)) == []


# --- limits -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "values", "says", "allows"),
    [
        ("select_project", {"project": 5, "total_steps": 1}, "project: 5", "1 to 4"),
        ("select_project", {"project": 0, "total_steps": 1}, "project: 0", "1 to 4"),
        ("select_project", {"project": 1, "total_steps": 11}, "total_steps: 11", "1 to 10"),
        ("set_step_delay", {"step": 0, "delay": 1}, "^step: 0", "1 to 10"),
        ("set_step_delay", {"step": 11, "delay": 1}, "^step: 11", "1 to 10"),
        ("set_step_delay", {"step": 2, "delay": 16_800_000}, "step 2, delay: 16800000", "0 to 16777215 ms"),
        ("set_step_distance", {"step": 1, "distance": 1 << 24}, "step 1, distance", "0 to 16777215 units"),
        ("set_step_output", {"step": 1, "output": 9}, "step 1, output: 9", "0 to 8"),
        ("set_step_start_input", {"step": 4, "start_input": 3}, "step 4, start_input: 3", "1, 2, 5, or 0"),
        ("set_step_stop_input", {"step": 4, "stop_input": 6}, "step 4, stop_input: 6", "1, 2, 5, or 0"),
        (
            "set_step_direction_start",
            {"step": 1, "direction": 2, "start_frequency": 1},
            "direction: 2",
            "0 to 1",
        ),
        ("set_microstep_and_angle", {"microsteps": 0, "step_angle": 180}, "microsteps: 0", "1 to 65535"),
        ("set_microstep_and_angle", {"microsteps": 8, "step_angle": 256}, "step_angle: 256", "2.55° at most"),
        ("set_turn_distance", {"turn_distance": 0}, "turn_distance: 0", "1 to 16777215"),
        (
            "set_segment_loop",
            {"loop_first": 3, "loop_last": 2, "loop_count": 2},
            "3 to 2 is no range",
            "first",
        ),
        (
            "set_segment_loop",
            {"loop_first": 0, "loop_last": 2, "loop_count": 2},
            "0 to 2 is no range",
            "first",
        ),
        (
            "set_segment_loop",
            {"loop_first": 1, "loop_last": 2, "loop_count": 255},
            "loop_count: 255",
            "0 to 254",
        ),
        ("set_project_loop", {"project_loop": 256}, "project_loop: 256", "255 is endless"),
        ("set_output", {"port": 6, "level": 1}, "port: 6", "1 to 5"),
        ("set_output", {"port": 0, "level": 1}, "port: 0", "1 to 5"),
        ("set_output", {"port": 1, "level": 2}, "level: 2", "0 to 1"),
        ("set_mode4", {"mode4": 3}, "mode4: 3", "0 to 2"),
    ],
)
def test_what_a_controller_does_not_take_is_refused(
    command: str, values: dict[str, int], says: str, allows: str
) -> None:
    with pytest.raises(RequestError, match=says) as caught:
        table.check(command, values)
    assert allows in caught.value.expected


@pytest.mark.parametrize("name", list(table.PARAMETERS))
def test_the_ends_of_every_range_are_taken_and_what_lies_beyond_is_not(name: str) -> None:
    row = table.PARAMETERS[name]
    assert table.is_allowed(name, row.low)
    assert table.is_allowed(name, row.high)
    assert not table.is_allowed(name, row.low - 1)
    assert not table.is_allowed(name, row.high + 1)
    assert table.refusal(name, row.low) is None
    assert table.allowed(name)


@pytest.mark.parametrize("name", ["start_input", "stop_input"])
def test_inputs_that_start_and_stop_projects_are_for_experts(name: str) -> None:
    assert [raw for raw in range(7) if table.is_allowed(name, raw)] == [0, 1, 2, 5]
    assert [raw for raw in range(7) if table.is_allowed(name, raw, expert=True)] == [0, 1, 2, 3, 4, 5]
    refused = table.refusal(name, 3, step=7)
    assert refused is not None
    assert "start and stop projects" in refused.cause
    assert table.allowed(name, expert=True) == "1, 2, 3, 4, 5, or 0 for none"


def test_every_refusal_of_a_project_is_told() -> None:
    project = table.Project(number=1, total_steps=2, microsteps=8, step_angle=180, turn_distance=1)
    assert list(table.refusals(project)) == []
    wrong = project.with_step(2, output=9, start_input=4).with_step(3, output=9)  # step 3 is not carried out
    assert [str(error.summary) for error in table.refusals(wrong)] == [
        "step 2, output: 9 is not possible",
        "step 2, start_input: 4 is not possible",
    ]
    cleared = [error.summary for error in table.refusals(table.Project())]
    assert [text.split(":")[0] for text in cleared] == [
        "total_steps",
        "microsteps",
        "step_angle",
        "turn_distance",
    ]


# --- orders -----------------------------------------------------------------------------------------------------


def test_every_command_has_its_row() -> None:
    assert list(table.ORDERS) == list(wire.COMMANDS)
    for name, order in table.ORDERS.items():
        assert order.command is wire.COMMANDS[name]
        assert order.title
        assert order.source.endswith(f"item {order.command.number}")


def test_what_moves_switches_or_stores_is_said() -> None:
    by_effect = {
        effect: {name for name, order in table.ORDERS.items() if order.effect is effect} for effect in Effect
    }
    assert by_effect[Effect.MOTION] == {
        "start_project", "stop_project", "jog_forward", "jog_reverse", "run_once", "stop_motor", "home",
    }  # fmt: skip
    assert by_effect[Effect.TORQUE] == {"set_output"}
    assert by_effect[Effect.NONE] == {"read_project", "read_input"}
    assert len(by_effect[Effect.PERSISTENT]) == 27 - 7 - 1 - 2


def test_what_must_not_be_said_twice() -> None:
    once = {name for name, order in table.ORDERS.items() if not order.repeatable}
    assert once == {
        "start_project", "run_once", "home", "jog_forward", "jog_reverse", "save_project", "clear_project",
    }  # fmt: skip
    slow = {name for name, order in table.ORDERS.items() if order.timeout is TimeoutClass.STORE}
    assert slow == {"save_project", "clear_project"}
    assert table.REPLY < table.DUMP_BEGINS < table.DUMP_ENDS < table.STORE


def test_the_commands_that_set_parameters() -> None:
    assert len(table.EDITS) == 15
    assert all(wire.COMMANDS[name].places for name in table.EDITS)


@pytest.mark.parametrize("number", [0, 5, -1, True, 1.0, "1", None])
def test_a_number_of_no_project_is_refused(number: object) -> None:
    assert [table.checked_project(one) for one in range(1, 5)] == [1, 2, 3, 4]
    with pytest.raises(RequestError, match="there is no project"):
        table.checked_project(number)
