"""Every packet of the vendor's manual, right or wrong, fed whole, byte by byte and with noise around it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import pytest

from motorbus.core.request import Noise, Reply
from motorbus.errors import ChecksumError, RequestError
from motorbus.families.feetech import wire
from tests.protocol.feetech.vectors import (
    ALL,
    INVALID,
    MANUAL,
    REPLIES,
    REQUESTS,
    VALID,
    name_of,
)
from tests.protocol.vectors import Vector

# Each of these ends where the packet begins; the last three look like packets that would swallow it.
BEFORE = [
    "",
    "FF",
    "FF FF",
    "00",
    "55 FF AA",
    "FF FF 01",
    "FF FF 01 02",
    "FF FF 01 40 00",
    "FF FF 01 FF 03 2A",
]
AFTER = ["", "FF", "FF FF", "00 FF", "FF FF 01", "FF FF 01 09 03 2A"]


def splitter(vector: Vector) -> wire.Splitter:
    return wire.Splitter("status" if vector.direction == "status" else "instruction")


def whole(split: wire.Splitter, data: bytes) -> list[wire.Packet | Noise]:
    return [*split.feed(data), *split.flush()]


def byte_by_byte(split: wire.Splitter, data: bytes) -> list[wire.Packet | Noise]:
    fed = [event for at in range(len(data)) for event in split.feed(data[at : at + 1])]
    return [*fed, *split.flush()]


def packet_of(vector: Vector) -> wire.Packet:
    expected = vector.expected
    if vector.direction == "status":
        return wire.StatusPacket(expected["servo"], expected["error"], vector.parameters, vector.data)
    code = wire.Instruction[expected["instruction"]]
    return wire.InstructionPacket(expected["servo"], code, vector.parameters, vector.data)


def test_the_manual_prints_23_packets_and_4_of_them_are_wrong() -> None:
    assert len(MANUAL) == 23
    assert [vector.id for vector in MANUAL if not vector.valid] == [
        "ex5-id7",
        "ex5-id8",
        "ex5-id9",
        "ex5-id10",
    ]
    assert {vector.id for vector in MANUAL if vector.errata} == {
        *("ex3-write-id", "ex4-request"),
        *("ex5-id7", "ex5-id8", "ex5-id9", "ex5-id10"),
        *("reset-line", "reset-table", "reset-reply"),
    }


def test_every_vector_says_where_it_is_from_and_has_a_name_of_its_own() -> None:
    assert all(vector.source and vector.meaning for vector in ALL)
    assert len({vector.id for vector in ALL}) == len(ALL)


@pytest.mark.parametrize("feed", [whole, byte_by_byte])
@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_valid_packet_is_read(
    vector: Vector, feed: Callable[[wire.Splitter, bytes], list[wire.Packet | Noise]]
) -> None:
    assert feed(splitter(vector), vector.data) == [packet_of(vector)]


@pytest.mark.parametrize("feed", [whole, byte_by_byte])
@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_noise_around_a_valid_packet_is_told_apart(
    vector: Vector, feed: Callable[[wire.Splitter, bytes], list[wire.Packet | Noise]]
) -> None:
    for before, after in product(BEFORE, AFTER):
        data = bytes.fromhex(before) + vector.data + bytes.fromhex(after)
        events = feed(splitter(vector), data)
        around = f"between {before!r} and {after!r}"
        assert [event for event in events if not isinstance(event, Noise)] == [packet_of(vector)], around
        assert b"".join(event.data for event in events) == data, around


@pytest.mark.parametrize("feed", [whole, byte_by_byte])
@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_an_invalid_packet_is_noise_whatever_is_around_it(
    vector: Vector, feed: Callable[[wire.Splitter, bytes], list[wire.Packet | Noise]]
) -> None:
    for before, after in product(BEFORE, AFTER):
        events = feed(splitter(vector), bytes.fromhex(before) + vector.data + bytes.fromhex(after))
        assert {type(event) for event in events} == {Noise}, f"between {before!r} and {after!r}"


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_an_invalid_packet_is_a_checksum_error_that_names_the_right_sum(vector: Vector) -> None:
    assert whole(splitter(vector), vector.data) == [Noise(vector.data, "checksum")]
    with pytest.raises(ChecksumError, match="CE is wrong") as caught:
        wire.decode_instruction(vector.data)
    assert caught.value.expected == f"{vector.expected['checksum']} as the last byte"
    assert caught.value.received == vector.data


@pytest.mark.parametrize("vector", REPLIES, ids=name_of)
def test_a_reply_reaches_the_bus_under_the_id_of_its_servo(vector: Vector) -> None:
    assert wire.StatusReceiver().feed(vector.data) == [Reply(0, vector.expected["servo"], vector.data)]
    assert wire.decode_status(vector.data) == packet_of(vector)


@pytest.mark.parametrize("vector", REPLIES, ids=name_of)
def test_the_encoder_makes_the_same_reply(vector: Vector) -> None:
    expected = vector.expected
    assert wire.encode_status(expected["servo"], expected["error"], vector.parameters) == vector.data


@pytest.mark.parametrize("vector", REQUESTS, ids=name_of)
def test_the_encoder_makes_the_same_request_or_refuses_it(vector: Vector) -> None:
    code = wire.Instruction[vector.expected["instruction"]]
    assert wire.decode_instruction(vector.data) == packet_of(vector)
    if wire.RULES[code].sent:
        made = wire.encode_instruction(vector.expected["servo"], code, vector.parameters)
        assert made == vector.data
    else:
        with pytest.raises(RequestError, match="never sent"):
            wire.encode_instruction(vector.expected["servo"], code, vector.parameters)


POSE = bytes.fromhex("00 08 00 00 E8 03")
MADE = {
    "ex1-request": wire.ping(1),
    "ex2-request": wire.read(1, 0x38, 2),
    "ex3-write-id": wire.write(wire.BROADCAST, 5, b"\x01"),
    "ex4-request": wire.write(1, 0x2A, POSE),
    "ex5-id1": wire.reg_write(1, 0x2A, POSE),
    "ex5-id10-right": wire.reg_write(10, 0x2A, POSE),
    "ex6-action": wire.action(),
    "ex7-sync-write": wire.sync_write(0x2A, [(id, POSE) for id in (1, 2, 3, 4)]),
    "reset-line": wire.factory_restore(1),
    "clear-turns": wire.clear_turns(1),
    "calibrate": wire.calibrate(1, bytes.fromhex("00 04")),
    "sync-read": wire.sync_read(56, 15, [1, 2, 3]),
}


@pytest.mark.parametrize("id", MADE)
def test_every_request_has_a_function_that_makes_it(id: str) -> None:
    assert MADE[id] == next(vector.data for vector in REQUESTS if vector.id == id)
