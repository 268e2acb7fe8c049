"""Who answers what, by map: broadcasts, SYNC READ, second ids, levels, lengths."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.simulator.instructions import OBEY
from motorbus.families.feetech.table import TABLES
from motorbus.families.feetech.wire import Instruction
from tests.simulators.feetech.host import (
    ACTION,
    ALL,
    PING,
    READ,
    REG_WRITE,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    Host,
    packet,
)
from tests.simulators.feetech.test_maps import LOCK, USUAL, host_of

ACK = ["FF FF 01 02 00 FC"]
SCS = {"scs", "scs2"}


def test_these_instructions_are_obeyed_and_no_others() -> None:
    left_out = {Instruction.UNKNOWN_09, Instruction.UPGRADE, Instruction.SYNC_READ, Instruction.SYNC_WRITE}
    assert set(OBEY) == set(Instruction) - left_out


@pytest.mark.parametrize("name", TABLES)
def test_the_whole_conversation_of_one_servo(name: str) -> None:
    host = host_of(name)
    assert host.say(packet(1, PING)) == ACK
    assert len(host.say(packet(1, READ, 0, 5))) == 1
    assert host.write(1, 13, 60) == ACK
    assert host.say(packet(1, REG_WRITE, 13, 61)) == ACK
    assert (host.read(1, 64, 1), host.read(1, 13, 1)) == (1, 60)
    assert host.say(packet(1, ACTION)) == ACK
    assert (host.read(1, 64, 1), host.read(1, 13, 1)) == (0, 61)
    assert host.say(packet(ALL, SYNC_WRITE, 13, 1, 1, 62)) == []
    assert host.read(1, 13, 1) == 62
    assert host.say(packet(ALL, WRITE, 13, 63)) == []
    assert host.read(1, 13, 1) == 63
    host.write(1, 8, 0)
    assert host.write(1, 13, 64) == []
    assert host.read(1, 13, 1) == 64


@pytest.mark.parametrize("name", TABLES)
def test_scs_answers_neither_a_broadcast_ping_nor_sync_read(name: str) -> None:
    host = host_of(name)
    assert host.say(packet(ALL, PING)) == ([] if name in SCS else ACK)
    assert len(host.say(packet(ALL, SYNC_READ, 56, 2, 1))) == (name not in SCS)


@pytest.mark.parametrize(("switch", "answers"), [("yes", set(TABLES)), ("no", set())])
def test_sync_read_may_be_answered_by_all_or_nobody(switch: str, answers: set[str]) -> None:
    for name in TABLES:
        host = host_of(name, sync_read=switch)
        assert len(host.say(packet(ALL, SYNC_READ, 56, 2, 1))) == (name in answers)


def test_a_mixed_bus_answers_a_sync_read_as_if_the_scs_were_missing() -> None:
    host = Host((1, 2, 3), "sts3215+scs0009+hls3925")
    times = [at for at, _ in host.timed(packet(ALL, SYNC_READ, 63, 1, 1, 2, 3))]
    assert times == [0.0, pytest.approx(140e-6)]  # the time of the second, 7 bytes of 10 us, is left free


def test_each_servo_of_a_mixed_bus_keeps_its_own_byte_order() -> None:
    host = Host((1, 2), "sts3215+scs0009", position={1: 258, 2: 258})
    assert host.say(packet(1, READ, 56, 2)) == ["FF FF 01 04 00 02 01 F7"]
    assert host.say(packet(2, READ, 56, 2)) == ["FF FF 02 04 00 01 02 F6"]


# The second id of HLS.


def second_host(**options: object) -> Host:
    host = Host((1, 5), "hls3925", **options)
    host.write(1, 7, 40)
    return host


def test_the_second_id_is_the_main_one_at_first() -> None:
    assert Host((9,), "hls3925").read(9, 7, 1) == 9


def test_a_second_id_is_obeyed_for_writes_only() -> None:
    host = second_host()
    assert host.write(40, 13, 60) == []
    assert host.read(1, 13, 1) == 60
    assert host.say(packet(40, REG_WRITE, 13, 61)) == []
    assert host.read(1, 64, 1) == 1
    assert host.say(packet(40, PING)) == host.say(packet(40, READ, 0, 5)) == []
    assert host.say(packet(40, ACTION)) == []
    assert host.read(1, 64, 1) == 1
    host.say(packet(ALL, SYNC_WRITE, 13, 1, 40, 62))
    assert host.read(1, 13, 1) == 62
    assert host.read(5, 13, 1) == 70


def test_a_write_to_the_second_id_may_be_answered_from_the_main_one() -> None:
    host = second_host(second_id="answer")
    assert host.write(40, 13, 60) == ACK
    assert host.say(packet(40, PING)) == []


def test_a_0_meant_for_the_return_delay_gives_an_hls_the_second_id_0() -> None:
    host = Host((0, 3), "sts3215+hls3925", servo_baud=0)
    host.write(3, 7, 0)
    host.write(0, 13, 50)
    assert (host.read(0, 13, 1), host.read(3, 13, 1)) == (50, 50)


def test_a_second_id_that_another_has_as_its_main_one() -> None:
    host = Host((1, 5), "hls3925")
    host.write(1, 7, 5)
    assert host.write(5, 13, 50) == ["FF FF 05 02 00 F8"]
    assert (host.read(1, 13, 1), host.read(5, 13, 1)) == (50, 50)


# Delays and rates.


@pytest.mark.parametrize(
    ("name", "register", "delay"),
    [
        ("sts", 0, 0.0), ("sts", 250, 500e-6), ("scs", 100, 200e-6), ("scs2", 100, 200e-6),
        ("smbl", 0, 100e-6), ("smbl", 49, 100e-6), ("smbl", 51, 102e-6), ("smcl", 0, 100e-6), ("smcl", 250, 500e-6),
        ("hls", 250, 0.0),
    ],
)  # fmt: skip
def test_register_7_delays_replies_as_the_map_has_it(name: str, register: int, delay: float) -> None:
    host = host_of(name)
    host.write(1, 7, register)
    assert host.timed(packet(1, PING)) == [(delay, ACK[0])]


def test_register_7_may_be_reserved() -> None:
    for name, delay in (("sts", 0.0), ("smbl", 100e-6)):
        host = host_of(name, return_delay="ignore")
        host.write(1, 7, 250)
        assert host.timed(packet(1, PING)) == [(delay, ACK[0])]


def test_sms_ship_with_115200_and_the_others_with_1_mbit() -> None:
    rates = {name: Host((1,), model).bus.nodes[1].baud_rate for name, model in USUAL.items()}
    assert rates == {name: 115_200 if name.startswith("sm") else 1_000_000 for name in TABLES}
    assert Host((1,), "sm85blhv").bus.usual_rate == 115_200


@pytest.mark.parametrize("name", TABLES)
def test_a_servo_at_another_rate_is_silent(name: str) -> None:
    host = host_of(name, servo_baud=500_000)
    host.bus.tune(1_000_000)
    assert host.say(packet(1, PING)) == []
    host.bus.tune(500_000)
    assert host.say(packet(1, PING)) == ACK


@pytest.mark.parametrize("name", TABLES)
def test_codes_that_a_map_does_not_allow_are_rates_or_make_it_deaf(name: str) -> None:
    for switch in ("all", "by_map"):
        host = host_of(name, baud_codes=switch)
        host.write(1, 6, 11)
        allowed = switch == "all" or name == "smbl"
        assert host.bus.nodes[1].baud_rate == (4_800 if allowed else None)


@pytest.mark.parametrize("name", TABLES)
def test_an_id_is_changed_and_locked_by_the_register_of_the_map(name: str) -> None:
    host = host_of(name)
    host.write(1, LOCK[name], 0)
    assert host.write(1, 5, 7) == ["FF FF 01 02 00 FC"]
    host.wait(1.0).write(7, LOCK[name], 1)
    host.bus.nodes[7].power_cycle()
    assert host.say(packet(7, PING)) == ["FF FF 07 02 00 F6"]


# While the EEPROM is at work.


@pytest.mark.parametrize(("switch", "later"), [("buffer", 0.02), ("answer", 0.0)])
def test_what_is_asked_during_flash_work_comes_in_a_burst_or_at_once(switch: str, later: float) -> None:
    host = Host(while_storing=switch)
    host.write(1, LOCK["sts"], 0)
    host.bus.receive(packet(1, WRITE, 13, 60) + packet(1, PING) + packet(1, READ, 13, 1), host.now)
    replies = host.timed(packet(ALL, SYNC_READ, 13, 1, 1))
    assert sorted((reply[:14], at) for at, reply in replies) == [
        ("FF FF 01 02 00", min(later, 0.02)),
        ("FF FF 01 02 00", 0.02),
        ("FF FF 01 03 00", later),
        ("FF FF 01 03 00", later),
    ]
