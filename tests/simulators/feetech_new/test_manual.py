"""Every example of the protocol manual V1.01, end to end; the bytes are those it prints, as corrected where it errs."""

from __future__ import annotations

import pytest

from tests.simulators.feetech_new.host import (
    Host,
)


def test_example_1_ping() -> None:
    assert Host().say("FF FF 01 02 01 FB") == ["FF FF 01 02 00 FC"]


def test_example_2_read_returns_1304_when_it_stands_there() -> None:
    assert Host(position=1304).say("FF FF 01 04 02 38 02 BE") == ["FF FF 01 04 00 18 05 DD"]


def test_example_3_broadcast_write_sets_every_id_and_is_not_answered() -> None:
    host = Host((3, 7))
    assert host.say("FF FF FE 04 03 05 01 F4") == []
    assert [servo.id for servo in host.bus.servos] == [1, 1]
    assert list(host.bus.nodes) == [1]


def test_example_4_reaches_2048_at_1000_counts_per_second() -> None:
    host = Host(position=48)
    assert host.say("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5") == ["FF FF 01 02 00 FC"]
    host.wait(1.0)
    assert host.read(1, 58) == 1000
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
    assert all(servo.motion.moving(host.now) for servo in host.bus.servos)
    assert host.wait(2.0).read(10, 56) == 2048
    assert host.read(10, 64, 1) == 0


@pytest.mark.parametrize(
    "bad",
    [
        "FF FF 08 09 04 2A 00 08 00 00 E8 03 CE",
        "FF FF 0A 09 04 2A 00 08 00 00 E8 03 CE",
    ],
)
def test_the_four_misprinted_frames_of_example_5_get_silence(bad: str) -> None:
    host = Host(tuple(range(1, 11)))
    assert host.say(bad) == []
    assert all(servo.pending is None for servo in host.bus.servos)


def test_example_7_sync_write_moves_four_servos_and_nobody_answers() -> None:
    host = Host((1, 2, 3, 4), position=1500)
    request = (
        "FF FF FE 20 83 2A 06 01 00 08 00 00 E8 03 02 00 08 00 00 E8 03 "
        "03 00 08 00 00 E8 03 04 00 08 00 00 E8 03 58"
    )
    assert host.say(request) == []
    assert {servo.motion.start for servo in host.bus.servos} == {host.now}
    host.wait(1.0)
    assert [servo.raw_position for servo in host.bus.servos] == [2048] * 4


def test_example_8_reset_is_answered_by_the_id_that_was_asked() -> None:
    assert Host((0,)).say("FF FF 00 02 06 F7") == ["FF FF 00 02 00 FD"]
    assert Host((1,)).say("FF FF 01 02 06 F6") == ["FF FF 01 02 00 FC"]
