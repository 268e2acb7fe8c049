"""FEETECH bytes as text: every byte once, both readings of a packet in doubt, the reason of a fault, the right map."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.family import Explanation
from motorbus.families.feetech import protocol
from motorbus.families.feetech.decode import decode
from tests.protocol.feetech.test_protocol import STREAMS
from tests.protocol.feetech.vectors import INVALID, VALID, name_of
from tests.protocol.vectors import Vector

BY_STS = ", by the STS map"


def one(text: str) -> Explanation:
    (explanation,) = decode(bytes.fromhex(text))
    return explanation


def meanings(explanation: Explanation) -> dict[str, str]:
    return {part.name: part.meaning for part in explanation.parts}


@given(st.one_of(STREAMS, st.binary(max_size=64)))
def test_every_byte_of_anything_is_explained_once(data: bytes) -> None:
    explanations = decode(data)
    assert b"".join(explanation.data for explanation in explanations) == data
    for explanation in explanations:
        start = 0
        for part in explanation.parts:
            assert part.start == start
            assert all((part.data, part.name, part.meaning))
            start += len(part.data)
        assert start == len(explanation.data)
        assert explanation.title


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_valid_packet_has_no_fault_and_all_fields(vector: Vector) -> None:
    (explanation,) = decode(vector.data)
    names = [part.name for part in explanation.parts]
    assert (explanation.fault, names[:3], names[-1]) == ("", ["header", "id", "length"], "checksum")
    if vector.direction == "instruction":
        name = protocol.instruction_name(protocol.Instruction[vector.expected["instruction"]])
        assert explanation.title.startswith(f"{name} to ")
    elif vector.id != "echo-or-alarm":
        assert explanation.title.startswith(f"status packet of servo {vector.expected['servo']}")


# -- readings --------------------------------------------------------------------------------------------------


def test_a_packet_of_two_readings_shows_both() -> None:
    explanation = one("FF FF 01 02 01 FB")
    assert explanation.title == "PING to servo 1 (or status packet of servo 1: alarm voltage)"
    assert meanings(explanation)["instruction"] == "PING; as an error byte: alarm voltage"
    explanation = one("FF FF 01 02 55 A7")
    assert "unknown (0x55) to servo 1" in explanation.title


def test_a_request_names_its_one_reply_and_an_echo_names_none() -> None:
    reply = "FF FF 01 04 00 18 05 DD"
    talk = decode(bytes.fromhex(f"FF FF 01 04 02 38 02 BE FF FF 01 04 02 38 02 BE {reply} {reply}"))
    assert meanings(talk[0])["address"] == "register 56, present_position"
    assert "an echo" in talk[1].title
    assert meanings(talk[2])["present_position"] == f"1304 (2 rad){BY_STS}"
    word = meanings(talk[3])["parameters"]
    assert word == "1304 if little-endian (STS, SMS, HLS), 6149 if big-endian (SCS)"


def test_replies_of_a_sync_read_are_named() -> None:
    train = b"".join(protocol.frame(id, 0, bytes((id, 4))) for id in (2, 1))
    talk = decode(protocol.sync_read(56, 2, [1, 2]) + train, usual="sts")
    assert [meanings(reply)["present_position"][:4] for reply in talk[1:]] == ["1026", "1025"]


@pytest.mark.parametrize(
    ("address", "data", "name", "meaning"),
    [
        (42, "00 08", "goal_position", "2048 (3.142 rad)"),
        (40, "01", "torque_enable", "1 (on)"),
        (19, "2C", "unload_mask", "44 (temperature, current, overload)"),
        (18, "00", "phase", "0 (none)"),
        (31, "74 0E", "homing_offset", "-1652 (-2.534 rad)"),
        (43, "08", "data", "register 43, second byte of goal_position: 8"),
        (42, "08", "data", "register 42, goal_position: 8"),
        (200, "07", "data", "register 200, not in the map: 7"),
    ],
)
def test_values_are_shown_as_their_row_says(address: int, data: str, name: str, meaning: str) -> None:
    (explanation,) = decode(protocol.write(1, address, bytes.fromhex(data)), {1: "sts"})
    assert meanings(explanation)[name] == meaning


# -- faults ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("FF FF 01 04 00 18 05", "length 4 means 8 bytes but 7 are there"),
        ("FF FF 01 FF 00 FC", "length 255 means 259 bytes but 6 are there"),
        ("FF FF 01 03 00 18 05", "checksum 05 is wrong, should be E3"),
        ("FF FF 01 01 00 FD", "length 1 is impossible"),
        ("FF FF FF 02 01 FD", "id 255 is impossible"),
        ("FF FF 01", "cut off after 3 bytes"),
        ("FF FF", "FF without a packet"),
        ("AA BB", "no packet begins here"),
        ("FF FF 01 02 00 FD", "checksum FD is wrong, should be FC"),
        ("FF FF FE 02 55 AA", "instruction 0x55 is unknown"),
        ("FF FF FE 03 03 05 F6", "WRITE with 1 byte of parameters cannot be carried out"),
        ("FF FF FE 04 02 28 00 D3", "READ of no byte"),
        ("FF FF FE 04 02 28 01 D2", "no servo answers a READ to everyone"),
    ],
)
def test_a_fault_has_its_reason(text: str, fault: str) -> None:
    assert one(text).fault.startswith(fault)


def test_an_invalid_packet_of_the_manual_shows_its_right_checksum() -> None:
    for vector in INVALID:
        fault = f"checksum CE is wrong, should be {vector.expected['checksum']}"
        assert one(vector.data.hex()).fault == fault


def test_stray_bytes_invalid_and_valid_packets_are_separate() -> None:
    explanations = decode(bytes.fromhex("AA BB FF FF 01 04 00 FF FF 01 02 00 FC FF FF 02 02 00 00"))
    assert [(explanation.data.hex(), bool(explanation.fault)) for explanation in explanations] == [
        ("aabb", True),
        ("ffff010400", True),
        ("ffff010200fc", False),
        ("ffff02020000", True),
    ]


# -- maps ------------------------------------------------------------------------------------------------------

HLS = protocol.read(1, 0, 5) + protocol.frame(1, 0, bytes((3, 43, 0, 10, 18)))
GOAL = bytes.fromhex("FF FF 01 09 03 2A 02 00 00 00 03 E8 DB")  # 512 at 1000 counts/s on SCS


def test_the_map_of_a_servo_is_given_or_read_or_said_to_be_that_of_sts() -> None:
    (unknown,), (scs,), (known,) = decode(GOAL), decode(GOAL, usual="scs"), decode(GOAL, {1: "scs"})
    assert meanings(unknown)["goal_position"] == f"2 (0.003068 rad){BY_STS}"
    assert meanings(unknown)["address"] == "register 42, goal_position"
    assert meanings(scs) == meanings(known)
    assert meanings(scs)["goal_position"] == "512 (2.618 rad)"


def test_a_servo_that_was_read_is_named_by_its_own_map() -> None:
    talk = decode(HLS + protocol.sync_write(44, [(1, b"\x64\x00"), (2, b"\x64\x00")]))
    rows = [(part.name, part.meaning) for part in talk[2].parts[7:10:2]]
    assert rows == [("goal_torque", "100 (0.65 A)"), ("goal_time", f"100{BY_STS}")]
    alarm = protocol.read(1, 66, 1) + protocol.frame(1, 0x10, b"\x00")
    assert decode(alarm)[1].title.endswith(f"alarm angle{BY_STS}")
    assert decode(HLS + alarm)[3].title.endswith("alarm undefined bit 4")
