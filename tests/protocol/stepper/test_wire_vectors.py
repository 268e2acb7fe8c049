"""Every frame of the manual and of further sources, made by the encoders and taken apart by the decoders."""

from __future__ import annotations

from collections import Counter
from hashlib import sha256

import pytest

from motorbus.core.request import Noise, Notification, Reply
from motorbus.families.stepper import wire
from tests.protocol.stepper.vectors import (
    ALL,
    DUMP_A,
    DUMP_B,
    INVALID,
    MANUAL,
    NOTICES,
    REPLIES,
    REQUESTS,
    VALID,
    name_of,
)
from tests.protocol.vectors import Vector

PAIRS = [
    (request, reply)
    for request in MANUAL
    for reply in MANUAL
    if request.id.endswith("-request") and reply.id == request.id.replace("-request", "-reply")
]
# requests whose documented reply is their own beginning, with the manual's examples
ECHOING = {"13", "14", "15", "16", "17a", "17b", *map(str, range(18, 27))}


def test_the_manual_is_complete() -> None:
    assert [vector.command for vector in MANUAL if vector.id.endswith("-request")] == list(wire.COMMANDS)
    assert len(wire.COMMANDS) == 27
    kinds = Counter(command.kind for command in wire.COMMANDS.values())
    assert kinds == {"system": 10, "motor": 15, "io": 2}
    assert {c.code for c in wire.COMMANDS.values() if c.kind == "motor"} == set(range(1, 16))
    assert {c.code for c in wire.COMMANDS.values() if c.kind == "system"} == {
        0x10 * n + 14 for n in range(1, 11)
    }


def test_every_vector_says_where_it_is_from_and_has_a_name_of_its_own() -> None:
    assert all(vector.source and vector.meaning for vector in ALL)
    assert len({vector.id for vector in ALL}) == len(ALL)


def test_each_slip_of_the_manual_has_its_vectors() -> None:
    for slip in ("delay-annotation", "clear-checksum", "output-port", "input-port"):
        found = [vector for vector in ALL if vector.errata == slip and vector.direction == "instruction"]
        assert [vector.valid for vector in found] == [True, False], slip
    assert {vector.errata for vector in ALL if vector.errata} >= {
        "number-17-twice",
        "stop-carries-no-project",
    }


@pytest.mark.parametrize("vector", REQUESTS, ids=name_of)
def test_a_request_is_made_and_taken_apart(vector: Vector) -> None:
    values = vector.expected["values"]
    assert wire.encode(vector.command, **values) == vector.data
    request = wire.decode_request(vector.data)
    assert request is not None
    assert (request.command.name, dict(request.values)) == (vector.command, values)
    assert request.motor == (3 if request.command.kind == "motor" else 0)
    assert vector.data[-1] == wire.checksum(vector.data) == sum(vector.data[:10]) % 256


@pytest.mark.parametrize("vector", REPLIES, ids=name_of)
def test_a_reply_is_taken_apart(vector: Vector) -> None:
    reply = wire.decode_reply(vector.data)
    assert reply is not None
    assert reply.command.name == vector.command
    for name in ("project", "step", "port", "level"):
        assert getattr(reply, name) == vector.expected.get(name), name
    assert reply.data == vector.data[6:]


@pytest.mark.parametrize(("request_", "reply"), PAIRS, ids=name_of)
def test_the_reply_to_each_example_is_made_and_is_exactly_what_is_due(
    request_: Vector, reply: Vector
) -> None:
    assert wire.encode_reply(request_.data, project=1) == reply.data
    assert wire.difference(request_.data, reply.data) == ""
    assert wire.difference(request_.data, reply.data, project=1) == ""


def test_there_is_a_pair_for_each_example_but_the_dump() -> None:
    assert len(PAIRS) == 26


@pytest.mark.parametrize(("request_", "reply"), PAIRS, ids=name_of)
def test_one_bit_wrong_in_a_reply_is_seen_wherever_a_byte_says_something(
    request_: Vector, reply: Vector
) -> None:
    for bit in range(48):
        damaged = bytearray(reply.data)
        damaged[bit // 8] ^= 1 << bit % 8
        unseen = request_.command == "read_input" and bit == 40  # the level itself
        assert bool(wire.difference(request_.data, bytes(damaged), project=1)) is not unseen, bit


@pytest.mark.parametrize("vector", [v for v in MANUAL if v.id.endswith("-request")], ids=name_of)
def test_which_replies_are_their_own_echo(vector: Vector) -> None:
    number = vector.id.removeprefix("ex").removesuffix("-request")
    assert wire.COMMANDS[vector.command].number == number
    same = number in ECHOING
    due = wire.encode_reply(
        vector.data, project=1, image=bytes(220) if vector.command == "read_project" else b""
    )
    assert (due[:6] == vector.data[:6]) is same
    assert wire.looks_like_echo(vector.data) is (same and number != "15")  # a dump is longer than its echo


def test_fifteen_of_twenty_seven_replies_are_their_own_echo() -> None:
    assert len(ECHOING) == 15


@pytest.mark.parametrize("vector", [*REPLIES, *NOTICES], ids=name_of)
def test_what_a_device_says_is_received_whole_and_byte_by_byte(vector: Vector) -> None:
    for size in (1, 2, 5, len(vector.data)):
        receiver = wire.Receiver()
        events = [
            event
            for at in range(0, len(vector.data), size)
            for event in receiver.feed(vector.data[at : at + size])
        ]
        if vector in NOTICES:
            assert events == [Notification(1, "completed", vector.data)]
        else:
            assert events == [Reply(0, wire.key_of(vector.data), vector.data)]
        assert receiver.held == 0


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_what_is_no_frame_is_neither_request_nor_reply(vector: Vector) -> None:
    assert wire.decode_request(vector.data) is None
    assert wire.decode_reply(vector.data) is None
    receiver = wire.Receiver()
    events = receiver.feed(vector.data) + receiver.flush()
    if vector.direction == "status":
        assert {type(event) for event in events} == {Noise}
    assert b"".join(event.data for event in events) == vector.data


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_cut_short_it_is_nothing(vector: Vector) -> None:
    for count in range(len(vector.data)):
        cut = vector.data[:count]
        assert wire.decode_request(cut) is None
        if count != 6 or cut[2] == 0x3E:
            assert wire.decode_reply(cut) is None


def test_the_dumps_are_the_ones_that_were_meant() -> None:
    assert sha256(DUMP_A).hexdigest().startswith("5bd496b00e4597b0")
    assert sha256(DUMP_B).hexdigest().startswith("d2629e2ab31e7a52")
    for data, project in ((DUMP_A, 1), (DUMP_B, 2)):
        dump = wire.decode_dump(data, project)
        assert dump == wire.Dump(project, data[6:])
        assert wire.encode_dump(*dump) == data
        assert b"".join(dump.row(number) for number in range(11)) == dump.image
