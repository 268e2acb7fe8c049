"""Who can be reached at all: rate, id, plug, and the instructions that make a servo deaf for a while."""

from __future__ import annotations

import random

import pytest

from motorbus.errors import RequestError
from motorbus.families.feetech.simulator import simulate
from tests.simulators.feetech.host import (
    ALL,
    BOOTLOADER,
    CALIBRATE,
    PING,
    READ,
    RESTORE,
    SYNC_READ,
    WRITE,
    Host,
    packet,
    word,
)

# Rate, id, plug.


def test_the_wrong_rate_is_silence_both_ways() -> None:
    host = Host()
    host.bus.tune(115_200)
    assert host.say(packet(1, PING)) == []
    assert host.write(1, 41, 9) == []
    host.bus.tune(1_000_000)
    assert host.read(1, 41, 1) == 0


def test_without_a_known_rate_everybody_hears() -> None:
    host = Host()
    host.write(1, 6, 4)
    assert host.bus.rate is None
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]


@pytest.mark.parametrize(
    ("code", "rate"),
    [
        (0, 1_000_000),
        (1, 500_000),
        (2, 250_000),
        (3, 128_000),
        (4, 115_200),
        (5, 76_800),
        (6, 57_600),
        (7, 38_400),
    ],
)
def test_baud_codes(code: int, rate: int) -> None:
    host = Host()
    host.bus.tune(1_000_000)
    assert host.write(1, 6, code) == ["FF FF 01 02 00 FC"]  # the acknowledgement still comes at the old rate
    host.bus.tune(rate)
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]


def test_slower_wires_space_replies_by_their_own_byte_time() -> None:
    host = Host((1, 2))
    for servo in host.bus.servos:
        servo.memory["baud_rate"] = 4
    host.bus.tune(115_200)
    times = [at for at, _ in host.timed(packet(ALL, SYNC_READ, 56, 2, 1, 2))]
    assert times == [0.0, pytest.approx(80 / 115_200)]


def test_baud_acknowledged_at_the_new_rate_is_not_heard() -> None:
    host = Host(baud_ack="new")
    assert host.write(1, 6, 4) == []


def test_a_code_that_means_nothing_makes_it_deaf() -> None:
    host = Host()
    host.write(1, 6, 99)
    host.bus.tune(1_000_000)
    assert host.say(packet(1, PING)) == []


def test_the_id_write_is_acknowledged_from_the_old_id_or_the_new() -> None:
    host = Host((1,))
    assert host.write(1, 5, 7) == ["FF FF 01 02 00 FC"]
    assert host.say(packet(1, PING)) == []
    assert list(host.bus.nodes) == [7]
    assert Host((1,), id_ack="new").write(1, 5, 7) == ["FF FF 07 02 00 F6"]


def test_unplugged_is_silent_and_plugged_in_again_answers() -> None:
    host = Host((1, 2))
    host.bus.nodes[2].unplug()
    assert host.say(packet(2, PING)) == []
    assert host.say(packet(1, PING)) == ["FF FF 01 02 00 FC"]
    host.bus.nodes[2].plug()
    assert host.say(packet(2, PING)) == ["FF FF 02 02 00 FB"]


def test_a_reply_is_lost_when_the_supply_goes_before_it_begins() -> None:
    for lose in ("unplug", "power_cycle"):
        host = Host()
        host.write(1, 7, 250)
        host.bus.receive(packet(1, PING), host.now)
        getattr(host.bus.nodes[1], lose)()
        assert host.bus.advance(host.now + 1.0) == []


def test_advance_gives_only_what_has_begun() -> None:
    host = Host()
    host.write(1, 7, 100)
    host.bus.receive(packet(1, PING), 2.0)
    assert host.bus.due() == pytest.approx(2.0002)
    assert host.bus.advance(2.0001) == []
    assert [data for _, data in host.bus.advance(2.0002)] == [packet(1, 0)]
    assert host.bus.due() is None


def test_the_same_story_gives_the_same_bytes() -> None:
    def story() -> list[tuple[float, str]]:
        host, dice = Host((1, 2, 3)), random.Random(7)
        told = []
        for _ in range(300):
            request = packet(dice.choice((1, 2, 3, ALL)), dice.choice((READ, WRITE)), 42, *dice.randbytes(2))
            told += host.wait(dice.random() / 50).timed(request)
        return told

    assert story() == story()
    assert len(story()) > 50


# 0x08 and 0x06.


def test_0x08_is_not_answered_and_deafens_for_800_ms() -> None:
    host = Host()
    host.write(1, 41, 9)
    assert host.say(packet(1, BOOTLOADER)) == []
    assert host.wait(0.79).say(packet(1, PING)) == []
    assert host.wait(0.02).say(packet(1, PING)) == ["FF FF 01 02 00 FC"]
    assert host.read(1, 41, 1) == 0  # back as after power-up


def test_0x08_acknowledged() -> None:
    assert Host(bootloader="ack").say(packet(1, BOOTLOADER)) == ["FF FF 01 02 00 FC"]


def test_0x06_answers_then_is_deaf_for_half_a_second() -> None:
    host = Host()
    assert host.say(packet(1, RESTORE)) == ["FF FF 01 02 00 FC"]
    assert host.wait(0.49).say(packet(1, PING)) == []
    assert host.wait(0.02).say(packet(1, PING)) == ["FF FF 01 02 00 FC"]


def test_0x06_may_be_missing() -> None:
    assert Host(factory_restore="no").say(packet(1, RESTORE)) == []


def test_0x0b_may_be_missing() -> None:
    assert Host(calibrate="ignore").say(packet(1, CALIBRATE)) == []


# Making one.


def test_ids_that_cannot_be() -> None:
    for ids in ((254,), (-1,), ()):
        with pytest.raises(RequestError):
            simulate(ids)


def test_goals_reach_the_far_end_of_the_word() -> None:
    host = Host()
    host.write(1, 42, *word(-32209))
    assert host.read(1, 42) == 0xFDD1
    host.wait(5.0)
    assert host.read(1, 56) == 0  # as far as the limit
