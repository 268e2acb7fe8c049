"""What reading and writing each object does, beyond the manual's commands: status, limits, mid point, reverse."""

from __future__ import annotations

import pytest

from tests.simulators.kst.host import Host

READ = "4002600000000000"
SAVE = "2210100173617665"


def ext(**options: str | float) -> Host:
    return Host(rate=500_000, profile="kst-ext", **options)


def word(raw: int) -> str:
    return raw.to_bytes(2, "little", signed=True).hex().upper()


def write(host: Host, index: int, raw: int) -> str:
    """Write a word; gives the data of the reply."""
    (reply,) = host.say(f"625#22{index & 255:02X}{index >> 8:02X}00{word(raw)}0000")
    return reply.removeprefix("5A5#")


def read(host: Host, index: int) -> int:
    (reply,) = host.say(f"625#40{index & 255:02X}{index >> 8:02X}0000000000")
    return int.from_bytes(bytes.fromhex(reply[12:16]), "little", signed=True)


def restarted(host: Host) -> Host:
    host.say(f"625#{SAVE}")
    host.wait(0.2)
    host[0x25].power_cycle()
    return host


# --- status -----------------------------------------------------------------------------------------------------


def test_the_status_tells_current_and_temperature() -> None:
    host = ext()
    host[0x25].temperature = -5
    assert host.say("625#4005600000000000") == ["5A5#430560000000FB00"]
    host[0x25].temperature = 40.4
    host[0x25].load = 0.4
    assert host.say("625#4005600000000000") == ["5A5#4305600064002800"], "1.00 A in 0.01 A, 40 °C"
    host[0x25].load = -0.4
    assert host.say("625#4005600000000000") == ["5A5#4305600064002800"], "a current has no sign"


def test_xqpower_tells_the_current_in_milliamperes() -> None:
    host = Host(profile="xqpower")
    host[0x25].load = 0.4
    assert host.say("625#4005600000000000") == ["5A5#43056000E8031900"]


# --- travel limits ----------------------------------------------------------------------------------------------


def test_a_position_beyond_a_travel_limit_goes_as_far_as_the_limit() -> None:
    host = ext()
    write(host, 0x300A, -300)
    write(host, 0x300B, 200)
    for wanted, reached in ((900, 200), (-900, -300), (150, 150)):
        assert write(host, 0x6003, wanted).startswith("60")
        assert host[0x25].memory["goal_position"] == reached
        host.wait(2.0)
        assert read(host, 0x6002) == reached


@pytest.mark.parametrize(
    ("index", "raw", "code"),
    [
        (0x300A, 1, "31000906"),
        (0x300A, -1001, "32000906"),
        (0x300B, 1001, "31000906"),
        (0x300B, -1, "32000906"),
    ],
)
def test_limits_have_a_range_of_their_own(index: int, raw: int, code: str) -> None:
    assert write(ext(), index, raw) == f"80{index & 255:02X}3000{code}"
    host = ext(out_of_range="clamp")
    assert write(host, index, raw).startswith("60")
    assert read(host, index) in (-1000, 0, 1000)


def test_limits_are_kept_by_a_save_and_lost_without() -> None:
    host = ext()
    write(host, 0x300A, -300)
    host[0x25].power_cycle()
    assert read(host, 0x300A) == -1000
    write(host, 0x300A, -300)
    assert read(restarted(host), 0x300A) == -300


def test_the_manual_has_no_limits_and_no_reverse_bit() -> None:
    for index in ("0A30", "0B30", "0F30", "0930", "0022", "0B10", "0560"):
        assert Host().say(f"625#22{index}0000000000") == [f"5A5#80{index}0000000206"]


# --- mid point --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("data", [0, 1])
def test_the_mid_point_makes_the_present_position_zero_and_nothing_moves(data: int) -> None:
    host = ext(position=345)
    assert write(host, 0x3009, data) == "6009300000000000"
    assert (read(host, 0x6002), read(host, 0x6003)) == (0, 0)
    assert host[0x25].motion.moving(host.now) is False
    write(host, 0x6003, 100)
    host.wait(1.0)
    assert (read(host, 0x6002), host[0x25].motion.position(host.now)) == (100, 445)


def test_the_mid_point_is_kept_by_a_save_and_lost_without() -> None:
    host = ext(position=345)
    write(host, 0x3009, 0)
    host[0x25].power_cycle()
    assert read(host, 0x6002) == 345
    write(host, 0x3009, 0)
    assert read(restarted(host), 0x6002) == 0


# --- reverse ----------------------------------------------------------------------------------------------------


def test_bit_5_reverses_reading_and_target_and_nothing_moves() -> None:
    host = ext(position=200)
    assert write(host, 0x300F, 0x20) == "600F300000000000"
    host.wait(1.0)
    assert (read(host, 0x6002), read(host, 0x6003)) == (-200, -200)
    write(host, 0x6003, 300)
    host.wait(1.0)
    assert (read(host, 0x6002), host[0x25].motion.position(host.now)) == (300, -300)
    write(host, 0x300F, 0)
    assert read(host, 0x6002) == -300


def test_the_other_bits_are_kept_and_do_nothing() -> None:
    host = ext(position=200)
    write(host, 0x300F, 0x53)
    assert host.say("625#400F300000000000") == ["5A5#4F0F300053000000"]
    assert read(host, 0x6002) == 200


def test_in_the_reversed_state_one_limit_changes_the_other_too() -> None:
    host = ext()
    write(host, 0x300A, -500)
    assert read(host, 0x300B) == 1000
    write(host, 0x300F, 0x20)
    write(host, 0x300A, -300)
    assert (read(host, 0x300A), read(host, 0x300B)) == (-300, 300)


# --- access -----------------------------------------------------------------------------------------------------


def test_what_newer_firmware_only_takes_cannot_be_read() -> None:
    for index in ("0022", "0930"):
        assert ext().say(f"625#40{index}0000000000") == [f"5A5#80{index}0001000106"]


def test_lengths_stated_by_a_public_tool_are_the_right_ones() -> None:
    host = ext()
    assert host.say("625#2F00220014000000", "625#2309300000000000") == [
        "5A5#6000220000000000",
        "5A5#6009300000000000",
    ]
