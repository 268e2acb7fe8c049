"""The last that fits and the first that does not, which byte is which, and what is held back of a stream."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Noise, Notice, Reply
from motorbus.errors import FramingError, RequestError
from motorbus.families.stepper import wire
from tests.families.stepper.vectors import DUMP_B

STOPPED = bytes.fromhex("FF AA 03 0D 00 00")


@pytest.mark.parametrize("motor", [1, 3, 0x0D, 0x0F, 0xFF])
def test_every_number_that_no_other_class_has_is_a_motors(motor: int) -> None:
    assert wire.encode("stop_motor", motor=motor)[2] == motor


def test_the_motor_is_number_3_unless_told_otherwise() -> None:
    assert wire.encode("stop_motor")[2] == 3


def test_of_a_sum_only_the_first_ten_bytes_count() -> None:
    request = wire.encode("stop_motor")
    assert wire.checksum(request) == wire.checksum(request[:10]) == request[10]


def test_only_the_whole_request_is_sound() -> None:
    request = wire.encode("set_step_delay", delay=1000, step=4)
    assert wire.is_sound(request)
    assert not wire.is_sound(request[:10])
    assert not wire.is_sound(request + b"\0")
    assert not wire.is_sound(request + request[-1:])
    assert not wire.is_sound(b"\xff\xab" + request[2:-1] + bytes((request[-1] + 1,)))
    assert not wire.is_sound(request[:-1] + bytes((request[-1] ^ 1,)))


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("set_step_delay", {"step": 1}, "delay, step"),
        ("stop_project", {"project": 1}, "no number at all"),
        ("set_stop_mode", {"stop_mode": 0, "step": 1}, "stop_mode"),
        ("set_step_delay", {"step": 1, "delay": 1 << 24}, "0 to 16777215"),
        ("set_step_delay", {"step": 256, "delay": 1}, "0 to 255"),
    ],
)
def test_a_refusal_says_what_would_do(name: str, values: dict[str, int], expected: str) -> None:
    with pytest.raises(RequestError) as caught:
        wire.encode(name, **values)
    assert caught.value.expected == expected


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [("step", 256, "its 1 byte"), ("microsteps", 1 << 16, "its 2 bytes"), ("delay", 1 << 24, "its 3 bytes")],
)
def test_a_number_that_is_too_large_is_told_with_its_size(name: str, value: int, says: str) -> None:
    command = next(one for one in wire.COMMANDS.values() if one.place(name) is not None)
    values = {place.name: 0 for place in command.places} | {name: value}
    with pytest.raises(RequestError) as caught:
        wire.encode(command.name, **values)
    assert caught.value.summary.endswith(f"{name} {value} does not fit {says}")


# The manual's table of each command: where each number lies, low byte first, and that it reaches no farther.
FULL = [
    ("select_project", {"project": 1, "total_steps": 1}, "6E A1 B1 00 00 00 00 00"),
    ("set_microstep_and_angle", {"microsteps": 2, "step_angle": 1}, "03 01 A1 A2 B1 00 00 00"),
    ("set_turn_distance", {"turn_distance": 3}, "03 02 A1 A2 A3 00 00 00"),
    ("set_step_distance", {"distance": 3, "step": 1}, "03 03 A1 A2 A3 00 00 B1"),
    (
        "set_step_direction_start",
        {"direction": 1, "start_frequency": 2, "step": 1},
        "03 04 A1 B1 B2 00 00 C1",
    ),
    ("set_step_accel_speed", {"acceleration": 2, "speed": 2, "step": 1}, "03 05 A1 A2 B1 B2 00 C1"),
    ("set_step_output", {"output": 1, "step": 1}, "03 06 A1 00 00 00 00 B1"),
    ("set_step_delay", {"delay": 3, "step": 1}, "03 07 A1 A2 A3 00 00 B1"),
    ("set_step_start_input", {"start_input": 1, "step": 1}, "03 08 A1 00 00 00 00 B1"),
    ("set_step_stop_input", {"stop_input": 1, "step": 1}, "03 09 A1 00 00 00 00 B1"),
    ("set_segment_loop", {"loop_first": 1, "loop_last": 1, "loop_count": 1}, "7E A1 B1 C1 00 00 00 00"),
    ("set_project_loop", {"project_loop": 1}, "8E A1 00 00 00 00 00 00"),
    ("start_project", {"project": 1}, "4E A1 00 00 00 00 00 00"),
    ("read_project", {"project": 1}, "3E A1 00 00 00 00 00 00"),
    ("save_project", {"project": 1}, "2E A1 00 00 00 00 00 00"),
    ("clear_project", {"project": 1}, "1E A1 00 00 00 00 00 00"),
    ("set_stop_mode", {"stop_mode": 1}, "03 0E A1 00 00 00 00 00"),
    ("set_output", {"port": 1, "level": 1}, "00 0C A1 B1 00 00 00 00"),
    ("read_input", {"port": 1}, "00 0B A1 00 00 00 00 00"),
    ("set_mode4", {"mode4": 1}, "9E A1 00 00 00 00 00 00"),
    ("set_power_on_home", {"power_on_home": 1}, "AE A1 00 00 00 00 00 00"),
]


@pytest.mark.parametrize(("name", "sizes", "body"), FULL, ids=[name for name, _, _ in FULL])
def test_each_number_fills_its_bytes_and_no_others(name: str, sizes: dict[str, int], body: str) -> None:
    values = {
        number: int.from_bytes(bytes(first + at for at in range(size)), "little")
        for first, (number, size) in zip((0xA1, 0xB1, 0xC1), sizes.items(), strict=False)
    }
    request = wire.encode(name, **values)
    assert request[2:10].hex(" ").upper() == body
    decoded = wire.decode_request(request)
    assert decoded is not None
    assert decoded.values == values
    for number, size in sizes.items():
        with pytest.raises(RequestError, match=f"{number} .* does not fit its {size} byte"):
            wire.encode(name, **{**values, number: 1 << 8 * size})


def test_the_other_commands_carry_no_number() -> None:
    bare = set(wire.COMMANDS) - {name for name, _, _ in FULL}
    assert bare == {"stop_project", "jog_forward", "jog_reverse", "run_once", "stop_motor", "home"}
    assert not any(wire.COMMANDS[name].places for name in bare)


def test_an_unknown_command_is_told_with_all_there_are() -> None:
    with pytest.raises(RequestError) as caught:
        wire.named("warp")
    assert caught.value.expected == f"one of {', '.join(wire.COMMANDS)}"


# --- replies ------------------------------------------------------------------------------------------------------

REPLIES = [
    ("FF AA 03 0D 00 00", "", "nothing is repeated"),
    ("FF AA 03 0D 01 00", "byte 4 is 01", "a motor has no port"),
    ("FF AA 03 0D 00 01", "byte 5 is 01", "no step is repeated"),
    ("FF AA 03 07 00 0A", "", "the last step"),
    ("FF AA 03 07 00 0B", "byte 5 is 0B", "there is no step 11"),
    ("FF AA 00 0B 05 01", "", "the last port, high"),
    ("FF AA 00 0B 06 01", "byte 4 is 06", "there is no port 6"),
    ("FF AA 00 0B 05 02", "byte 5 is 02", "a level is 0 or 1"),
    ("FF AA 00 0C 05 00", "", "the last output"),
    ("FF AA 00 0C 05 01", "byte 5 is 01", "the level of an output is not repeated"),
    ("FF AA 4E 04 00 00", "", "the last project"),
    ("FF AA 4E 05 00 00", "byte 3 is 05", "there is no project 5"),
    ("FF AA 5E 01 00 00", "byte 3 is 01", "a stop repeats no project"),
    ("FF AA 4E 01 01 00", "byte 4 is 01", "a project has no port"),
    ("FF AA 03 10 00 00", "there is no command 03 10", "no motor command has this code"),
    ("FF AB 03 0D 00 00", "a reply begins with FF AA", "another header"),
]


@pytest.mark.parametrize(("text", "fault", "_why"), REPLIES, ids=[one[2] for one in REPLIES])
def test_what_six_bytes_can_be_a_reply(text: str, fault: str, _why: str) -> None:
    data = bytes.fromhex(text)
    assert wire.reply_fault(data) == fault
    parts = wire.decode_reply(data)
    assert (parts is None) is (fault != "")
    receiver = wire.Receiver()
    events = [*receiver.feed(data), *receiver.flush()]
    assert (Reply in map(type, events)) is (fault == "")
    assert b"".join(event.data for event in events) == data


@pytest.mark.parametrize(
    ("text", "motor", "project", "step", "port", "level"),
    [
        ("FF AA 03 0D 00 00", 3, None, None, None, None),
        ("FF AA 07 07 00 04", 7, None, 4, None, None),
        ("FF AA 00 0B 02 01", 0, None, None, 2, 1),
        ("FF AA 00 0C 02 00", 0, None, None, 2, None),
        ("FF AA 4E 02 00 00", 0, 2, None, None, None),
        ("FF AA 5E 00 00 00", 0, None, None, None, None),
    ],
)
def test_a_reply_tells_what_its_class_repeats_and_nothing_else(
    text: str, motor: int, project: int | None, step: int | None, port: int | None, level: int | None
) -> None:
    parts = wire.decode_reply(bytes.fromhex(text))
    assert parts is not None
    assert parts[1:] == (motor, project, step, port, level, b"")


def test_a_reply_of_another_length_is_none() -> None:
    for data in (STOPPED[:5], STOPPED + b"\0", DUMP_B[:6], DUMP_B[:-1], DUMP_B + b"\0"):
        assert wire.decode_reply(data) is None
    parts = wire.decode_reply(DUMP_B)
    assert parts is not None
    assert (parts.project, parts.data) == (2, DUMP_B[6:])


def test_what_a_reply_to_an_output_repeats_is_the_port_alone() -> None:
    request = wire.encode("set_output", port=2, level=1)
    assert wire.encode_reply(request, level=1) == bytes.fromhex("FF AA 00 0C 02 00")
    asked = wire.encode("read_input", port=2)
    assert wire.encode_reply(asked) == bytes.fromhex("FF AA 00 0B 02 00")
    assert wire.encode_reply(asked, level=1) == bytes.fromhex("FF AA 00 0B 02 01")


def test_an_answer_that_names_the_selected_project_names_none_unless_told() -> None:
    request = wire.encode("set_project_loop", project_loop=9)
    assert wire.encode_reply(request)[3] == 0
    assert wire.encode_reply(request, project=4)[3] == 4
    assert wire.encode_reply(wire.encode("start_project", project=1), project=4)[3] == 1


def test_a_key_holds_what_can_be_foretold() -> None:
    assert wire.key_of(STOPPED) == (3, 0x0D, 0, 0)
    assert wire.key_of(bytes.fromhex("FF AA 00 0B 02 01")) == (0, 0x0B, 2)
    assert wire.key_of(bytes.fromhex("FF AA 8E 02 00 00")) == (0x8E,)
    assert wire.key_of(bytes.fromhex("FF AA 7E 02 00 00")) == (0x7E,)
    assert wire.key_of(bytes.fromhex("FF AA 4E 02 00 00")) == (0x4E, 2, 0, 0)
    assert wire.key_of(bytes.fromhex("FF AA 03 10 00 00")) == (3,)
    assert wire.key_of(DUMP_B) == (0x3E, 2, 0, 0)


@pytest.mark.parametrize("name", list(wire.COMMANDS))
def test_the_key_that_is_due_is_that_of_the_reply(name: str) -> None:
    command = wire.COMMANDS[name]
    request = wire.encode(name, **{place.name: 1 for place in command.places})
    image = bytes(220) if name == "read_project" else b""
    assert wire.key_due(request) == wire.key_of(wire.encode_reply(request, project=3, level=1, image=image))


def test_there_is_no_key_of_what_is_no_request() -> None:
    with pytest.raises(RequestError) as caught:
        wire.key_due(b"\xff\xaa")
    assert caught.value.sent == b"\xff\xaa"


def test_only_a_dump_is_longer_than_six_bytes() -> None:
    for command in wire.COMMANDS.values():
        assert wire.reply_length(command) == (226 if command.name == "read_project" else 6)


@pytest.mark.parametrize(
    ("at", "name"),
    [
        (0, "header"),
        (1, "header"),
        (2, "class"),
        (3, "command or project"),
        (4, "port"),
        (5, "step or level"),
    ],
)
def test_a_wrong_byte_of_a_reply_is_named(at: int, name: str) -> None:
    request = wire.encode("stop_motor")
    reply = bytearray(STOPPED)
    reply[at] ^= 0x40
    said = f"byte {at} ({name}) is {reply[at]:02X}, {STOPPED[at]:02X} is due"
    assert wire.difference(request, bytes(reply)) == said


def test_a_project_that_was_named_is_due_and_of_one_that_was_not_any_there_is() -> None:
    started = wire.encode("start_project", project=2)
    assert wire.difference(started, bytes.fromhex("FF AA 4E 05 00 00")) == (
        "byte 3 (command or project) is 05, 02 is due"
    )
    looped = wire.encode("set_project_loop", project_loop=9)
    assert wire.difference(looped, bytes.fromhex("FF AA 8E 07 00 00")) == (
        "byte 3 is 07, a project from 01 to 04 is due"
    )
    asked = wire.encode("read_input", port=2)
    assert (
        wire.difference(asked, bytes.fromhex("FF AA 00 0B 02 02"))
        == "byte 5 (step or level) is 02, 00 is due"
    )


# --- dumps --------------------------------------------------------------------------------------------------------


def test_every_project_has_a_dump_of_eleven_rows() -> None:
    image = bytes(range(220))
    for project in (1, 4):
        dump = wire.decode_dump(wire.encode_dump(project, image), project)
        assert dump.project == project
        assert b"".join(dump.row(number) for number in range(11)) == image
        assert dump.row(1) == image[20:40]


def test_what_is_no_dump_is_told_with_what_is_due() -> None:
    assert wire.dump_fault(DUMP_B) == wire.dump_fault(DUMP_B, 2) == ""
    assert wire.dump_fault(DUMP_B, 3) == "byte 3 says project 2, 3 is due"
    assert wire.dump_fault(b"\xfe" + DUMP_B[1:]) == "it begins with FE AA 3E, FF AA 3E is due"
    assert wire.dump_fault(DUMP_B[:5] + b"\x07" + DUMP_B[6:]) == "bytes 4 and 5 are 00 07, 00 00 is due"
    with pytest.raises(FramingError) as caught:
        wire.decode_dump(STOPPED)
    assert caught.value.expected == "226 bytes: FF AA 3E, the project, 00 00, and 220 bytes"


# --- streams ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", range(1, 6))
def test_what_may_become_a_reply_is_held(count: int) -> None:
    receiver = wire.Receiver()
    assert receiver.feed(STOPPED[:count]) == []
    assert receiver.held == count
    assert receiver.feed(STOPPED[count:]) == [Reply(0, (3, 0x0D, 0, 0), STOPPED)]
    assert receiver.held == 0


def test_bytes_that_begin_nothing_are_one_piece_of_noise_and_not_held() -> None:
    receiver = wire.Receiver()
    assert receiver.feed(b"\x01\x02\x03") == [Noise(b"\x01\x02\x03", "framing")]
    assert receiver.held == 0
    assert receiver.feed(b"\xff\xab\xee" + wire.NOTICE) == [
        Noise(b"\xff\xab\xee", "framing"),
        Notice(1, "completed", wire.NOTICE),
    ]


def test_six_bytes_that_no_reply_can_be_are_given_up_one_by_one() -> None:
    receiver = wire.Receiver()
    assert receiver.feed(b"\xff\xaa\x03\x0d" + STOPPED) == [
        Noise(b"\xff\xaa\x03\x0d", "framing"),
        Reply(0, (3, 0x0D, 0, 0), STOPPED),
    ]


def test_a_pause_counts_from_the_last_byte() -> None:
    receiver = wire.Receiver()
    assert receiver.feed(STOPPED[:2], 1.0) == []
    assert receiver.feed(STOPPED[2:4], 1.04) == []
    assert receiver.feed(STOPPED[4:], 1.08) == [Reply(0, (3, 0x0D, 0, 0), STOPPED)]


def test_bytes_without_a_time_end_nothing() -> None:
    receiver = wire.Receiver()
    assert receiver.feed(STOPPED[:2], 1.0) == []
    assert receiver.feed(STOPPED[2:4]) == []
    assert receiver.feed(STOPPED[4:], 1.02) == [Reply(0, (3, 0x0D, 0, 0), STOPPED)]


def test_a_pause_of_exactly_the_gap_ends_nothing() -> None:
    receiver = wire.Receiver()
    assert receiver.feed(STOPPED[:2], 0.0) == []
    assert receiver.feed(STOPPED[2:], 0.05) == [Reply(0, (3, 0x0D, 0, 0), STOPPED)]
