"""Frames are written as people read them, and back."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.cli import frame
from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.link.can_log import parse_word
from tests.conformance.subjects import FAMILIES

WORDS = ["625#2203600084030000", "00000625#4000300000000000", "5A5#", "625#R", "20000080#0000000000000000"]


@pytest.mark.parametrize("word", WORDS)
def test_a_can_frame_is_written_as_it_is_read(word: str) -> None:
    parsed = parse_word(word)
    assert parsed is not None
    assert frame.written(parsed) == word
    assert frame.can_frame(parsed.flat()) == parsed


def test_what_is_not_exactly_one_can_frame_is_bytes() -> None:
    template = FAMILIES["template"]
    assert frame.shown(bytes.fromhex("0000062501"), template) == "00 00 06 25 01"
    assert frame.shown(CanFrame(0x625, b"\x22").flat(), template) == "625#22"
    assert frame.facts(CanFrame(0x625, b"\x22").flat(), template) == {
        "data": "00 00 06 25 01 22",
        "frame": "625#22",
    }
    assert frame.shown(bytes.fromhex("0000062500"), families.load("feetech")) == "00 00 06 25 00"


def test_flags_take_no_digit_of_a_remote_frame() -> None:
    assert frame.written(CanFrame(0x10 | REMOTE_FLAG, b"")) == "010#R"
    assert frame.written(CanFrame(0x10 | ERROR_FLAG, b"")) == "20000010#"
