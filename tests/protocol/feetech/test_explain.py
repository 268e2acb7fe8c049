"""What `decode` tells of FEETECH bytes: every byte in words, both readings of a doubtful one, each fault's reason."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.family import Explanation
from motorbus.families.feetech import wire
from motorbus.families.feetech.explain import explain
from tests.protocol.feetech.test_wire_stream import STREAMS
from tests.protocol.feetech.vectors import INVALID, REPLIES, REQUESTS, VALID, name_of
from tests.protocol.vectors import Vector


def told(text: str) -> list[Explanation]:
    return explain(bytes.fromhex(text))


def one(text: str) -> Explanation:
    (explanation,) = told(text)
    return explanation


def meanings(explanation: Explanation) -> dict[str, str]:
    return {part.name: part.meaning for part in explanation.parts}


def check_coverage(data: bytes) -> None:
    """Every byte is in one explanation, and in one part of it, at the place the part says."""
    explanations = explain(data)
    assert b"".join(explanation.data for explanation in explanations) == data
    for explanation in explanations:
        assert b"".join(part.data for part in explanation.parts) == explanation.data
        starts = [
            sum(len(part.data) for part in explanation.parts[:at]) for at in range(len(explanation.parts))
        ]
        assert [part.start for part in explanation.parts] == starts
        assert all(part.data and part.name and part.meaning for part in explanation.parts)
        assert explanation.title


@given(st.one_of(STREAMS, st.binary(max_size=64)))
def test_every_byte_of_anything_is_explained_once(data: bytes) -> None:
    check_coverage(data)


def test_nothing_needs_no_words() -> None:
    assert explain(b"") == []


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_good_packet_has_no_fault_and_all_fields(vector: Vector) -> None:
    check_coverage(vector.data)
    (explanation,) = explain(vector.data)
    assert explanation.fault == ""
    names = [part.name for part in explanation.parts]
    assert names[:3] == ["header", "id", "length"]
    assert names[3] in ("instruction", "error")
    assert names[-1] == "checksum"
    assert explanation.parts[-1].meaning == "right"


@pytest.mark.parametrize("vector", REQUESTS, ids=name_of)
def test_a_request_is_read_as_its_instruction(vector: Vector) -> None:
    (explanation,) = explain(vector.data)
    name = wire.instruction_name(wire.Instruction[vector.expected["instruction"]])
    assert explanation.title.startswith(f"{name} to ")
    assert meanings(explanation)["instruction"].startswith(name)


@pytest.mark.parametrize(
    "vector", [vector for vector in REPLIES if vector.id != "echo-or-alarm"], ids=name_of
)
def test_a_reply_is_read_as_a_status_packet(vector: Vector) -> None:
    (explanation,) = explain(vector.data)
    assert explanation.title.startswith(f"status packet of servo {vector.expected['servo']}")


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_a_bad_packet_of_the_manual_says_its_right_checksum(vector: Vector) -> None:
    (explanation,) = explain(vector.data)
    assert explanation.fault == f"checksum CE is wrong, should be {vector.expected['checksum']}"
    assert meanings(explanation)["checksum"] == f"wrong, should be {vector.expected['checksum']}"
    check_coverage(vector.data)


# --- readings -----------------------------------------------------------------------------------------------


def test_a_packet_of_two_readings_tells_both() -> None:
    explanation = one("FF FF 01 02 01 FB")
    assert explanation.title == "PING to servo 1 (or status packet of servo 1: alarm voltage)"
    assert meanings(explanation)["instruction"] == "PING; as an error byte: alarm voltage"


def test_an_undefined_error_byte_may_be_an_unknown_instruction() -> None:
    explanation = one("FF FF 01 02 55 A7")
    assert "undefined bit 6" in explanation.title
    assert "unknown (0x55) to servo 1" in explanation.title
    assert explanation.fault == ""


def test_the_reply_after_a_request_is_named_by_what_was_asked() -> None:
    request, reply = told("FF FF 01 04 02 38 02 BE FF FF 01 04 00 18 05 DD")
    assert meanings(request)["address"] == "register 56, present_position"
    assert meanings(request)["count"] == "2 bytes: present_position"
    assert meanings(reply)["present_position"] == "1304 (2 rad)"


def test_a_reply_with_an_alarm_is_still_a_reply() -> None:
    _, reply = told("FF FF 01 02 01 FB FF FF 01 02 02 FA")
    assert reply.title.startswith("status packet of servo 1: alarm sensor")


def test_an_echo_is_told_and_the_answer_after_it_still_named() -> None:
    request, echo, reply = told("FF FF 01 04 02 38 02 BE FF FF 01 04 02 38 02 BE FF FF 01 04 00 18 05 DD")
    assert "an echo" in echo.title
    assert "an echo" not in request.title
    assert meanings(reply)["present_position"].startswith("1304")


def test_one_request_names_one_reply() -> None:
    reply = "FF FF 01 04 00 18 05 DD"
    _, first, second = told(f"FF FF 01 04 02 38 02 BE {reply} {reply}")
    assert "present_position" in meanings(first)
    assert "present_position" not in meanings(second)


def test_a_reply_without_its_request_shows_a_word_in_both_orders() -> None:
    assert meanings(one("FF FF 01 04 00 18 05 DD"))["parameters"].startswith("1304 if little-endian")
    assert "6149 if big-endian" in meanings(one("FF FF 01 04 00 18 05 DD"))["parameters"]


def test_replies_of_a_sync_read_are_named() -> None:
    train = b"".join(wire.encode_status(id, 0, bytes((id, 4))) for id in (2, 1))
    request, second, first = explain(wire.sync_read(56, 2, [1, 2]) + train)
    assert [part.meaning for part in request.parts if part.name == "id"] == [
        "everyone (254)",
        "servo 1",
        "servo 2",
    ]
    assert meanings(second)["present_position"].startswith("1026")
    assert meanings(first)["present_position"].startswith("1025")


def test_written_registers_are_named_with_their_values() -> None:
    write = meanings(one("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5"))
    assert write["address"] == "register 42, goal_position"
    assert write["goal_position"] == "2048 (3.142 rad)"
    assert write["goal_velocity"] == "1000 (1.534 rad/s)"


@pytest.mark.parametrize(
    ("address", "data", "name", "meaning"),
    [
        (40, "01", "torque_enable", "1 (on)"),
        (19, "2C", "unload_mask", "44 (temperature, current, overload)"),
        (18, "00", "phase", "0 (none)"),
        (31, "74 0E", "homing_offset", "-1652 (-2.534 rad)"),
        (43, "08", "data", "register 43, second byte of goal_position: 8"),
        (42, "08", "data", "register 42, goal_position: 8"),
        (200, "07", "data", "register 200, not in the STS map: 7"),
    ],
)
def test_values_are_told_the_way_their_row_says(address: int, data: str, name: str, meaning: str) -> None:
    (explanation,) = explain(wire.write(1, address, bytes.fromhex(data)))
    assert meanings(explanation)[name] == meaning


def test_a_sync_write_names_each_servo_and_its_registers() -> None:
    (explanation,) = explain(wire.sync_write(42, [(1, b"\x00\x08"), (9, b"\x00\x04")]))
    assert explanation.title == "SYNC WRITE to everyone"
    rows = [(part.name, part.meaning) for part in explanation.parts[6:-1]]
    assert rows == [
        ("id", "servo 1"),
        ("goal_position", "2048 (3.142 rad)"),
        ("id", "servo 9"),
        ("goal_position", "1024 (1.571 rad)"),
    ]


# --- faults -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("FF FF 01 04 00 18 05", "length 4 means 8 bytes but only 7 are there"),
        ("FF FF 01 FF 00 FC", "length 255 means 259 bytes but only 6 are there"),
        (
            "FF FF 01 03 00 18 05 DD",
            "length 3 means 7 bytes but 8 are there, and checksum 05 is wrong, should be E3",
        ),
        ("FF FF 01 01 00 FD", "length 1 is impossible"),
        ("FF FF FF 02 01 FD", "id 255 is impossible"),
        ("FF FF 01", "cut off after 3 bytes"),
        ("FF FF", "FF without a packet"),
        ("AA BB", "no packet begins here"),
        ("FF FF 01 02 00 FD", "checksum FD is wrong, should be FC"),
        ("FF FF FE 02 55 AA", "instruction 0x55 is unknown"),
        ("FF FF FE 03 03 05 F6", "WRITE with 1 byte of parameters cannot be carried out"),
    ],
)
def test_a_fault_says_why(text: str, fault: str) -> None:
    assert one(text).fault.startswith(fault)


def test_stray_bytes_broken_and_good_packets_are_told_apart() -> None:
    explanations = told("AA BB FF FF 01 04 00 FF FF 01 02 00 FC FF FF 02 02 00 00")
    assert [explanation.data.hex(" ") for explanation in explanations] == [
        "aa bb",
        "ff ff 01 04 00",
        "ff ff 01 02 00 fc",
        "ff ff 02 02 00 00",
    ]
    assert [bool(explanation.fault) for explanation in explanations] == [True, True, False, True]


# --- maps ---------------------------------------------------------------------------------------------------


def introduced(id: int, *head: int) -> bytes:
    """A servo is asked for registers 0 to 4, and answers."""
    return wire.read(id, 0, 5) + wire.encode_status(id, 0, bytes(head))


def test_a_servo_that_has_said_who_it_is_is_named_by_its_own_map() -> None:
    talk = introduced(1, 3, 43, 0, 10, 18) + introduced(2, 0, 10, 1, 5, 4)
    talk += wire.write(1, 44, b"\x64\x00") + wire.write(2, 42, b"\x02\x00") + wire.write(3, 42, b"\x00\x02")
    hls, scs, other = explain(talk)[4:]
    assert meanings(hls)["goal_torque"] == "100 (0.65 A)"
    assert meanings(scs)["goal_position"] == "512 (2.618 rad)"
    assert meanings(other)["goal_position"] == "512 (0.7854 rad)"


def test_each_servo_of_a_sync_write_is_named_by_its_own_map() -> None:
    talk = introduced(1, 3, 43, 0, 10, 18) + wire.sync_write(44, [(1, b"\x64\x00"), (2, b"\x64\x00")])
    rows = [(part.name, part.meaning) for part in explain(talk)[2].parts[7:10:2]]
    assert rows == [("goal_torque", "100 (0.65 A)"), ("goal_time", "100")]


def test_alarms_are_those_of_the_map_once_it_is_known() -> None:
    alarm = wire.read(1, 66, 1) + wire.encode_status(1, 0x10, b"\x00")
    assert explain(alarm)[1].title.endswith("alarm angle")
    assert explain(introduced(1, 3, 43, 0, 10, 18) + alarm)[3].title.endswith("alarm undefined bit 4")


def test_an_unknown_firmware_is_named_by_the_usual_map() -> None:
    talk = introduced(1, 9, 9, 0, 9, 3) + wire.write(1, 200, b"\x01")
    assert meanings(explain(talk)[2])["data"] == "register 200, not in the STS map: 1"
    talk = introduced(1, 3, 43, 0, 10, 18) + wire.write(1, 200, b"\x01")
    assert meanings(explain(talk)[2])["data"] == "register 200, not in the HLS map: 1"
