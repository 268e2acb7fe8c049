"""Raw dumps in and out; what in a damaged one cannot be is told with its field and range; frames out."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.program import dumps
from motorbus.families.stepper.table import Project, decode_image, edited, encode_image
from tests.protocol.stepper.projects import projects
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B


@pytest.mark.parametrize(
    ("data", "asked"),
    [
        (DUMP_B, 2),
        (DUMP_B[6:], 0),
        (DUMP_B.hex().encode(), 2),
        (DUMP_B.hex(" ").upper().encode() + b"\n", 2),
        (DUMP_B[6:].hex(" ").replace(" ", "\n").encode(), 0),
    ],
)
def test_a_dump_comes_in_many_forms(data: bytes, asked: int) -> None:
    raw = dumps.from_dump(data)
    assert raw.project == decode_image(DUMP_B[6:])
    assert raw.image == DUMP_B[6:]
    assert raw.asked == asked


@pytest.mark.parametrize("length", [*range(0, 226, 25), 225, 227, 300])
def test_a_dump_cut_short_or_too_long_is_refused(length: int) -> None:
    data = (DUMP_B + bytes(100))[:length]
    if length == 220:
        return
    with pytest.raises(RequestError, match=f"no dump of a project: {length} bytes, 226 are due"):
        dumps.from_dump(data)


def test_half_a_byte_is_refused() -> None:
    with pytest.raises(RequestError, match="half a byte"):
        dumps.from_dump(DUMP_B.hex().encode()[:-1])


@pytest.mark.parametrize(
    ("offset", "value", "says", "allows"),
    [
        (3, 3, "number: the reply says project 3 and its image 2", "3 twice"),
        (6, 1, "the reply says project 2 and its image 1", "2 twice"),
        (6, 200, "number: the reply says", ""),
        (7, 11, "total_steps: 11", "1 to 10"),
        (6, 0, "the reply says project 2 and its image 0", "2 twice"),
        (8, 11, "loop_first: 11", "0 to 10"),
        (9, 200, "loop_last: 200", "0 to 10"),
        (20, 2, "stop_mode: 2", "0 to 1"),
        (21, 3, "mode4: 3", "0 to 2"),
        (22, 9, "power_on_home: 9", "0 to 1"),
        (29, 2, "step 1, direction: 2", "0 to 1"),
        (36, 9, "step 1, output: 9", "0 to 8"),
        (60, 6, "step 2, start_input: 6", "1, 2, 3, 4, 5, or 0"),
        (81, 77, "step 3, stop_input: 77", "or 0 for none"),
    ],
)
def test_a_bit_that_has_turned_over_is_told_where_it_shows(
    offset: int, value: int, says: str, allows: str
) -> None:
    damaged = DUMP_B[:offset] + bytes((value,)) + DUMP_B[offset + 1 :]
    with pytest.raises(RequestError, match=says) as caught:
        dumps.from_dump(damaged)
    assert allows in caught.value.expected
    assert dumps.from_dump(damaged, strict=False).image == damaged[6:]


def test_a_dump_that_lost_a_byte_is_caught_by_what_it_says() -> None:
    shifted = DUMP_B[:60] + DUMP_B[61:] + b"\0"
    with pytest.raises(RequestError, match="cannot be right"):
        dumps.from_dump(shifted)


@pytest.mark.parametrize("project", [Project(), Project(number=3)])
def test_a_cleared_project_is_right(project: Project) -> None:
    data = wire.encode_dump(3, encode_image(project))
    assert dumps.from_dump(data).project == project
    assert list(dumps.faults(project, 3)) == []


@pytest.mark.parametrize(
    ("offset", "value"),
    [
        (7, 2),  # fewer steps, and the loop is behind them
        (8, 4),  # a loop from 4 to 3
        (9, 10),
        (10, 255),
        (14, 0),  # no angle
        (36, 0),
    ],
)
def test_what_commands_may_lead_to_is_taken_whatever_it_means(offset: int, value: int) -> None:
    held = DUMP_B[:offset] + bytes((value,)) + DUMP_B[offset + 1 :]
    assert dumps.from_dump(held).image == held[6:]


CLEARED = [
    Project(turn_distance=5000),
    Project(number=3, loop_first=2, loop_last=1),
    Project(power_on_home=1).with_step(1, speed=9),
]


@pytest.mark.parametrize("project", CLEARED)
def test_what_was_written_into_a_cleared_project_is_right_too(project: Project) -> None:
    assert dumps.from_dump(wire.encode_dump(3, encode_image(project))).project == project
    with pytest.raises(RequestError, match="total_steps: 0 is not possible"):
        dumps.frames(project)


def test_a_loop_that_ends_before_it_begins_is_no_frame() -> None:
    project = replace(decode_image(DUMP_B[6:]), loop_first=3, loop_last=2)
    with pytest.raises(RequestError, match="loop_first, loop_last: 3 to 2 is no range"):
        dumps.frames(project)


def test_another_order_of_bytes_can_be_said() -> None:
    project = decode_image(DUMP_A[6:])
    assert dumps.from_dump(encode_image(project, "big"), order="big").project == project


@given(projects())
def test_a_project_is_its_frames(project: Project) -> None:
    frames = dumps.frames(project)
    total = project.total_steps
    assert len(frames) == 9 + 7 * total
    assert frames[0][2] == 0x6E
    assert frames[-1][2:4] == bytes((0x2E, project.number))
    assert [len(frame) for frame in frames] == [11] * len(frames)
    executed = Project(
        **{
            **{name: getattr(project, name) for name in Project.__dataclass_fields__},
            "steps": project.steps[:total] + Project().steps[total:],
        }
    )
    found = Project()
    for frame in frames[:-1]:
        request = wire.decode_request(frame)
        assert request is not None
        found = edited(found, request.command.name, request.values)
    assert found == executed
    assert dumps.frames(project, save=False) == frames[:-1]


def test_the_order_of_frames_is_that_of_a_restore() -> None:
    names = [wire.decode_request(frame) for frame in dumps.frames(decode_image(DUMP_A[6:]))]
    assert [request.command.number for request in names if request] == [
        "1", "2", "3", "11", "12", "21", "25", "26", "4", "5", "6", "7", "8", "9", "10", "16",
    ]  # fmt: skip


@given(st.binary(max_size=600))
def test_no_bytes_do_more_than_be_refused(data: bytes) -> None:
    with pytest.raises(RequestError) as caught:
        dumps.from_dump(data[:219])
    assert "\n" not in caught.value.summary


@given(st.binary(min_size=220, max_size=220))
def test_any_image_is_taken_when_nobody_judges_it(image: bytes) -> None:
    assert dumps.from_dump(image, strict=False).image == image


def test_a_cleared_project_has_no_frames_to_write() -> None:
    """Its first frames would be ignored, and the rest written into whichever project is selected."""
    with pytest.raises(RequestError, match="cleared: there is nothing to write"):
        dumps.frames(Project(number=3))


def test_numbers_that_a_controller_ignores_make_no_frames() -> None:
    with pytest.raises(RequestError, match="number: 5"):
        dumps.frames(replace(decode_image(DUMP_B[6:]), number=5))
