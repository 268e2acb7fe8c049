"""Every byte has a name, every good frame no fault, and every bad one says what is wrong."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.family import Explanation
from motorbus.families.stepper import wire
from motorbus.families.stepper.explain import explain
from tests.protocol.stepper.vectors import ALL, DUMP_A, DUMP_B, INVALID, VALID, name_of
from tests.protocol.vectors import Vector

KNOWN = st.sampled_from([vector.data for vector in ALL])


def only(data: bytes | str) -> Explanation:
    (one,) = explain(bytes.fromhex(data) if isinstance(data, str) else data)
    return one


def is_whole(data: bytes, told: list[Explanation]) -> bool:
    """Every byte in exactly one part of exactly one explanation."""
    for one in told:
        assert b"".join(part.data for part in one.parts) == one.data
        assert [part.start for part in one.parts] == [
            sum(len(other.data) for other in one.parts[:n]) for n in range(len(one.parts))
        ]
        assert one.title
        assert all(part.name and part.meaning for part in one.parts)
    return b"".join(one.data for one in told) == data


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_good_frame_is_one_and_has_no_fault(vector: Vector) -> None:
    told = explain(vector.data)
    assert is_whole(vector.data, told)
    assert [one.fault for one in told] == [""]


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_a_bad_one_says_what_is_wrong(vector: Vector) -> None:
    told = explain(vector.data)
    assert is_whole(vector.data, told)
    assert any(one.fault for one in told)


@pytest.mark.parametrize(
    ("data", "title"),
    [
        ("FF AA 03 07 E8 03 00 00 00 01 9F", "request: Set the pause after a step, delay 1000 ms, step 1"),
        (
            "FF AA 03 01 08 00 B4 00 00 00 69",
            "request: Set microsteps and step angle, microsteps 8, step angle 1.8° (180)",
        ),
        ("FF AA 00 0C 05 01 00 00 00 00 BB", "request: Set an output, port 5 (both LEDs), level 1 (active)"),
        (
            "FF AA 03 06 05 00 00 00 00 01 B8",
            "request: Set what a step does to the outputs, output 5 (output 1 off), step 1",
        ),
        (
            "FF AA 8E FF 00 00 00 00 00 00 36",
            "request: Set how often a project runs, project loop 255 (endless)",
        ),
        ("FF AA 00 0B 02 01", "reply: Read an input: acknowledged, port 2; level 1 (active)"),
        ("FF AA 4E 04 00 00", "reply: Start a project: acknowledged, project 4"),
        ("EE DD", "a project has run to its end"),
    ],
)
def test_what_is_said_is_in_the_title(data: str, title: str) -> None:
    assert only(data).title == title


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        ("FF AA 03 07 D0 07 00 00 00 01 9F", "the checksum is 9F, 8B is right"),
        ("FF AA 1E 01 00 00 00 00 00 00 C9", "the checksum is C9, C8 is right"),
        (
            "FF AA 00 0C 00 00 00 00 00 00 B6",
            "the checksum is B6, B5 is right; port 0 is not possible: 1 to 5",
        ),
        ("FF AA 03 06 09 00 00 00 00 01 BC", "output 9 is not possible: 0 to 8"),
        ("FF AA BE 01 00 00 00 00 00 00 68", "there is no command BE 01"),
        ("FF AA 03 03 00", "5 bytes of a reply of 6"),
        ("FF AA 03 03 00 0B", "byte 5 is 0B"),
        ("01 02 03", "3 bytes that belong to no frame"),
        ("EE", "a byte that belongs to no frame"),
    ],
)
def test_what_is_wrong_is_told(data: str, fault: str) -> None:
    assert only(data).fault == fault


def test_every_byte_of_a_dump_has_a_name() -> None:
    one = only(DUMP_B)
    assert one.title == "dump of project 2, 3 steps"
    named = {part.name: part.meaning for part in one.parts}
    assert named["microsteps"] == "16"
    assert named["step_2_distance"] == "56814 units"
    assert named["step_3_output"] == "8 (all off)"
    assert named["step 4"] == "all 0"
    assert [part.start for part in one.parts if part.name == "project, reserved"] == [18, 23]
    assert sum(len(part.data) for part in one.parts) == 226


@pytest.mark.parametrize(
    ("offset", "value", "says"),
    [
        (36, 9, "step 1, output: 9 is not possible (0 to 8)"),
        (6, 3, "number: the reply says project 2 and its image 3 (2 twice)"),
        (9, 11, "loop_last: 11 is not possible (0 to 10"),
        (9, 9, ""),  # a project that was shortened: the lint is for that
        (18, 7, ""),
    ],
)
def test_a_dump_that_cannot_be_right_says_where(offset: int, value: int, says: str) -> None:
    one = only(DUMP_B[:offset] + bytes((value,)) + DUMP_B[offset + 1 :])
    assert says in one.fault
    assert bool(one.fault) is bool(says)


def test_a_loop_that_nobody_would_send_is_a_fault() -> None:
    wrong, right = (
        only(wire.encode("set_segment_loop", loop_first=a, loop_last=b, loop_count=2))
        for a, b in ((5, 3), (3, 5))
    )
    assert (
        wrong.fault
        == "loop_first, loop_last: 5 to 3 is no range: the first step, then the last, or 0 for both"
    )
    assert right.fault == ""


def test_a_cleared_project_is_no_fault() -> None:
    assert only(wire.encode_dump(4, bytes(220))).fault == ""


def test_a_conversation_is_taken_apart() -> None:
    request, reply = wire.encode("start_project", project=1), bytes.fromhex("FFAA4E010000")
    run = request + reply + wire.NOTICE + wire.encode("read_project", project=1) + DUMP_A + wire.NOTICE
    told = explain(run)
    assert is_whole(run, told)
    assert [len(one.data) for one in told] == [11, 6, 2, 11, 226, 2]
    assert [one.fault for one in told] == [""] * 6


@given(st.lists(st.one_of(KNOWN, st.binary(max_size=12)), max_size=6))
def test_any_bytes_are_told_whole(pieces: list[bytes]) -> None:
    data = b"".join(pieces)
    assert is_whole(data, explain(data))
