"""Every frame of the manual and of further sources is encoded, decoded and received byte for byte."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Event, Noise, Notification, Reply
from motorbus.errors import RequestError
from motorbus.families.stepper import protocol
from motorbus.families.stepper.protocol import COMMANDS, HEADER, NOTICE, Receiver
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
    behaviour,
    name_of,
)
from tests.protocol.vectors import Vector

EXAMPLES = [vector for vector in MANUAL if vector.id.endswith("-request")]
REPLY_TO = {vector.id: vector.data for vector in MANUAL}
PAIRS = [
    (one, REPLY_TO[one.id.replace("request", "reply")]) for one in EXAMPLES if one.command != "read_project"
]
# items whose reply is the beginning of their request, with the values of the example
ECHOING = {"13", "14", "15", "16", "17a", "17b", *map(str, range(18, 27))}
KINDS = {"reply": Reply, "notice": Notification, "noise": Noise}
PIECES = st.sampled_from([vector.data for vector in REPLIES if len(vector.data) == 6] + [DUMP_B, NOTICE])


# -- the table -----------------------------------------------------------------------------------------


def test_each_item_of_the_manual_has_a_row_and_a_vector_in_order() -> None:
    assert [vector.command for vector in EXAMPLES] == list(COMMANDS)
    numbers = [*map(str, range(1, 17)), "17a", "18", "17b", *map(str, range(19, 27))]
    assert [command.number for command in COMMANDS.values()] == numbers
    assert {c.code[1] for c in COMMANDS.values() if c.code[0] == 3} == set(range(1, 16))
    assert {c.code[0] for c in COMMANDS.values() if len(c.code) == 1} == set(range(0x1E, 0xAF, 0x10))


@pytest.mark.parametrize("slip", ["delay-annotation", "clear-checksum", "output-port", "input-port"])
def test_each_slip_of_the_manual_has_its_vectors(slip: str) -> None:
    found = [vector for vector in ALL if vector.errata == slip and vector.direction == "instruction"]
    assert [vector.valid for vector in found] == [True, False]


def test_every_vector_has_a_source_and_a_name_of_its_own() -> None:
    assert all(vector.source and vector.meaning for vector in ALL)
    assert len({vector.id for vector in ALL}) == len(ALL)


# -- requests and replies --------------------------------------------------------------------------------


@pytest.mark.parametrize("vector", REQUESTS, ids=name_of)
def test_a_request_is_encoded_and_decoded(vector: Vector) -> None:
    values = vector.expected["values"]
    assert protocol.encode(vector.command, **values) == vector.data
    assert protocol.decode_request(vector.data) == (COMMANDS[vector.command], values)
    protocol.check(vector.command, values)


@pytest.mark.parametrize(("request_", "reply"), PAIRS, ids=name_of)
def test_the_reply_to_each_example_is_encoded_and_accepted(request_: Vector, reply: bytes) -> None:
    assert protocol.encode_reply(request_.data) == reply
    assert protocol.key_of(reply) == protocol.expected_key(request_.data)


@pytest.mark.parametrize(("request_", "reply"), PAIRS, ids=name_of)
def test_one_wrong_bit_in_a_reply_is_found_unless_no_request_determines_it(
    request_: Vector, reply: bytes
) -> None:
    free = {"set_segment_loop": 3, "set_project_loop": 3, "read_input": 5}.get(request_.command)
    for bit in range(48):
        damaged = bytearray(reply)
        damaged[bit // 8] ^= 1 << bit % 8
        event = Receiver().feed(bytes(damaged))[:1]
        accepted = (
            bool(event)
            and isinstance(event[0], Reply)
            and event[0].key == protocol.expected_key(request_.data)
        )
        assert not accepted or bit // 8 == free, bit


@pytest.mark.parametrize("vector", EXAMPLES, ids=name_of)
def test_which_replies_are_the_beginning_of_their_request(vector: Vector) -> None:
    reply = protocol.encode_reply(vector.data)
    assert (reply == vector.data[:6]) is (COMMANDS[vector.command].number in ECHOING)
    assert protocol.COMMANDS["read_project"].reply_length == 226  # no echo has the length of a dump


@pytest.mark.parametrize("delay", [-1, 1 << 24])
def test_what_no_frame_can_carry_is_refused(delay: int) -> None:
    with pytest.raises(OverflowError):
        protocol.encode("set_step_delay", delay=delay, step=1)
    with pytest.raises(KeyError):
        protocol.encode("set_step_delay", delay=1)


@pytest.mark.parametrize("motor", [0, 256, 0x0E, 0x3E])
def test_a_motor_that_no_frame_can_name_is_refused(motor: int) -> None:
    with pytest.raises(RequestError, match="not ending in E"):
        protocol.checked_motor(motor)


def test_another_motor_has_the_same_commands() -> None:
    decoded = protocol.decode_request(protocol.encode("jog_reverse", motor=7))
    assert decoded == (COMMANDS["jog_reverse"], {})
    assert protocol.encode_reply(protocol.encode("jog_reverse", motor=7)) == b"\xff\xaa\x07\x0b\0\0"


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("set_step_delay", {"delay": 1, "step": 11}, "step: 11 is not possible"),
        ("set_step_output", {"output": 9, "step": 2}, "step 2, output: 9 is not possible"),
        ("set_step_start_input", {"start_input": 3, "step": 1}, "step 1, start_input: 3 is not possible"),
        ("set_segment_loop", {"loop_first": 5, "loop_last": 3, "loop_count": 2}, "5 to 3 is no range"),
        ("select_project", {"project": 1, "total_steps": 0}, "total_steps: 0 is not possible"),
    ],
)
def test_what_the_manual_does_not_allow_names_step_and_field(
    name: str, values: dict[str, int], says: str
) -> None:
    with pytest.raises(RequestError, match=says) as caught:
        protocol.check(name, values)
    assert caught.value.expected


def test_an_expert_may_use_inputs_3_and_4() -> None:
    protocol.check("set_step_stop_input", {"stop_input": 4, "step": 1}, expert=True)
    with pytest.raises(RequestError, match="6 is not possible"):
        protocol.check("set_step_stop_input", {"stop_input": 6, "step": 1}, expert=True)


# -- the receiver ------------------------------------------------------------------------------------------


def events_of(chunks: list[bytes]) -> list[tuple[type, bytes]]:
    """Events of these chunks and of a flush, with noise in a row put together."""
    receiver = Receiver()
    found: list[tuple[type, bytes]] = []
    events: list[Event] = [event for chunk in chunks for event in receiver.feed(chunk)]
    for event in events + receiver.flush():
        if found and found[-1][0] is Noise and isinstance(event, Noise):
            found[-1] = Noise, found[-1][1] + event.data
        else:
            found.append((type(event), event.data))
    return found


@pytest.mark.parametrize("size", [1, 2, 3, 7, 300])
@pytest.mark.parametrize("stream", behaviour("streams"), ids=lambda stream: stream["id"])
def test_a_stream_is_the_same_however_it_is_cut(stream: dict[str, Any], size: int) -> None:
    """Where the stream has a pause, the bus flushes before the next piece."""
    found = []
    for piece in stream["pieces"]:
        data = bytes.fromhex(piece["hex"])
        found += events_of([data[at : at + size] for at in range(0, len(data), size)])
    assert found == [(KINDS[one["kind"]], bytes.fromhex(one["hex"])) for one in stream["events"]]


@pytest.mark.parametrize("vector", [*REPLIES, *NOTICES], ids=name_of)
def test_a_frame_is_received_whole(vector: Vector) -> None:
    receiver = Receiver()
    (event,) = receiver.feed(vector.data)
    if vector in NOTICES:
        assert event == Notification(1, "completed", vector.data)
    else:
        assert event == Reply(0, protocol.key_of(vector.data), vector.data)
    assert receiver.held == 0


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_what_is_no_frame_is_neither_request_nor_reply(vector: Vector) -> None:
    assert protocol.decode_request(vector.data) is None
    if vector.direction == "status":
        assert events_of([vector.data]) == [(Noise, vector.data)]


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_cut_frame_is_nothing(vector: Vector) -> None:
    for count in range(1, len(vector.data)):
        cut = vector.data[:count]
        assert protocol.decode_request(cut) is None
        if vector.direction == "status":
            assert events_of([cut]) == [(Noise, cut)]


def test_a_dump_is_never_searched() -> None:
    """A cut dump whose payload holds EE DD gives no notice: that would be a false end of a project."""
    assert NOTICE in DUMP_B
    assert HEADER in DUMP_B[2:]
    assert events_of([DUMP_B[:100], NOTICE]) == [(Noise, DUMP_B[:100] + NOTICE)]
    assert events_of([NOTICE, DUMP_A, NOTICE]) == [
        (Notification, NOTICE),
        (Reply, DUMP_A),
        (Notification, NOTICE),
    ]


def test_a_can_frame_is_foreign() -> None:
    assert Receiver().feed(CanFrame(1, b"\xff\xaa")) == [Noise(b"\xff\xaa", "foreign")]


@given(st.lists(st.one_of(PIECES, st.binary(max_size=8))), st.data())
def test_every_byte_is_in_exactly_one_event(pieces: list[bytes], data: st.DataObject) -> None:
    stream, chunks, at = b"".join(pieces), [], 0
    while at < len(stream):
        size = data.draw(st.integers(1, 40))
        chunks.append(stream[at : at + size])
        at += size
    assert b"".join(one for _, one in events_of(chunks)) == stream
    assert events_of(chunks) == events_of([stream])


@given(st.lists(PIECES))
def test_frames_in_a_row_are_all_received(pieces: list[bytes]) -> None:
    assert [event.data for event in Receiver().feed(b"".join(pieces))] == pieces
