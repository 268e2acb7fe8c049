"""Every byte has a name, a valid frame has no fault, and an invalid one gives its reason."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.family import Explanation
from motorbus.core.recording import RecordedFrame
from motorbus.core.request import Noise
from motorbus.families.stepper import protocol
from motorbus.families.stepper.decode import explain
from motorbus.families.stepper.protocol import Recording
from tests.protocol.stepper.vectors import ALL, DUMP_A, DUMP_B, INVALID, VALID, name_of
from tests.protocol.vectors import Vector

KNOWN = st.sampled_from([vector.data for vector in ALL])


def only(data: bytes | str) -> Explanation:
    (one,) = explain(bytes.fromhex(data) if isinstance(data, str) else data)
    return one


def assert_whole(data: bytes, found: list[Explanation]) -> None:
    """Every byte is in exactly one part of exactly one explanation."""
    assert b"".join(one.data for one in found) == data
    for one in found:
        assert one.title
        starts = [part.start for part in one.parts]
        assert b"".join(part.data for part in one.parts) == one.data
        assert starts == sorted(starts)
        assert all(part.name and part.meaning for part in one.parts)


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_valid_frame_is_one_without_a_fault(vector: Vector) -> None:
    found = explain(vector.data)
    assert_whole(vector.data, found)
    assert [one.fault for one in found] == [""]


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_an_invalid_frame_gives_its_reason(vector: Vector) -> None:
    found = explain(vector.data)
    assert_whole(vector.data, found)
    assert any(one.fault for one in found)


@pytest.mark.parametrize(
    ("data", "title"),
    [
        ("FF AA 03 07 E8 03 00 00 00 01 9F", "request: Set the pause after a step, delay 1000 ms, step 1"),
        (
            "FF AA 03 01 08 00 B4 00 00 00 69",
            "request: Set microsteps and step angle, microsteps 8 per full step, step angle 180 hundredths of a degree",
        ),
        ("FF AA 00 0C 05 01 00 00 00 00 BB", "request: Set an output, port 5 (both LEDs), level 1 (active)"),
        (
            "FF AA 8E FF 00 00 00 00 00 00 36",
            "request: Set how often a project runs, project loop 255 (endless)",
        ),
        ("FF AA 00 0B 02 01", "reply: Read an input, port 2, level 1 (active)"),
        ("FF AA 7E 04 00 00", "reply: Set the step loop, project 4"),
        ("EE DD", "notice: the project has ended"),
    ],
)
def test_the_title_has_the_content(data: str, title: str) -> None:
    assert only(data).title == title


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        ("FF AA 03 07 D0 07 00 00 00 01 9F", "the checksum is 9F, 8B is correct"),
        ("FF AA 1E 01 00 00 00 00 00 00 C9", "the checksum is C9, C8 is correct"),
        (
            "FF AA 00 0C 00 00 00 00 00 00 B6",
            "the checksum is B6, B5 is correct; port: 0 is not possible: 1 to 5",
        ),
        ("FF AA 03 06 09 00 00 00 00 01 BC", "step 1, output: 9 is not possible: 0 to 8"),
        ("FF AA BE 01 00 00 00 00 00 00 68", "no command BE 01"),
        ("01 02 03", "3 bytes of no frame"),
        ("EE", "1 byte of no frame"),
    ],
)
def test_the_fault_has_the_reason(data: str, fault: str) -> None:
    assert only(data).fault == fault


def test_every_byte_of_a_dump_has_a_name() -> None:
    one = only(DUMP_B)
    named = {part.name: part.meaning for part in one.parts}
    assert (named["microsteps"], named["step_2_distance"]) == ("16 per full step", "56814 units")
    assert (named["step_3_output"], named["step 4"]) == ("8 (all off)", "all 0")
    assert [part.start for part in one.parts if part.name == "reserved"] == [18, 23, 42, 62, 82]


@pytest.mark.parametrize(
    ("offset", "value", "says"),
    [
        (36, 9, "step 1, output: 9 is not possible (0 to 8"),
        (6, 3, "the reply names project 2 and its image 3"),
        (9, 11, "loop_last: 11 is not possible (0 to 10"),
        (18, 7, ""),
    ],
)
def test_a_dump_that_no_controller_stores_says_where(offset: int, value: int, says: str) -> None:
    one = only(DUMP_B[:offset] + bytes((value,)) + DUMP_B[offset + 1 :])
    assert says in one.fault
    assert bool(one.fault) is bool(says)
    assert only(b"\xff\xaa\x3e\x04\0\0" + bytes(220)).fault == ""


def test_a_conversation_is_split() -> None:
    request, reply = protocol.encode("start_project", project=1), bytes.fromhex("FFAA4E010000")
    run = request + reply + protocol.NOTICE + protocol.encode("read_project", project=1) + DUMP_A
    found = explain(run)
    assert_whole(run, found)
    assert [(len(one.data), one.fault) for one in found] == [(11, ""), (6, ""), (2, ""), (11, ""), (226, "")]


@given(st.lists(st.one_of(KNOWN, st.binary(max_size=12)), max_size=6))
def test_any_bytes_are_explained_whole(pieces: list[bytes]) -> None:
    assert_whole(b"".join(pieces), explain(b"".join(pieces)))


# -- recordings ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("direction", "kinds"), [("", ["request", "notice"]), ("tx", ["request"]), ("rx", ["reply", "notice"])]
)
def test_the_direction_tells_a_request_from_a_reply(direction: str, kinds: list[str]) -> None:
    recording = Recording(direction)
    events = recording.feed(protocol.encode("stop_motor") + protocol.NOTICE) + recording.flush()
    assert [event.kind for event in events if isinstance(event, RecordedFrame)] == kinds


@given(st.lists(st.one_of(KNOWN, st.binary(max_size=12)), max_size=6), st.data())
def test_a_recording_does_not_depend_on_its_chunks(pieces: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(pieces)
    for direction in ("", "rx", "tx"):
        whole, cut = Recording(direction), Recording(direction)
        events, at = [], 0
        while at < len(stream):
            size = data.draw(st.integers(1, 40))
            events += cut.feed(stream[at : at + size])
            at += size
        frames = [one for one in whole.feed(stream) + whole.flush() if not isinstance(one, Noise)]
        assert [one for one in events + cut.flush() if not isinstance(one, Noise)] == frames
