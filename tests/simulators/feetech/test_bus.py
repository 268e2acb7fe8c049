"""Who answers which packet, and when: silence, cut streams, delays, collisions, trains of replies."""

from __future__ import annotations

import random

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator import simulate
from tests.simulators.feetech.host import (
    ACTION,
    ALL,
    CALIBRATE,
    CLEAR_TURNS,
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

# Silence.


@pytest.mark.parametrize(
    "data",
    [
        "FF FF 01 02 01 FC",  # wrong checksum
        "FF FF 02 02 01 FA",  # another id
        packet(1, UNKNOWN),
        packet(1, CLEAR_TURNS),  # ignored by STS3215 firmware 3.10
        packet(1, 0x55),
        packet(1, PING, 0),  # lengths that the instruction does not have
        packet(1, READ, 56),
        packet(1, READ, 56, 2, 0),
        packet(1, READ, 0, 254),
        packet(1, WRITE),
        packet(1, REG_WRITE),
        packet(1, ACTION, 0),
        packet(1, RESTORE, 0),
        packet(1, CALIBRATE, 0),
        packet(ALL, READ, 56, 2),  # broadcasts
        packet(ALL, WRITE, 42, 0, 8),
        packet(ALL, REG_WRITE, 42, 0, 8),
        packet(ALL, ACTION),
        packet(1, SYNC_READ, 56, 2, 1),  # only ever a broadcast
        packet(1, SYNC_WRITE, 42, 2, 1, 0, 8),
        packet(ALL, SYNC_READ, 56, 254, 1),
        packet(ALL, SYNC_READ, 56, 2),
        packet(ALL, SYNC_WRITE, 42, 2, 1, 0),
        packet(ALL, SYNC_WRITE, 42, 0, 1),
    ],
    ids=lambda data: data if isinstance(data, str) else data.hex(" "),
)
def test_silence(data: bytes | str) -> None:
    host = Host()
    assert host.say(data) == []
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]


def test_a_bad_sync_write_moves_nobody() -> None:
    host = Host()
    host.say(packet(ALL, SYNC_WRITE, 42, 2, 1, 0))
    assert host.read(1, 40, 1) == 0


def test_a_can_frame_means_nothing_here() -> None:
    bus = simulate((1,))
    bus.receive(CanFrame(0x601, b"\0" * 8), 1.0)
    assert bus.due() is None


# Cut and joined streams.


def test_bytes_one_by_one() -> None:
    host = Host()
    for byte in bytes.fromhex("FF FF 01 02 01"):
        assert host.say(bytes([byte])) == []
    assert host.say(b"\xfb") == ["FF FF 01 02 00 FC"]


def test_several_packets_and_noise_in_one_piece() -> None:
    host = Host((1, 2))
    noise = bytes.fromhex("00 FF 13 FF FF")
    assert host.say(packet(1, PING) + noise + packet(2, PING)) == ["FF FF 01 02 00 FC", "FF FF 02 02 00 FB"]


def test_a_request_within_a_false_one_is_found() -> None:
    # FF FF 01 03 claims seven bytes; they end inside the good packet and their sum is wrong
    assert Host().say(bytes.fromhex("FF FF 01 03") + packet(1, PING)) == ["FF FF 01 02 00 FC"]


def test_half_a_packet_is_forgotten_after_a_pause() -> None:
    host = Host()
    host.say(bytes.fromhex("FF FF 01 FF 03"))  # claims 259 bytes
    assert host.say(packet(1, PING)) == []
    assert host.wait(0.0049).say(packet(1, PING)) == []
    assert host.wait(0.0052).say(packet(1, PING)) == ["FF FF 01 02 00 FC"]


def test_without_a_pause_rule_half_a_packet_swallows_what_follows() -> None:
    host = Host(frame_gap=0)
    host.say(bytes.fromhex("FF FF 01 FF 03"))
    for _ in range(42):  # 5 + 42 * 6 = 257 of 259 bytes
        assert host.wait(1.0).say(packet(1, PING)) == []
    assert len(host.wait(1.0).say(packet(1, PING))) == 43  # then all of it comes at once


def test_random_bytes_neither_raise_nor_answer_much() -> None:
    host, dice = Host(), random.Random(2)
    for _ in range(2000):
        host.wait(0.001).say(dice.randbytes(dice.randrange(1, 40)))
    assert host.wait(0.01).say(packet(1, PING)) == ["FF FF 01 02 00 FC"]


# Answers.


def test_write_and_read_back() -> None:
    host = Host()
    assert host.write(1, 41, 50) == ["FF FF 01 02 00 FC"]
    assert host.say(packet(1, READ, 41, 1)) == ["FF FF 01 03 00 32 C9"]


def test_identity_block() -> None:
    # firmware 3.10, byte order 0, model 9.3, id 4
    assert Host((4,)).say(packet(4, READ, 0, 6)) == ["FF FF 04 08 00 03 0A 00 09 03 04 D6"]


def test_a_read_of_nothing_and_beyond_the_table() -> None:
    host = Host()
    assert host.say(packet(1, READ, 56, 0)) == ["FF FF 01 02 00 FC"]
    assert host.say(packet(1, READ, 250, 10)) == ["FF FF 01 0C 00 00 00 00 00 00 00 00 00 00 00 F2"]
    assert len(host.say(packet(1, READ, 0, 253))[0].split()) == 259


def test_the_error_byte_carries_the_alarms_and_nothing_else() -> None:
    host = Host()
    host.bus.nodes[1].alarm = 0x20
    assert host.say(packet(1, PING)) == ["FF FF 01 02 20 DC"]
    assert host.write(1, 55, 0) == ["FF FF 01 02 20 DC"]
    assert host.read(1, 65, 1) == 0x20
    assert host.read(1, 55, 1) == 0  # an alarm does not refuse a write


def test_level_0_answers_ping_and_reads_only() -> None:
    host = Host()
    host.write(1, 8, 0)
    assert host.write(1, 41, 7) == []
    assert host.say(packet(1, REG_WRITE, 41, 8)) == []
    assert host.say(packet(1, ACTION)) == []
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]
    assert host.read(1, 41, 1) == 8
    assert len(host.say(packet(ALL, SYNC_READ, 41, 1, 1))) == 1
    assert host.write(1, 8, 1) == ["FF FF 01 02 00 FC"]


def test_the_return_delay_is_in_steps_of_2_microseconds() -> None:
    host = Host()
    assert host.timed(packet(1, PING)) == [(0.0, "FF FF 01 02 00 FC")]
    host.write(1, 7, 250)
    assert host.timed(packet(1, PING)) == [(0.0005, "FF FF 01 02 00 FC")]


def test_an_eeprom_write_is_acknowledged_late_when_it_is_stored() -> None:
    host = Host()
    assert host.timed(packet(1, WRITE, 13, 65)) == [(0.0, "FF FF 01 02 00 FC")]  # locked: nothing to store
    host.write(1, 55, 0)
    assert host.timed(packet(1, WRITE, 13, 60)) == [(0.02, "FF FF 01 02 00 FC")]
    assert host.timed(packet(1, WRITE, 41, 60)) == [(0.0, "FF FF 01 02 00 FC")]


def test_an_address_without_a_datum() -> None:
    for instruction in (WRITE, REG_WRITE):
        assert Host().say(packet(1, instruction, 42)) == ["FF FF 01 02 00 FC"]
    host = Host()
    host.say(packet(1, REG_WRITE, 42))
    assert host.read(1, 64, 1) == 0


def test_action_with_nothing_pending_is_acknowledged() -> None:
    host = Host()
    assert host.say(packet(1, ACTION)) == ["FF FF 01 02 00 FC"]
    assert host.read(1, 40, 1) == 0


# Several at once.


def test_broadcast_ping_of_a_single_servo_gives_its_id() -> None:
    assert Host((9,)).say("FF FF FE 02 01 FE") == ["FF FF 09 02 00 F4"]


def test_broadcast_ping_of_several_collides() -> None:
    # byte by byte, low wins: 01 & 02 = 00, FC & FB = F8
    assert Host((1, 2)).say(packet(ALL, PING)) == ["FF FF 00 02 00 F8"]


def test_broadcast_ping_in_turn() -> None:
    host = Host((5, 2), broadcast_ping="in_turn")
    assert host.timed(packet(ALL, PING)) == [(0.0, "FF FF 02 02 00 FB"), (60e-6, "FF FF 05 02 00 F8")]


def test_two_servos_with_one_id_garble_each_other_when_they_differ() -> None:
    host = Host((1, 1))
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]  # alike: nobody can tell
    host.bus.servos[1].raw_position = 1304
    # 2048 = 00 08 with checksum F2; 1304 = 18 05 with checksum DD
    assert host.say(packet(1, READ, 56, 2)) == ["FF FF 01 04 00 00 00 D0"]


def test_unequal_return_delays_shift_the_collision() -> None:
    host = Host((1, 1))
    host.bus.servos[1].memory["return_delay"] = 15  # 30 us: three bytes at 1 Mbit/s
    # FF FF 01 02 00 FC
    #          FF FF 01 02 00 FC
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 00 02 00 FC"]


def test_replies_that_do_not_overlap_stay_apart() -> None:
    host = Host((1, 1))
    host.bus.servos[1].memory["return_delay"] = 200  # 400 us, the first needs 60
    assert host.timed(packet(1, PING)) == [(0.0, "FF FF 01 02 00 FC"), (0.0004, "FF FF 01 02 00 FC")]


def test_who_is_asked_later_and_begins_earlier_is_heard_first() -> None:
    host = Host((1, 2, 3))
    host.write(1, 7, 250)
    host.write(2, 7, 100)
    for id in (1, 2, 3):
        host.bus.receive(packet(id, PING), host.now)
    assert [data[2] for _, data in host.bus.advance(host.now + 0.0003) if isinstance(data, bytes)] == [3, 2]
    assert [data[2] for _, data in host.bus.advance(host.now + 1.0) if isinstance(data, bytes)] == [1]
    assert host.bus.due() is None


def test_sync_read_in_the_order_of_the_list_back_to_back() -> None:
    host = Host((1, 2, 3), position={1: 1, 2: 2, 3: 3})
    assert host.timed(packet(ALL, SYNC_READ, 56, 2, 3, 1, 2)) == [
        (0.0, "FF FF 03 04 00 03 00 F5"),
        (80e-6, "FF FF 01 04 00 01 00 F9"),
        (160e-6, "FF FF 02 04 00 02 00 F7"),
    ]


def test_sync_read_honours_each_return_delay() -> None:
    host = Host((1, 2))
    host.bus.nodes[2].memory["return_delay"] = 50
    assert [at for at, _ in host.timed(packet(ALL, SYNC_READ, 56, 2, 1, 2))] == [0.0, 180e-6]


@pytest.mark.parametrize(
    ("switch", "times"), [("wait", [0.0, 160e-6]), ("close_up", [0.0, 80e-6]), ("silent", [0.0])]
)
def test_sync_read_with_one_missing(switch: str, times: list[float]) -> None:
    host = Host((1, 3), sync_read_missing=switch)
    assert [at for at, _ in host.timed(packet(ALL, SYNC_READ, 56, 2, 1, 2, 3))] == times


def test_sync_write_reaches_those_who_are_there() -> None:
    host = Host((1, 3))
    assert host.say(packet(ALL, SYNC_WRITE, 41, 1, 1, 10, 2, 20, 3, 30)) == []
    assert (host.read(1, 41, 1), host.read(3, 41, 1)) == (10, 30)


# What lies between.


def test_an_adapter_that_hears_itself_repeats_everything_before_any_answer() -> None:
    host = Host(echo="yes")
    assert host.say(packet(1, PING)) == ["FF FF 01 02 01 FB", "FF FF 01 02 00 FC"]
    assert host.say("FF FF 09") == ["FF FF 09"]
    assert host.say(packet(ALL, WRITE, 41, 5)) == [packet(ALL, WRITE, 41, 5).hex(" ").upper()]


def test_replies_come_later_by_chance_and_the_same_again() -> None:
    def delays(seed: int) -> list[float]:
        host = Host(reply_jitter=0.001, seed=seed)
        return [host.timed(packet(1, PING))[0][0] for _ in range(50)]

    assert delays(1) == delays(1) != delays(2)
    assert all(0.0 <= delay < 0.001 for delay in delays(1))
    assert len(set(delays(1))) > 40


def test_replies_of_duplicates_with_jitter_are_separate_or_garbled() -> None:
    host = Host(duplicate="1", reply_jitter=0.0005, seed=3)
    status = "FF FF 01 02 00 FC"
    replies = [host.say(packet(1, PING)) for _ in range(50)]
    assert [status, status] in replies
    assert any(status not in reply for reply in replies)


# A second servo with an id that is there.


def test_a_second_servo_comes_while_the_bus_is_at_work() -> None:
    host = Host((1, 2))
    host.write(1, 6, 1)  # 500 kbit/s from now on
    host.wait(1.0)
    host.bus.duplicate(1)
    assert [servo.id for servo in host.bus.servos] == [1, 2, 1]
    assert host.bus.servos[2].baud_rate == host.bus.servos[0].baud_rate == 500_000
    assert len(host.bus.nodes) == 2
    host.bus.servos[2].memory["return_delay"] = 250
    host.bus.servos[2].power_cycle()
    assert len(host.say(packet(1, PING))) == 1  # the power cycle has taken its delay, and both say the same
    host.bus.servos[2].memory["return_delay"] = 250
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"] * 2
    assert host.bus.servos[2].baud_rate == 500_000
    with pytest.raises(RequestError, match="no servo has the id 7"):
        host.bus.duplicate(7)


def test_what_happens_to_servos_by_themselves_goes_on_beside_a_second_one() -> None:
    host = Host((1,))
    servo = host.bus.servos[0]
    servo.memory["goal_position"] = 3000
    servo.memory["torque_enable"] = 1
    servo.move(host.now)
    host.bus.duplicate(1)
    host.wait(10.0)
    assert servo.raw_position == 3000
    assert host.bus.servos[1].raw_position == 2048
