"""Which servo receives and answers which packet, and when."""

from __future__ import annotations

import random

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.errors import RequestError
from tests.simulators.feetech.host import (
    ACK,
    ACTION,
    ALL,
    BOOTLOADER,
    CALIBRATE,
    CLEAR_TURNS,
    LOCK,
    MODELS,
    PING,
    READ,
    REG_WRITE,
    RESTORE,
    SYNC_READ,
    SYNC_WRITE,
    UNKNOWN,
    WRITE,
    Host,
    packet,
)

# -- the manual V1.01; the bytes are those it prints, as corrected where it errs --------------------


@pytest.mark.parametrize(
    ("request_", "replies"),
    [
        ("FF FF 01 02 01 FB", ACK),  # 1: PING
        ("FF FF 01 04 02 38 02 BE", ["FF FF 01 04 00 18 05 DD"]),  # 2: READ, it stands at 1304
        ("FF FF FE 04 03 05 01 F4", []),  # 3: broadcast WRITE of the id
        ("FF FF 01 02 06 F6", ACK),  # 8: RESET
        ("FF FF 01 09 04 2A 00 08 00 00 E8 03 CE", []),  # 5, with a misprinted checksum
    ],
)
def test_example_of_the_manual(request_: str, replies: list[str]) -> None:
    assert Host(position=1304).say(request_) == replies


def test_example_4_reaches_2048_at_1000_counts_per_second() -> None:
    host = Host(position=48)
    assert host.say("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5") == ACK
    assert host.wait(1.0).read(1, 58) == 1000
    host.wait(1.5)
    assert (host.read(1, 56), host.read(1, 58), host.read(1, 66, 1)) == (2048, 0, 0)


def test_examples_5_and_6_start_ten_servos_in_the_same_instant() -> None:
    host = Host(tuple(range(1, 11)), position=1000)
    checksums = ["D4", "D3", "D2", "D1", "D0", "CF", "CE", "CD", "CC", "CB"]
    for id, checksum in enumerate(checksums, start=1):
        request = f"FF FF {id:02X} 09 04 2A 00 08 00 00 E8 03 {checksum}"
        assert host.say(request) == [f"FF FF {id:02X} 02 00 {0xFD - id:02X}"]
        assert host.read(id, 64, 1) == 1
        host.wait(0.001)
    assert not any(servo.motion.moving(host.now) for servo in host.bus.servos)
    assert host.say("FF FF FE 02 05 FA") == []
    assert {servo.motion.start for servo in host.bus.servos} == {host.now}
    assert host.wait(2.0).read(10, 56) == 2048
    assert host.read(10, 64, 1) == 0


def test_example_7_sync_write_moves_four_servos_and_none_answers() -> None:
    host = Host((1, 2, 3, 4), position=1500)
    request = (
        "FF FF FE 20 83 2A 06 01 00 08 00 00 E8 03 02 00 08 00 00 E8 03 "
        "03 00 08 00 00 E8 03 04 00 08 00 00 E8 03 58"
    )
    assert host.say(request) == []
    assert {servo.motion.start for servo in host.bus.servos} == {host.now}
    host.wait(1.0)
    assert [servo.raw_position for servo in host.bus.servos] == [2048] * 4


# -- silence ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "data",
    [
        bytes.fromhex("FF FF 01 02 01 FC"),  # wrong checksum
        packet(2, PING),
        packet(1, UNKNOWN),
        packet(1, CLEAR_TURNS),  # ignored by STS3215 firmware 3.10
        packet(1, 0x55),
        packet(1, PING, 0),  # wrong number of parameters
        packet(1, READ, 56),
        packet(1, READ, 0, 254),
        packet(1, WRITE),
        packet(1, ACTION, 0),
        packet(1, RESTORE, 0),
        packet(1, CALIBRATE, 0),
        packet(ALL, READ, 56, 2),  # broadcasts
        packet(ALL, REG_WRITE, 42, 0, 8),
        packet(ALL, ACTION),
        packet(1, SYNC_READ, 56, 2, 1),  # only as a broadcast
        packet(1, SYNC_WRITE, 42, 2, 1, 0, 8),
        packet(ALL, SYNC_READ, 56, 254, 1),
        packet(ALL, SYNC_READ, 56, 2),
        packet(ALL, SYNC_WRITE, 42, 2, 1, 0),
        packet(ALL, SYNC_WRITE, 42, 0, 1),
    ],
    ids=lambda data: data.hex(" "),
)
def test_packet_that_no_servo_answers(data: bytes) -> None:
    host = Host()
    assert host.say(data) == []
    assert host.say(packet(1, PING)) == ACK
    assert (host.read(1, 40, 1), host.read(1, 42)) == (0, 0)


# -- streams ---------------------------------------------------------------------------------------


def test_requests_in_single_bytes_and_with_noise_in_one_piece() -> None:
    host = Host((1, 2))
    for byte in bytes.fromhex("FF FF 01 02 01"):
        assert host.say(bytes([byte])) == []
    assert host.say(b"\xfb") == ACK
    noise = bytes.fromhex("00 FF 13 FF FF")
    assert host.say(packet(1, PING) + noise + packet(2, PING)) == [*ACK, "FF FF 02 02 00 FB"]
    # FF FF 01 03 claims seven bytes; they end inside the valid packet
    assert host.say(bytes.fromhex("FF FF 01 03") + packet(1, PING)) == ACK
    host.bus.receive(CanFrame(0x601, b"\0" * 8), host.now)
    assert host.bus.due() is None


def test_incomplete_packet_is_dropped_after_a_pause() -> None:
    host = Host()
    host.say(bytes.fromhex("FF FF 01 FF 03"))  # claims 259 bytes
    assert host.say(packet(1, PING)) == []
    assert host.wait(0.0049).say(packet(1, PING)) == []
    assert host.wait(0.0052).say(packet(1, PING)) == ACK


def test_random_bytes_raise_nothing() -> None:
    host, dice = Host(), random.Random(2)
    for _ in range(1000):
        host.wait(0.001).say(dice.randbytes(dice.randrange(1, 40)))
    assert host.wait(0.01).say(packet(1, PING)) == ACK


# -- one servo -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_every_instruction_of_the_manual(name: str) -> None:
    host = Host((1,), name)
    assert host.say(packet(1, PING)) == ACK
    assert len(host.say(packet(1, READ, 0, 5))) == 1
    assert host.write(1, 13, 60) == ACK
    assert host.say(packet(1, ACTION)) == host.say(packet(1, WRITE, 42)) == ACK  # without effect
    for value in (99, 61):  # the second one replaces the first
        assert host.say(packet(1, REG_WRITE, 13, value)) == ACK
    assert (host.read(1, 64, 1), host.read(1, 13, 1)) == (1, 60)
    assert host.say(packet(1, ACTION)) == ACK
    assert (host.read(1, 64, 1), host.read(1, 13, 1)) == (0, 61)
    assert host.say(packet(ALL, SYNC_WRITE, 13, 1, 1, 62)) == []
    assert host.read(1, 13, 1) == 62
    assert host.say(packet(ALL, WRITE, 13, 63)) == []
    assert host.read(1, 13, 1) == 63
    host.write(1, 8, 0)  # status return level
    assert host.write(1, 13, 64) == host.say(packet(1, REG_WRITE, 13, 65)) == []
    assert host.say(packet(1, ACTION)) == []
    assert (host.say(packet(1, PING)), host.read(1, 13, 1)) == (ACK, 65)
    assert host.write(1, 8, 1) == ACK


def test_read_of_the_identity_of_nothing_and_beyond_the_table() -> None:
    # firmware 3.10, byte order 0, model 9.3, id 4
    assert Host((4,)).say(packet(4, READ, 0, 6)) == ["FF FF 04 08 00 03 0A 00 09 03 04 D6"]
    host = Host()
    assert host.say(packet(1, READ, 56, 0)) == ACK
    assert host.say(packet(1, READ, 250, 10)) == ["FF FF 01 0C 00 00 00 00 00 00 00 00 00 00 00 F2"]
    assert len(host.say(packet(1, READ, 0, 253))[0].split()) == 259


@pytest.mark.parametrize("code", [PING, SYNC_READ, RESTORE])
def test_servo_that_lacks_an_instruction_answers_the_others(code: int) -> None:
    """An encoder board answers READ and WRITE only (avenhaus/SO-ARM100-Encoders)."""
    host = Host()
    request = packet(ALL, SYNC_READ, 5, 1, 1) if code == SYNC_READ else packet(1, code)
    host.servo.lacks = {code}
    assert host.say(request) == []
    assert host.read(1, 5, 1) == 1
    host.servo.lacks = set()
    assert len(host.say(request)) == 1


# -- several servos --------------------------------------------------------------------------------


def test_broadcast_ping() -> None:
    assert Host((9,)).say("FF FF FE 02 01 FE") == ["FF FF 09 02 00 F4"]
    # byte by byte ANDed: 01 & 02 = 00, FC & FB = F8
    assert Host((1, 2)).say(packet(ALL, PING)) == ["FF FF 00 02 00 F8"]
    host = Host((5, 2), broadcast_ping="in_turn")
    assert host.timed(packet(ALL, PING)) == [(0.0, "FF FF 02 02 00 FB"), (60e-6, "FF FF 05 02 00 F8")]
    for name in ("scs", "scs2"):
        host = Host((1,), name)
        assert host.say(packet(ALL, PING)) == host.say(packet(ALL, SYNC_READ, 56, 2, 1)) == []


def test_two_servos_with_one_id_garble_unequal_replies() -> None:
    host = Host((1, 1))
    assert host.say(packet(1, PING)) == ACK
    host.bus.servos[1].raw_position = 1304
    # 2048 = 00 08 with checksum F2; 1304 = 18 05 with checksum DD
    assert host.say(packet(1, READ, 56, 2)) == ["FF FF 01 04 00 00 00 D0"]


@pytest.mark.parametrize(
    ("delay", "replies"),
    [
        # FF FF 01 02 00 FC
        #          FF FF 01 02 00 FC, three bytes later
        (15, [(0.0, "FF FF 01 02 00 00 02 00 FC")]),
        (200, [(0.0, "FF FF 01 02 00 FC"), (400e-6, "FF FF 01 02 00 FC")]),
    ],
)
def test_later_reply_is_shifted_or_separate(delay: int, replies: list[tuple[float, str]]) -> None:
    host = Host((1, 1))
    host.bus.servos[1].memory["return_delay"] = delay
    assert host.timed(packet(1, PING)) == replies


def test_duplicate_is_late_by_chance_and_can_be_added_at_run_time() -> None:
    host = Host(duplicate="1")
    replies = [host.say(packet(1, READ, 0, 40)) for _ in range(12)]
    assert sum(len(reply[0].split()) > 46 for reply in replies) == 12
    assert [host.say(packet(1, READ, 0, 40)) for _ in range(12)] != replies
    assert Host(duplicate="1").say(packet(1, READ, 0, 40)) == replies[0]
    host = Host((1, 2))
    host.write(1, 6, 1)  # 500 kbit/s
    host.wait(1.0).bus.duplicate(1)
    assert [servo.id for servo in host.bus.servos] == [1, 2, 1]
    assert [servo.baud_rate for servo in host.bus.servos] == [500_000, 1_000_000, 500_000]
    assert list(host.bus.nodes) == [1, 2]
    host.bus.servos[2].power_cycle()
    assert host.bus.servos[2].baud_rate == 500_000
    with pytest.raises(RequestError, match="no servo has the id 7"):
        host.bus.duplicate(7)


def test_replies_are_sent_in_the_order_of_their_start_unless_the_supply_goes() -> None:
    host = Host((1, 2, 3))
    host.write(1, 7, 250)
    host.write(2, 7, 100)
    for id in (1, 2, 3):
        host.bus.receive(packet(id, PING), host.now)
    assert [data[2] for _, data in host.bus.advance(host.now + 0.0003) if isinstance(data, bytes)] == [3, 2]
    assert [data[2] for _, data in host.bus.advance(host.now + 1.0) if isinstance(data, bytes)] == [1]
    host.wait(1.0).bus.receive(packet(1, PING), host.now)
    host.servo.power_cycle()
    assert host.bus.advance(host.now + 1.0) == []


@pytest.mark.parametrize(
    ("missing", "times"), [("wait", [0.0, 160e-6]), ("close_up", [0.0, 80e-6]), ("silent", [0.0])]
)
def test_sync_read_with_a_missing_servo(missing: str, times: list[float]) -> None:
    host = Host((1, 3), sync_read_missing=missing)
    assert [at for at, _ in host.timed(packet(ALL, SYNC_READ, 56, 2, 1, 2, 3))] == times


def test_sync_read_in_the_order_of_its_list_with_each_return_delay() -> None:
    host = Host((1, 2, 3))
    for servo in host.bus.servos:
        servo.raw_position = servo.id
    host.bus.nodes[1].memory["return_delay"] = 50
    assert host.timed(packet(ALL, SYNC_READ, 56, 2, 3, 1, 2)) == [
        (0.0, "FF FF 03 04 00 03 00 F5"),
        (180e-6, "FF FF 01 04 00 01 00 F9"),
        (260e-6, "FF FF 02 04 00 02 00 F7"),
    ]


def test_mixed_bus_keeps_byte_orders_and_leaves_out_scs_in_sync_read() -> None:
    host = Host((1, 2, 3), "sts3215+scs0009+hls3925", position=258)
    assert host.say(packet(1, READ, 56, 2)) == ["FF FF 01 04 00 02 01 F7"]
    assert host.say(packet(2, READ, 56, 2)) == ["FF FF 02 04 00 01 02 F6"]
    times = [at for at, _ in host.timed(packet(ALL, SYNC_READ, 63, 1, 1, 2, 3))]
    assert times == [0.0, pytest.approx(140e-6)]  # 7 bytes of 10 µs each for 1 and 2


def test_second_id_of_hls_is_obeyed_for_writes_only_and_silently() -> None:
    host = Host((1, 5), "hls3925")
    assert host.read(1, 7, 1) == 1  # at first it is the main id
    host.write(1, 7, 40)
    assert host.write(40, 13, 60) == host.say(packet(40, REG_WRITE, 13, 61)) == []
    assert (host.read(1, 13, 1), host.read(1, 64, 1)) == (60, 1)
    for silent in (packet(40, PING), packet(40, READ, 0, 5), packet(40, ACTION)):
        assert host.say(silent) == []
    assert host.read(1, 64, 1) == 1
    host.say(packet(ALL, SYNC_WRITE, 13, 1, 40, 62))
    assert (host.read(1, 13, 1), host.read(5, 13, 1)) == (62, 70)
    host.write(1, 7, 5)  # that of another servo, which alone answers
    assert host.write(5, 13, 50) == ["FF FF 05 02 00 F8"]
    assert (host.read(1, 13, 1), host.read(5, 13, 1)) == (50, 50)


# -- adapter, delays and rates ---------------------------------------------------------------------


def test_echo_precedes_every_reply() -> None:
    host = Host(echo="yes")
    assert host.say(packet(1, PING)) == ["FF FF 01 02 01 FB", *ACK]
    assert host.say("FF FF 09") == ["FF FF 09"]


@pytest.mark.parametrize(
    ("name", "register", "delay"),
    [
        ("sts", 0, 0.0),
        ("sts", 250, 500e-6),
        ("scs", 100, 200e-6),
        ("smbl", 49, 100e-6),
        ("smbl", 51, 102e-6),
        ("smcl", 0, 100e-6),
        ("hls", 250, 0.0),  # its second id
    ],
)
def test_register_7_delays_replies(name: str, register: int, delay: float) -> None:
    host = Host((1,), name)
    host.write(1, 7, register)
    assert host.timed(packet(1, PING)) == [(delay, *ACK)]


@pytest.mark.parametrize("name", MODELS)
def test_servo_at_another_rate_is_silent(name: str) -> None:
    host = Host((1,), name)
    shipped = 115_200 if name.startswith("sm") else 1_000_000
    assert host.bus.usual_rate == shipped
    host.bus.tune(57_600)
    assert host.say(packet(1, PING)) == []
    host.bus.tune(shipped)
    host.write(1, 6, 11)  # 4800 bit/s
    assert host.say(packet(1, PING)) == []
    host.bus.tune(4_800)
    assert host.say(packet(1, PING)) == ACK
    host.write(1, 6, 12)
    assert host.servo.baud_rate is None


@pytest.mark.parametrize(("baud_ack", "replies"), [("old", ACK), ("new", [])])
def test_acknowledgement_of_a_new_rate(baud_ack: str, replies: list[str]) -> None:
    host = Host(baud_ack=baud_ack)
    host.bus.tune(1_000_000)
    assert host.write(1, 6, 1) == replies
    host.bus.tune(500_000)
    assert host.say(packet(1, PING)) == ACK


@pytest.mark.parametrize(("id_ack", "reply"), [("old", ACK[0]), ("new", "FF FF 07 02 00 F6")])
@pytest.mark.parametrize("name", MODELS)
def test_id_is_changed_behind_the_lock_of_the_map(name: str, id_ack: str, reply: str) -> None:
    host = Host((1,), name, id_ack=id_ack)
    host.write(1, LOCK[name], 0)
    assert host.write(1, 5, 7) == [reply]
    host.wait(1.0).write(7, LOCK[name], 1)
    host.bus.nodes[7].power_cycle()
    assert host.say(packet(7, PING)) == ["FF FF 07 02 00 F6"]


def test_bootloader_is_silent_and_limp_for_800_ms() -> None:
    host = Host(position=1000)
    host.write(1, 42, 0, 8)
    host.wait(0.1).say(packet(1, BOOTLOADER))
    there = host.servo.raw_position
    assert host.wait(0.79).say(packet(1, PING)) == []
    assert host.wait(0.02).say(packet(1, PING)) == ACK
    assert host.servo.raw_position == there


@pytest.mark.parametrize("commit", ["before_ack", "after_ack"])
def test_replies_wait_for_the_eeprom_or_precede_it(commit: str) -> None:
    host = Host(eeprom_commit=commit)
    later = 0.02 if commit == "before_ack" else 0.0
    assert host.timed(packet(1, WRITE, 13, 65)) == [(0.0, *ACK)]  # locked
    host.write(1, 55, 0)
    host.bus.receive(packet(1, WRITE, 13, 60) + packet(1, PING), host.now)
    replies = host.timed(packet(ALL, SYNC_READ, 13, 1, 1))
    heads = ["FF FF 01 02 00", "FF FF 01 02 00", "FF FF 01 03 00"]
    assert [(at, reply[:14]) for at, reply in replies] == [(later, head) for head in heads]
    assert host.wait(1.0).timed(packet(1, WRITE, 41, 60)) == [(0.0, *ACK)]
