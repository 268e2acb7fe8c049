"""The last that fits and the first that does not, what a refusal says, and what is held back of a stream."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from motorbus.core.operation import Noise, Reply
from motorbus.errors import FramingError, RequestError
from motorbus.families.feetech import wire

REPLY = wire.encode_status(1, 0, bytes.fromhex("18 05"))


def refused(make: Callable[[], object]) -> RequestError:
    with pytest.raises(RequestError) as caught:
        make()
    return caught.value


# --- the last that fits, the first that does not -----------------------------------------------------------------

FITS: dict[str, Callable[[], bytes]] = {
    "the last register": lambda: wire.read(1, 255, 1),
    "the first register": lambda: wire.read(0, 0, 1),
    "as much as a reply can hold": lambda: wire.read(253, 0, 253),
    "as much up to the last register": lambda: wire.read(1, 3, 253),
    "one byte": lambda: wire.write(1, 255, b"\x00"),
    "a write to everyone": lambda: wire.write(254, 42, b"\x00"),
    "a sync read of one": lambda: wire.sync_read(255, 1, [253]),
    "a sync write of one": lambda: wire.sync_write(255, [(0, b"\x00")]),
    "error byte 255": lambda: wire.encode_status(253, 255),
}
FITS_NOT: dict[str, Callable[[], object]] = {
    "register -1": lambda: wire.read(1, -1, 1),
    "register 256": lambda: wire.read(1, 256, 1),
    "254 bytes": lambda: wire.read(1, 0, 254),
    "up to register 256": lambda: wire.read(1, 4, 253),
    "less than nothing": lambda: wire.read(1, 0, -1),
    "a sync read of servo -1": lambda: wire.sync_read(56, 2, [-1]),
    "a sync write to servo -1": lambda: wire.sync_write(56, [(-1, b"\x00")]),
    "error byte -1": lambda: wire.encode_status(1, -1),
    "status of servo -1": lambda: wire.encode_status(-1, 0),
}


@pytest.mark.parametrize("make", FITS.values(), ids=FITS)
def test_the_last_that_fits_is_a_whole_packet(make: Callable[[], bytes]) -> None:
    data = make()
    assert wire.decode_instruction(data).data == data


@pytest.mark.parametrize("make", FITS_NOT.values(), ids=FITS_NOT)
def test_the_first_that_does_not_fit_is_refused(make: Callable[[], object]) -> None:
    assert refused(make).advice.endswith("nothing was sent")


def test_a_packet_without_parameters_is_the_shortest() -> None:
    assert wire.frame(1, 0) == bytes.fromhex("FF FF 01 02 00 FC")
    assert wire.encode_status(1, 0) == wire.frame(1, 0)
    assert wire.encode_instruction(1, 1) == wire.ping(1)


def test_a_ping_is_for_one_servo_unless_told_otherwise() -> None:
    assert "everyone" in refused(lambda: wire.encode_instruction(254, 1)).summary


# --- what a refusal says ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "node"),
    [
        (lambda: wire.ping(255), 255),
        (lambda: wire.ping(254), 254),
        (lambda: wire.sync_read(56, 2, [3, 4, 3]), 3),
        (lambda: wire.sync_read(56, 2, [3, 4, 4]), 4),
        (lambda: wire.sync_write(42, [(1, b"\x00\x08"), (2, b"\x00")]), 2),
        (lambda: wire.encode_instruction(1, 0x82, b"\x38\x02\x01"), 1),
    ],
)
def test_a_refusal_names_the_servo_that_it_is_about(make: Callable[[], object], node: int) -> None:
    assert refused(make).node == node


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: wire.encode_instruction(1, 2, b"\x38"), "2 parameter bytes"),
        (lambda: wire.encode_instruction(1, 0x0B, b"\x38"), "0 to 2 parameter bytes"),
        (lambda: wire.encode_instruction(1, 3, b"\x38"), "2 to 253 parameter bytes"),
        (lambda: wire.encode_instruction(1, 3, bytes(254)), "at most 253 parameter bytes, 259 bytes in all"),
        (lambda: wire.encode_instruction(1, 2, bytes(254)), "2 parameter bytes"),
        (lambda: wire.encode_status(1, 0, bytes(254)), "at most 253 parameter bytes, 259 bytes in all"),
        (lambda: wire.sync_write_capacity(251), "1 to 250 bytes"),
        (
            lambda: wire.sync_read(56, 2, list(range(252))),
            "1 to 251 servos of that many bytes each in one packet",
        ),
        (lambda: wire.sync_write(42, [(id, bytes(7)) for id in range(32)]), "1 to 31 servos"),
    ],
)
def test_a_refusal_says_what_would_do(make: Callable[[], object], expected: str) -> None:
    assert refused(make).expected.startswith(expected)


def test_unequal_data_are_told_with_both_lengths() -> None:
    said = refused(lambda: wire.sync_write(42, [(7, b"\x00\x08"), (9, b"\x00")])).summary
    assert said == "SYNC WRITE: 1 bytes for id 9 but 2 for id 7"


def test_what_may_be_sent_instead_is_listed_without_what_is_never_sent() -> None:
    listed = refused(lambda: wire.encode_instruction(1, 0x08)).expected.removeprefix("one of ").split(", ")
    assert len(listed) == 10
    assert listed[0] == "PING"
    assert not [name for name in listed if "0x" in name]


def test_a_packet_of_the_wrong_length_is_told_with_the_right_one() -> None:
    with pytest.raises(FramingError) as caught:
        wire.decode_status(REPLY + b"\x00")
    assert caught.value.expected == "8 bytes in all"


@pytest.mark.parametrize(
    ("cap", "most"), [(255, 125), (300, 125), (246, 121), (6, 1), (5, 0), (4, 0), (0, 0)]
)
def test_a_cap_limits_and_never_widens_a_sync_write(cap: int, most: int) -> None:
    assert wire.sync_write_capacity(1, cap) == most


def test_the_numbers_of_the_protocol() -> None:
    """FEETECH serial bus servo protocol manual V1.01: 254 is everyone, the length field is one byte."""
    assert (wire.MAX_ID, wire.BROADCAST, wire.MAX_PARAMETERS) == (253, 254, 253)
    assert wire.VENDOR_MAX_LENGTH == 246


def test_a_group_of_nobody_is_told_as_that() -> None:
    error = refused(lambda: wire.sync_write(255, []))
    assert error.summary == "SYNC WRITE for 0 servos is impossible"
    assert error.expected.startswith("1 to 125 servos")


def test_broken_items_are_not_taken_for_too_many() -> None:
    error = refused(lambda: wire.encode_instruction(254, 0x83, b"\x2a\x02" + bytes(251)))
    assert error.expected == "4 to 253 parameter bytes"


def test_a_status_that_is_too_long_is_called_a_status() -> None:
    assert refused(lambda: wire.encode_status(1, 0, bytes(254))).summary.startswith("status: ")


def test_an_instruction_there_is_not_suits_nothing() -> None:
    assert not wire.suits(0x55, b"")


COUNTS = {
    0x01: {0},
    0x02: {2},
    0x03: {2, 3, 4, 253},
    0x04: {2, 3, 4, 253},
    0x05: {0},
    0x06: {0},
    0x08: {0},
    0x09: {0},
    0x0A: {0},
    0x0B: {0, 2},
    0x0D: {0},
    0x82: {3, 4, 253},
    0x83: {4},
}


@pytest.mark.parametrize(("code", "counts"), COUNTS.items())
def test_each_instruction_has_its_number_of_parameters(code: int, counts: set[int]) -> None:
    found = {
        count for count in (0, 1, 2, 3, 4, 253, 254) if wire.suits(code, bytes((0, 1, *bytes(252)))[:count])
    }
    assert found == counts


def test_a_length_that_is_impossible_is_told() -> None:
    with pytest.raises(FramingError, match="length 1 is impossible"):
        wire.decode_status(bytes.fromhex("FF FF 07 01 00 F7"))


# --- what is held back of a stream ----------------------------------------------------------------------------------


@pytest.mark.parametrize("count", range(len(REPLY)))
def test_what_may_become_a_packet_is_held_and_nothing_else(count: int) -> None:
    for splitter in (wire.StatusReceiver(), wire.Splitter("status")):
        events = splitter.feed(b"\x00" + REPLY[:count])
        assert [event.data for event in events if isinstance(event, Noise)] == [b"\x00"]
        assert splitter.held == count
        assert b"".join(event.data for event in splitter.flush()) == REPLY[:count]
        assert splitter.held == 0


def test_a_splitter_reads_what_servos_say_unless_told_otherwise() -> None:
    """Servos never speak as everyone, 254."""
    splitter = wire.Splitter()
    assert [*splitter.feed(wire.action()), *splitter.flush()] == [Noise(wire.action(), "framing")]
    assert splitter.feed(REPLY) == [wire.decode_status(REPLY)]


def test_noise_of_two_kinds_is_told_apart_at_the_byte_where_it_changes() -> None:
    bad = REPLY[:-1] + b"\x00"
    receiver = wire.StatusReceiver()
    events = receiver.feed(b"\x11\x22" + bad + b"\x33" + REPLY)
    assert events == [
        Noise(b"\x11\x22", "framing"),
        Noise(bad, "checksum"),
        Noise(b"\x33", "framing"),
        Reply(0, 1, REPLY),
    ]


def test_a_bad_packet_that_comes_in_two_pieces_is_one_doubt() -> None:
    """What is known to be bad stays bad while the rest of it comes."""
    bad = b"\xff\xff\x02\x08\x00\xff\xff\x01\x04\x00\x18\x00"
    receiver = wire.StatusReceiver()
    first = receiver.feed(bad)
    rest = [*receiver.feed(b"\x00"), *receiver.flush()]
    assert b"".join(event.data for event in [*first, *rest]) == bad + b"\x00"
    assert {event.fault for event in [*first, *rest] if isinstance(event, Noise)} >= {"checksum"}


def test_what_only_looks_like_a_packet_is_noise_at_once() -> None:
    """All of these have the right sum: one byte short of a packet, and two with another header."""
    for text in ("FF FF 05 01 F9 00", "FE 00 01 02 00 FC", "FF 00 01 02 00 FB", "00 FE 01 02 00 FC"):
        data = bytes.fromhex(text)
        assert wire.StatusReceiver().feed(data) == [Noise(data, "framing")]
        assert wire.StatusReceiver().feed(REPLY + data) == [Reply(0, 1, REPLY), Noise(data, "framing")]


@pytest.mark.parametrize("text", ["FF FF FE", "FF FF 01 01", "FF FF 01 00"])
def test_what_can_become_no_packet_any_more_is_not_held(text: str) -> None:
    receiver = wire.StatusReceiver()
    assert receiver.feed(bytes.fromhex(text)) == [Noise(bytes.fromhex(text), "framing")]
    assert receiver.held == 0


def test_a_run_of_noise_that_comes_in_one_piece_is_told_in_one() -> None:
    data = bytes.fromhex("11 22 FF FF 01 01 33")
    assert wire.StatusReceiver().feed(data) == [Noise(data, "framing")]


def test_a_bad_packet_inside_a_bad_one_is_part_of_it_behind_noise_too() -> None:
    bad = b"\xff\xff\x02\x0c\x00" + REPLY[:-1] + b"\x00" + b"\x11\x22\x33"
    assert wire.StatusReceiver().feed(bytes(10) + bad) == [
        Noise(bytes(10), "framing"),
        Noise(bad, "checksum"),
    ]


def test_doubt_ends_with_the_good_packet_that_its_last_bytes_begin() -> None:
    receiver = wire.StatusReceiver()
    head = b"\xff\xff\x02\x04\x00"
    assert receiver.feed(head + REPLY[:3]) == [Noise(head, "checksum")]
    assert receiver.feed(REPLY[3:]) == [Reply(0, 1, REPLY)]
    assert receiver.feed(b"\x33\x44") == [Noise(b"\x33\x44", "framing")]


def test_the_read_request_that_is_made_most_is_the_packet_that_all_instructions_make() -> None:
    for address in range(256):
        for count in {1, 2, 3, 15, 253, 256 - address} & set(range(1, min(253, 256 - address) + 1)):
            for id in (0, 1, 77, 252, 253):
                parameters = bytes((address, count))
                assert wire.read(id, address, count) == wire.encode_instruction(id, 2, parameters)
    for id, address, count in (
        (-1, 0, 1),
        (254, 0, 1),
        (1, -1, 1),
        (1, 256, 1),
        (1, 3, 254),
        (1, 0, 0),
        (1, 255, 2),
    ):
        with pytest.raises(RequestError):
            wire.read(id, address, count)
