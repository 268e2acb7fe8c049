"""Single packets: what the encoders make is read back as what was meant, and what they must refuse they refuse."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import ChecksumError, FramingError, RequestError
from motorbus.families.feetech import wire

IDS = st.integers(0, wire.MAX_ID)
ADDRESSEES = st.integers(0, wire.BROADCAST)
ADDRESSES = st.integers(0, 255)


def spans(most: int = wire.MAX_PARAMETERS - 1) -> st.SearchStrategy[tuple[int, bytes]]:
    """A first register and bytes for it and those behind it, as many as there are registers."""
    return ADDRESSES.flatmap(
        lambda address: st.tuples(st.just(address), st.binary(min_size=1, max_size=min(most, 256 - address)))
    )


def decoded(data: bytes) -> wire.InstructionPacket:
    """The packet, by the one-packet decoder and by the splitter, which must agree."""
    packet = wire.decode_instruction(data)
    assert wire.Splitter("instruction").feed(data) == [packet]
    assert packet.data == data
    return packet


def body(packet: wire.InstructionPacket) -> tuple[int, int, bytes]:
    return packet.id, packet.instruction, packet.parameters


# --- there and back -----------------------------------------------------------------------------------------


@given(IDS)
def test_instructions_without_parameters_come_back(id: int) -> None:
    assert body(decoded(wire.ping(id))) == (id, 0x01, b"")
    assert body(decoded(wire.factory_restore(id))) == (id, 0x06, b"")
    assert body(decoded(wire.clear_turns(id))) == (id, 0x0A, b"")
    assert body(decoded(wire.calibrate(id))) == (id, 0x0B, b"")


@given(ADDRESSEES)
def test_action_comes_back(id: int) -> None:
    assert body(decoded(wire.action(id))) == (id, 0x05, b"")


@given(IDS, st.binary(min_size=2, max_size=2))
def test_calibrate_comes_back_with_its_position(id: int, position: bytes) -> None:
    assert body(decoded(wire.calibrate(id, position))) == (id, 0x0B, position)


@given(IDS, spans())
def test_read_comes_back(id: int, span: tuple[int, bytes]) -> None:
    address, count = span[0], len(span[1])
    assert body(decoded(wire.read(id, address, count))) == (id, 0x02, bytes((address, count)))


@given(ADDRESSEES, spans())
def test_write_and_reg_write_come_back(id: int, span: tuple[int, bytes]) -> None:
    address, data = span
    assert body(decoded(wire.write(id, address, data))) == (id, 0x03, bytes((address,)) + data)
    assert body(decoded(wire.reg_write(id, address, data))) == (id, 0x04, bytes((address,)) + data)


@given(ADDRESSES, st.lists(IDS, unique=True, min_size=1, max_size=251))
def test_sync_read_comes_back(address: int, ids: list[int]) -> None:
    packet = decoded(wire.sync_read(address, 1, ids))
    assert (packet.id, packet.instruction) == (254, 0x82)
    assert wire.decode_sync_read(packet.parameters) == wire.SyncRead(address, 1, tuple(ids))


@given(spans(40), st.lists(IDS, unique=True, min_size=1, max_size=83))
def test_sync_write_comes_back(span: tuple[int, bytes], ids: list[int]) -> None:
    address, data = span
    items = [(id, data[::-1] if id % 2 else data) for id in ids[: wire.sync_write_capacity(len(data))]]
    packet = decoded(wire.sync_write(address, items))
    assert (packet.id, packet.instruction) == (254, 0x83)
    assert wire.decode_sync_write(packet.parameters) == wire.SyncWrite(address, len(data), tuple(items))


@given(IDS, st.integers(0, 255), st.binary(max_size=wire.MAX_PARAMETERS))
def test_status_comes_back(id: int, error: int, parameters: bytes) -> None:
    data = wire.encode_status(id, error, parameters)
    packet = wire.StatusPacket(id, error, parameters, data)
    assert wire.decode_status(data) == packet
    assert wire.Splitter("status").feed(data) == [packet]


@given(st.integers(0, 255), st.integers(0, 255), st.binary(max_size=wire.MAX_PARAMETERS))
def test_a_checksum_is_the_complement_of_the_sum(id: int, code: int, parameters: bytes) -> None:
    data = wire.frame(id, code, parameters)
    assert (sum(data[2:]) & 0xFF) == 0xFF
    assert data[-1] == wire.checksum(data[2:-1])
    assert wire.is_sound(data)
    assert data[3] == len(data) - 4


def test_the_checksum_cannot_see_the_byte_order() -> None:
    little = wire.write(1, 42, bytes.fromhex("00 08 00 00 E8 03"))
    big = wire.write(1, 42, bytes.fromhex("08 00 00 00 03 E8"))
    assert little[-1] == big[-1] == 0xD5


# --- refusals -----------------------------------------------------------------------------------------------

REFUSED: dict[str, Callable[[], bytes]] = {
    "ping 255": lambda: wire.ping(255),
    "ping -1": lambda: wire.ping(-1),
    "ping 256": lambda: wire.ping(256),
    "ping everyone": lambda: wire.ping(254),
    "ping with parameters": lambda: wire.encode_instruction(1, 1, b"\x00"),
    "read everyone": lambda: wire.read(254, 56, 2),
    "read nothing": lambda: wire.read(1, 56, 0),
    "read a negative address": lambda: wire.read(1, -1, 2),
    "read past the last register": lambda: wire.read(1, 255, 2),
    "read more than a reply can hold": lambda: wire.read(1, 0, 254),
    "read everyone, explicitly": lambda: wire.encode_instruction(254, 2, b"\x38\x02", broadcast=True),
    "write without datum": lambda: wire.write(1, 42, b""),
    "write an address only": lambda: wire.encode_instruction(1, 3, b"\x2a"),
    "write to 255": lambda: wire.write(255, 42, b"\x00"),
    "write past the last register": lambda: wire.write(1, 255, b"\x00\x00"),
    "write too much": lambda: wire.write(1, 0, bytes(254)),
    "a packet too long": lambda: wire.encode_instruction(1, 3, bytes(254)),
    "reg write without datum": lambda: wire.reg_write(1, 42, b""),
    "reg write past the last register": lambda: wire.reg_write(1, 255, b"\x00\x00"),
    "action to 255": lambda: wire.action(255),
    "restore everyone": lambda: wire.factory_restore(254),
    "clear the turns of everyone": lambda: wire.clear_turns(254),
    "calibrate everyone": lambda: wire.calibrate(254),
    "calibrate to one byte": lambda: wire.calibrate(1, b"\x00"),
    "calibrate to three bytes": lambda: wire.calibrate(1, b"\x00\x00\x00"),
    "sync read of nobody": lambda: wire.sync_read(56, 2, []),
    "sync read twice of one": lambda: wire.sync_read(56, 2, [3, 4, 3]),
    "sync read of everyone": lambda: wire.sync_read(56, 2, [1, 254]),
    "sync read of 255": lambda: wire.sync_read(56, 2, [255]),
    "sync read of nothing": lambda: wire.sync_read(56, 0, [1]),
    "sync read of too many": lambda: wire.sync_read(56, 2, list(range(252))),
    "sync read to one servo": lambda: wire.encode_instruction(1, 0x82, b"\x38\x02\x01"),
    "sync write to nobody": lambda: wire.sync_write(42, []),
    "sync write of nothing": lambda: wire.sync_write(42, [(1, b"")]),
    "sync write of unequal data": lambda: wire.sync_write(42, [(1, b"\x00\x08"), (2, b"\x00")]),
    "sync write twice to one": lambda: wire.sync_write(42, [(1, b"\x00"), (1, b"\x01")]),
    "sync write to everyone": lambda: wire.sync_write(42, [(254, b"\x00")]),
    "sync write to too many": lambda: wire.sync_write(42, [(id, bytes(7)) for id in range(32)]),
    "sync write over the vendor's cap": lambda: wire.sync_write(
        42, [(id, bytes(7)) for id in range(31)], cap=wire.VENDOR_MAX_LENGTH
    ),
    "sync write to one servo": lambda: wire.encode_instruction(1, 0x83, b"\x2a\x01\x01\x00"),
    "sync write of broken items": lambda: wire.encode_instruction(254, 0x83, b"\x2a\x02\x01\x00"),
    "enter the bootloader": lambda: wire.encode_instruction(1, wire.Instruction.BOOTLOADER),
    "unknown (0x09)": lambda: wire.encode_instruction(1, wire.Instruction.UNKNOWN_09),
    "upgrade everyone": lambda: wire.encode_instruction(254, wire.Instruction.UPGRADE),
    "an instruction there is not": lambda: wire.encode_instruction(1, 0x55),
    "status of everyone": lambda: wire.encode_status(254, 0),
    "status of 255": lambda: wire.encode_status(255, 0),
    "status with a large error": lambda: wire.encode_status(1, 256),
    "status too long": lambda: wire.encode_status(1, 0, bytes(254)),
}


@pytest.mark.parametrize("make", REFUSED.values(), ids=REFUSED.keys())
def test_what_makes_no_sense_is_refused(make: Callable[[], bytes]) -> None:
    with pytest.raises(RequestError) as caught:
        make()
    error = caught.value
    assert error.summary
    assert error.expected
    assert error.advice.endswith("nothing was sent")


def test_everyone_is_pinged_only_by_an_explicit_wish() -> None:
    assert wire.ping(254, broadcast=True) == bytes.fromhex("FF FF FE 02 01 FE")
    assert wire.ping(3, broadcast=True) == wire.ping(3)


@pytest.mark.parametrize(
    ("code", "name"), [(0x08, "bootloader"), (0x09, r"unknown \(0x09\)"), (0x0D, "upgrade")]
)
def test_dangerous_instructions_are_read_by_name_and_never_sent(code: int, name: str) -> None:
    packet = wire.decode_instruction(wire.frame(1, code))
    assert packet.instruction == wire.Instruction(code)
    with pytest.raises(RequestError, match=f"{name}.*never sent"):
        wire.encode_instruction(1, code)


def test_the_longest_packets_have_259_bytes() -> None:
    assert len(wire.write(1, 0, bytes(252))) == 259
    assert len(wire.encode_status(1, 0, bytes(253))) == 259
    assert len(wire.sync_read(56, 2, list(range(251)))) == 259
    assert len(wire.sync_write(0, [(1, bytes(250))])) == 259


@pytest.mark.parametrize(
    ("length", "most", "vendor"), [(1, 125, 121), (2, 83, 80), (6, 35, 34), (7, 31, 30), (250, 1, 0)]
)
def test_a_sync_write_serves_as_many_servos_as_fit(length: int, most: int, vendor: int) -> None:
    assert wire.sync_write_capacity(length) == most
    assert wire.sync_write_capacity(length, wire.VENDOR_MAX_LENGTH) == vendor
    full = wire.sync_write(0, [(id, bytes(length)) for id in range(most)])
    assert len(full) <= 259
    if vendor:
        assert len(wire.sync_write(0, [(id, bytes(length)) for id in range(vendor)], cap=246)) <= 250


@pytest.mark.parametrize("length", [0, -1, 251])
def test_a_sync_write_of_an_impossible_length_has_no_capacity(length: int) -> None:
    with pytest.raises(RequestError, match="impossible"):
        wire.sync_write_capacity(length)


# --- decoding -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no FF FF"),
        ("FF", "no FF FF"),
        ("00 FF 01 02 00 FC", "no FF FF"),
        ("FF FF 01 02 00", "only 5 bytes"),
        ("FF FF FE 02 00 FF", "id 254 is impossible"),
        ("FF FF FF 02 00 FE", "id 255 is impossible"),
        ("FF FF 01 01 00 FD", "length 1 is impossible"),
        ("FF FF 01 02 00 FC 00", "length 2 means 6 bytes but 7 are there"),
        ("FF FF 01 04 00 18 05", "length 4 means 8 bytes but 7 are there"),
    ],
)
def test_what_is_not_exactly_one_status_packet_is_a_framing_error(text: str, why: str) -> None:
    data = bytes.fromhex(text)
    with pytest.raises(FramingError, match=why) as caught:
        wire.decode_status(data)
    assert caught.value.received == data
    assert caught.value.expected


def test_a_wrong_checksum_is_an_error_that_says_the_right_one() -> None:
    with pytest.raises(ChecksumError, match="FD is wrong") as caught:
        wire.decode_status(bytes.fromhex("FF FF 01 02 00 FD"))
    assert caught.value.expected == "FC as the last byte"


@given(st.binary(max_size=80))
def test_sync_parameters_are_whole_items_or_nothing(parameters: bytes) -> None:
    written = wire.decode_sync_write(parameters)
    if written is not None:
        assert {len(data) for _, data in written.items} == {written.length}
        again = b"".join(bytes((id,)) + data for id, data in written.items)
        assert bytes((written.address, written.length)) + again == parameters
    read = wire.decode_sync_read(parameters)
    assert (read is None) == (len(parameters) < 3)
    assert read is None or bytes((read.address, read.length, *read.ids)) == parameters


@pytest.mark.parametrize("text", ["", "2A", "2A 02", "2A 00 01 02", "2A 02 01 00", "2A 01 01 00 02"])
def test_a_sync_write_that_does_not_divide_into_items_is_none(text: str) -> None:
    assert wire.decode_sync_write(bytes.fromhex(text)) is None


def test_every_known_instruction_has_a_name_and_a_rule() -> None:
    names = [wire.instruction_name(code) for code in wire.Instruction]
    assert len(set(names)) == len(names) == 13
    assert wire.instruction_name(0x09) == "unknown (0x09)"
    assert wire.instruction_name(0x55) == "unknown (0x55)"
    assert set(wire.RULES) == set(wire.Instruction)
    assert {code for code, rule in wire.RULES.items() if not rule.sent} == {0x08, 0x09, 0x0D}
