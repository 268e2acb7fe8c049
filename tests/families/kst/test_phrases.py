"""The turns of phrase that explained frames share."""

from __future__ import annotations

from motorbus.families.kst.phrases import Told, angle, counted, degrees, faulted, reserved
from motorbus.families.kst.table import PROFILES


def test_a_position_is_told_in_degrees_and_counts() -> None:
    assert angle(PROFILES["kst"], 109) == "10.9° (raw 109, 10 per degree)"
    assert angle(PROFILES["xqpower"], 100) == "5.55556° (raw 100, 18 per degree)"
    assert degrees(PROFILES["kst"], -8) == "-0.8°"


def test_one_is_not_many() -> None:
    assert [counted(0), counted(1), counted(2, "data byte")] == ["0 bytes", "1 byte", "2 data bytes"]


def test_reserved_bytes_say_whether_they_are_zero() -> None:
    assert reserved(b"\0\0") == (2, "reserved", "0")
    assert reserved(b"\0\x01") == (2, "reserved", "ignored, though not 0")


def test_a_bad_frame_has_its_data_in_one_piece() -> None:
    assert faulted("no reply", "who", b"\x01\x02", "why") == Told(
        "no reply", "who", [(2, "data", "why")], "why"
    )
    assert faulted("no reply", "who", b"", "why").fields == []
