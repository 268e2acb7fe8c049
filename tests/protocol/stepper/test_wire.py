"""What no frame can carry is refused; what a device sends never raises; every byte counts."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import FramingError, RequestError
from motorbus.families.stepper import wire
from tests.protocol.stepper.vectors import DUMP_B

COMMANDS = st.sampled_from(list(wire.COMMANDS.values()))


@st.composite
def orders(draw: st.DrawFn) -> tuple[str, dict[str, int]]:
    """Any command with any numbers that fit."""
    command = draw(COMMANDS)
    return command.name, {p.name: draw(st.integers(0, (1 << 8 * p.size) - 1)) for p in command.places}


@given(orders(), st.sampled_from(sorted(wire.MOTORS)))
def test_what_is_encoded_is_decoded(order: tuple[str, dict[str, int]], motor: int) -> None:
    name, values = order
    data = wire.encode(name, motor=motor, **values)
    assert len(data) == 11
    request = wire.decode_request(data)
    assert request is not None
    assert (request.command.name, request.values) == (name, values)
    assert request.motor == (motor if request.command.kind == "motor" else 0)


@given(orders())
def test_every_byte_that_no_number_has_is_zero(order: tuple[str, dict[str, int]]) -> None:
    name, values = order
    data = wire.encode(name, **values)
    command = wire.COMMANDS[name]
    taken = {place.offset + n for place in command.places for n in range(place.size)}
    taken |= {0, 1, 2, 10} | (set() if command.kind == "system" else {3})
    assert not any(data[at] for at in range(11) if at not in taken)


def test_numbers_of_one_request_do_not_overlap() -> None:
    for command in wire.COMMANDS.values():
        taken = [place.offset + n for place in command.places for n in range(place.size)]
        assert len(set(taken)) == len(taken)
        assert not taken or (min(taken) >= (3 if command.kind == "system" else 4) and max(taken) <= 9)


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("warp", {}, "no command 'warp'"),
        ("set_step_delay", {"step": 1}, "delay is missing"),
        ("stop_motor", {"motor": 0x0E}, "no motor number"),
        ("stop_motor", {"motor": 0}, "no motor number"),
        ("stop_motor", {"motor": 256}, "no motor number"),
        ("stop_project", {"project": 1}, "does not carry project"),
        ("set_step_delay", {"step": 1, "delay": 1 << 24}, "delay 16777216 does not fit its 3 bytes"),
        ("set_step_delay", {"step": 256, "delay": 1}, "step 256 does not fit its 1 byte"),
        ("set_step_distance", {"step": 1, "distance": -1}, "does not fit"),
        ("set_microstep_and_angle", {"microsteps": 65536, "step_angle": 180}, "microsteps 65536"),
        ("set_microstep_and_angle", {"microsteps": 8, "step_angle": 256}, "step_angle 256"),
    ],
)
def test_what_no_frame_can_carry_is_refused(name: str, values: dict[str, Any], says: str) -> None:
    with pytest.raises(RequestError, match=says):
        wire.encode(name, **values)


def test_swapped_bytes_have_the_same_checksum_and_another_meaning() -> None:
    """The sum of the wire cannot tell them apart, so only a read-back can."""
    one = wire.encode("set_turn_distance", turn_distance=0x0008)
    other = wire.encode("set_turn_distance", turn_distance=0x0800)
    assert one[-1] == other[-1]
    assert one != other


def test_byte_3_alone_is_not_a_command() -> None:
    assert [wire.command_of(byte, 0x0B) for byte in (3, 0)] == [
        wire.COMMANDS["jog_reverse"],
        wire.COMMANDS["read_input"],
    ]
    assert [wire.command_of(byte, 0x0C) for byte in (3, 0)] == [
        wire.COMMANDS["run_once"],
        wire.COMMANDS["set_output"],
    ]
    assert wire.command_of(0x3E, 0x0B) is wire.COMMANDS["read_project"]


@given(st.binary(max_size=240))
def test_no_bytes_make_a_decoder_raise(data: bytes) -> None:
    wire.decode_request(data)
    wire.decode_reply(data)
    wire.dump_fault(data)
    request = wire.encode("stop_motor")
    assert (wire.difference(request, data) == "") is (data[:6] == request[:6])
    assert wire.echo(request, data) in wire.Echo
    assert wire.difference(data, data) or wire.decode_request(data)


def test_a_reply_of_another_command_is_told_byte_by_byte() -> None:
    request = wire.encode("set_step_delay", delay=1000, step=4)
    said = wire.difference(request, bytes.fromhex("FFAA03030005"))
    assert said == "byte 3 (command or project) is 03, 07 is due; byte 5 (step or level) is 05, 04 is due"
    assert wire.difference(request, b"\xff\xaa\x03") == "3 bytes came, 6 are due"


@pytest.mark.parametrize("name", ["set_segment_loop", "set_project_loop"])
def test_the_selected_project_is_free_unless_it_is_known(name: str) -> None:
    values = {place.name: 0 for place in wire.COMMANDS[name].places}
    request = wire.encode(name, **values)
    for project in range(6):
        reply = request[:3] + bytes((project, 0, 0))
        assert (wire.difference(request, reply) == "") is (1 <= project <= 4)
        assert (wire.difference(request, reply, project=2) == "") is (project == 2)


def test_the_level_of_an_input_is_free() -> None:
    request = wire.encode("read_input", port=2)
    for level in range(4):
        assert (wire.difference(request, b"\xff\xaa\0\x0b\x02" + bytes((level,))) == "") is (level < 2)


@st.composite
def replies(draw: st.DrawFn) -> tuple[bytes, bytes]:
    """A request, and what may come back: the reply to it, that with other bytes in a place or two, or anything."""
    name, values = draw(orders())
    request = wire.encode(name, motor=draw(st.sampled_from([1, 3, 0xFF])), **values)
    image = bytes(220) if name == "read_project" else b""
    project, level = draw(st.integers(0, 5)), draw(st.integers(0, 2))
    came = bytearray(wire.encode_reply(request, project=project, level=level, image=image))
    for place in draw(st.lists(st.integers(0, 5), max_size=2)):
        came[place] = draw(st.integers(0, 255))
    return request, draw(st.one_of(st.just(bytes(came)), st.just(bytes(came[:5])), st.binary(max_size=7)))


@given(replies())
def test_what_is_due_is_exactly_what_differs_in_nothing(pair: tuple[bytes, bytes]) -> None:
    request, came = pair
    assert (came[:6] in wire.replies_due(request)) is (wire.difference(request, came) == "")


@given(orders())
def test_all_that_is_due_has_one_key(order: tuple[str, dict[str, int]]) -> None:
    request = wire.encode(order[0], **order[1])
    due = wire.replies_due(request)
    assert {wire.key_of(reply) for reply in due} == {wire.key_due(request)}
    assert {len(reply) for reply in due} == {6}
    many = {"read_input": 2, "set_segment_loop": 4, "set_project_loop": 4}
    assert len(due) == many.get(order[0], 1)


def test_nothing_is_due_to_what_is_no_request() -> None:
    with pytest.raises(RequestError, match="no reply to what is no request"):
        wire.replies_due(b"\xff\xaa")


def test_a_reply_is_made_only_to_a_request_and_with_the_image_it_needs() -> None:
    with pytest.raises(RequestError):
        wire.encode_reply(b"\xff\xaa")
    with pytest.raises(RequestError):
        wire.encode_reply(wire.encode("read_project", project=1))
    with pytest.raises(RequestError):
        wire.encode_reply(wire.encode("stop_project"), image=bytes(220))


# --- dump -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (DUMP_B[:-1], "225 bytes, 226 are due"),
        (DUMP_B + b"\0", "227 bytes"),
        (b"\xff\xab" + DUMP_B[2:], "begins with FF AB 3E"),
        (DUMP_B[:2] + b"\x2e" + DUMP_B[3:], "begins with FF AA 2E"),
        (DUMP_B[:3] + b"\x05" + DUMP_B[4:], "byte 3 says project 5, 1 to 4 is due"),
        (DUMP_B[:3] + b"\x00" + DUMP_B[4:], "byte 3 says project 0"),
        (DUMP_B[:4] + b"\x01" + DUMP_B[5:], "bytes 4 and 5 are 01 00"),
        (b"", "0 bytes"),
    ],
)
def test_what_is_no_dump_is_refused_with_what_is_wrong(data: bytes, says: str) -> None:
    assert says in wire.dump_fault(data)
    with pytest.raises(FramingError, match=says) as caught:
        wire.decode_dump(data)
    assert caught.value.received == data


def test_the_dump_of_another_project_is_refused() -> None:
    assert wire.decode_dump(DUMP_B).project == 2
    with pytest.raises(FramingError, match="byte 3 says project 2, 1 is due"):
        wire.decode_dump(DUMP_B, 1)


def test_only_a_project_and_an_image_make_a_dump() -> None:
    for project in (0, 5):
        with pytest.raises(RequestError, match=f"no project {project}"):
            wire.encode_dump(project, bytes(220))
    with pytest.raises(RequestError, match="219 bytes"):
        wire.encode_dump(1, bytes(219))


# --- echo -----------------------------------------------------------------------------------------------------


def test_an_echo_is_certain_when_all_of_it_is_there() -> None:
    request = wire.encode("stop_motor")
    for count in range(11):
        assert wire.echo(request, request[:count]) is wire.Echo.POSSIBLE
    assert wire.echo(request, request) is wire.Echo.CERTAIN
    assert wire.echo(request, request + b"\xff\xaa") is wire.Echo.CERTAIN
    assert wire.echo(request, request[:6] + wire.NOTICE) is wire.Echo.NO
    assert wire.echo(request, b"\xff\xaa\x03\x0d\0\x01") is wire.Echo.NO
    assert [verdict.value for verdict in wire.Echo] == ["no", "possible", "certain"]


def test_a_dump_cannot_be_an_echo() -> None:
    request = wire.encode("read_project", project=2)
    assert not wire.looks_like_echo(request)
    assert wire.echo(request, DUMP_B) is wire.Echo.NO
    assert wire.difference(request, DUMP_B) == ""


@pytest.mark.parametrize(("port", "same"), [(1, True), (5, True)])
def test_a_level_of_zero_is_its_own_echo(port: int, same: bool) -> None:
    assert wire.looks_like_echo(wire.encode("read_input", port=port)) is same


def test_values_other_than_zero_make_a_difference() -> None:
    for name, values in (
        ("set_stop_mode", {"stop_mode": 1}),
        ("set_mode4", {"mode4": 2}),
        ("set_power_on_home", {"power_on_home": 1}),
        ("set_output", {"port": 1, "level": 1}),
        ("set_step_delay", {"delay": 0, "step": 1}),
    ):
        assert not wire.looks_like_echo(wire.encode(name, **values)), name
    assert not wire.looks_like_echo(b"")
