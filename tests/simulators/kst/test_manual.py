"""Every frame that the protocol manual prints, end to end: what the servo is asked, and exactly what it answers."""

from __future__ import annotations

import pytest

from tests.protocol.kst.vectors import ALL, MANUAL, REQUESTS, Vector, name_of
from tests.simulators.kst.host import Host

POSITIONS = {
    -900: "7CFC",
    -109: "93FF",
    -8: "F8FF",
    0: "0000",
    8: "0800",
    109: "6D00",
    900: "8403",
}
"""The seven columns of the position table: raw value, and low and high byte as printed."""
CODES = dict(enumerate((20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)))
BY_ID = {vector.id: vector for vector in ALL}


@pytest.mark.parametrize("code", CODES)
def test_command_1_sets_the_bit_rate_which_counts_after_save_and_restart(code: int) -> None:
    host = Host()
    assert host.say(f"625#22013000{code:02X}000000") == ["5A5#6001300000000000"]
    assert host[0x25].bit_rate == 500_000
    assert host.say("625#2210100173617665") == []
    host.wait(0.2)
    host[0x25].power_cycle()
    assert host[0x25].bit_rate == CODES[code]


def test_command_1_is_lost_at_a_restart_when_it_was_not_saved() -> None:
    host = Host()
    host.say("625#2201300007000000")
    host[0x25].power_cycle()
    assert host[0x25].bit_rate == 500_000
    assert host.say("625#4000300000000000") == ["5A5#4F00300025000000"]


def test_command_2_sets_the_node_id_which_counts_after_save_and_restart() -> None:
    host = Host()
    assert host.say("625#2200300026000000") == ["5A5#6000300000000000"]
    host.say("625#2210100173617665")
    host.wait(0.2)
    assert host.say("626#4000300000000000") == []
    host[0x25].power_cycle()
    assert list(host.bus.nodes) == [0x26]
    assert host.say("625#4000300000000000", "626#4000300000000000") == ["5A6#4F00300026000000"]


def test_command_2_is_lost_at_a_restart_when_it_was_not_saved() -> None:
    host = Host()
    host.say("625#2200300026000000")
    host[0x25].power_cycle()
    assert list(host.bus.nodes) == [0x25]
    assert host.say("625#4000300000000000") == ["5A5#4F00300025000000"]


def test_command_3_saves_and_is_not_answered() -> None:
    host = Host()
    host.say("625#2201300004000000")
    assert host[0x25].status()["saved"] is False
    assert host.say("625#2210100173617665") == []
    assert host.heard(1.0) == []
    assert host[0x25].status()["saved"] is True


@pytest.mark.parametrize("x", [0x00, 0x25, 0xFF])
def test_command_4_reads_the_node_id_whatever_stands_in_x(x: int) -> None:
    assert Host().say(f"625#40003000{x:02X}000000") == ["5A5#4F00300025000000"]


@pytest.mark.parametrize("raw", POSITIONS)
def test_commands_5_and_6_set_a_position_and_read_it(raw: int) -> None:
    host = Host(position=400)
    assert host.say(f"625#22036000{POSITIONS[raw]}0000") == ["5A5#6003600000000000"]
    host.wait(2.0)
    assert host.say("625#4002600000000000") == [f"5A5#4B026000{POSITIONS[raw]}0000"]


def test_command_5_acts_at_once_and_is_forgotten_at_a_restart() -> None:
    host = Host()
    host.say("625#2203600084030000")
    assert host[0x25].motion.start == 1.0
    host.wait(2.0)
    host[0x25].power_cycle()
    assert host[0x25].memory["goal_position"] == 0


def test_command_7_reads_two_status_bytes_by_the_frame_of_command_6() -> None:
    host = Host(status_6002="x1x2", x1="0x40", x2=1)
    assert host.say("625#4002600000000000") == ["5A5#4B02600040010000"]


def test_command_8_reads_the_version_first_character_first() -> None:
    assert Host(firmware="V1.2").say("625#400A100000000000") == ["5A5#430A100056312E32"]


def test_command_9_refuses_with_the_index_of_the_request() -> None:
    assert Host().say("625#4005600000000000") == ["5A5#8005600000000206"]


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ("E003600000000000", "01000405"),  # 0504 0001 specifier unknown
        ("7003600000000000", None),  # a segment with nothing under way: see the tests of the server
        ("4001300000000000", "01000106"),  # 0601 0001 read of what is write only
        ("4010100100000000", "01000106"),
        ("2202600000000000", "02000106"),  # 0601 0002 write of what is read only
        ("220A100000000000", "02000106"),
        ("4018100000000000", "00000206"),  # 0602 0000 no such object
        ("2305600000000000", "00000206"),
        ("2303600000000000", "12000706"),  # 0607 0012 too long
        ("2F03600000000000", "13000706"),  # 0607 0013 too short
        ("4003600100000000", "11000906"),  # 0609 0011 no such sub-index
        ("2200300080000000", "30000906"),  # 0609 0030 value range
        ("2200300000000000", "30000906"),
        ("2201300008000000", "30000906"),
        ("2203600085030000", "31000906"),  # 0609 0031 too high
        ("220360007BFC0000", "32000906"),  # 0609 0032 too low
        ("2210100173617666", "20000008"),  # 0800 0020 not stored
    ],
)
def test_the_codes_of_the_list_that_a_servo_can_have_cause_for(request_: str, code: str | None) -> None:
    (reply,) = Host().say(f"625#{request_}")
    if code is not None:
        assert reply == f"5A5#80{request_[2:8]}{code}"
    else:
        assert reply == "5A5#8000000001000405"


ANSWERS = {
    "bit-rate": "bit-rate-set",
    "node-id": "node-id-set",
    "read-node-id": "node-id",
    "set-position": "position-set",
    "read-position": "position-0",
    "read-status": "status",
    "read-version": "version",
    "save": "",
}


def answer_to(vector: Vector) -> list[str]:
    """The printed reply to a printed request."""
    key = max((key for key in ANSWERS if vector.id.startswith(key)), key=len)
    return [str(BY_ID[ANSWERS[key]].frame)] if ANSWERS[key] else []


@pytest.mark.parametrize("vector", [v for v in MANUAL if v.direction == "instruction"], ids=name_of)
def test_each_printed_request_gets_the_printed_reply(vector: Vector) -> None:
    status = "x1x2" if vector.id == "read-status" else "position"
    host = Host(status_6002=status, x1=0x40, x2=0x01, firmware="V1.2")
    assert host.say(str(vector.frame)) == answer_to(vector)


@pytest.mark.parametrize("profile", ["kst", "kst-ext", "kingmax", "xqpower"])
def test_every_request_there_is_a_vector_of_gets_one_answer_of_eight_bytes_or_silence(profile: str) -> None:
    for vector in REQUESTS:
        node = vector.frame.id - 0x600 or 0x25
        host = Host(node, profile=profile)
        heard = host.say(str(vector.frame))
        silent = vector.kind == "abort" or vector.frame.data[1:3] == b"\x10\x10"
        assert len(heard) == (not silent), vector.id
        assert all(text.startswith(f"{0x580 + node:03X}#") and len(text) == 20 for text in heard)


def test_frames_that_are_none_of_the_protocol_are_met_with_silence_or_refusal() -> None:
    for vector in ALL:
        if vector.valid:
            continue
        heard = Host(1, 0x25).say(str(vector.frame)) if not vector.frame.id >> 30 else []
        refused = vector.id in (
            "request-specifier-unknown",
            "request-block-upload",
            "request-segmented-download",
        )
        assert len(heard) == refused, vector.id
