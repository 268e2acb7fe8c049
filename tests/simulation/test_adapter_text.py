"""The text of an adapter suffers line by line, and half a command waits for its other half."""

from __future__ import annotations

import pytest

from motorbus.link.base import PerfectLine
from motorbus.simulation.adapter_text import LONGEST, Text
from motorbus.simulation.faults import FaultyLine


def text(script: str) -> tuple[Text, FaultyLine]:
    line = FaultyLine(script, adapter=True)
    return Text(line), line


def test_without_harm_it_is_as_it_was() -> None:
    lines = Text(PerfectLine())
    assert lines.said(b"S6\rO\r", 0.0) == b"S6\rO\r"
    assert lines.answered(b"\r\rt1232AABB\r", 0.0) == b"\r\rt1232AABB\r"
    assert lines.said(b"< send 123 0 >", 0.0) == b"< send 123 0 >"
    assert lines.answered(b"", 0.0) == b""


def test_a_command_is_an_exchange_however_it_is_cut() -> None:
    for cut in range(1, 9):
        lines, line = text("exchange 2 byte 1 to device on adapter: corrupt 01")
        said = b"O\rt12\rC\r"
        assert lines.said(said[:cut], 0.0) + lines.said(said[cut:], 0.0) == b"O\rt02\rC\r"
        assert line.exchange == 3
        assert len(line.fired) == 1


def test_what_comes_back_counts_by_line_and_by_byte() -> None:
    lines, line = text("exchange 1 packet 2 on adapter: drop; exchange 1 byte 1 on adapter: flip 0")
    lines.said(b"t\r", 0.0)
    assert lines.answered(b"z\rt123\rt456\r", 0.0) == b"z\x0ct456\r"
    assert len(line.fired) == 2


def test_what_never_ends_is_not_kept_for_ever() -> None:
    lines = Text(PerfectLine())
    assert lines.said(b"x" * (LONGEST - 1), 0.0) == b""
    assert lines.said(b"x", 0.0) == b"x" * LONGEST


@pytest.mark.parametrize(("action", "got"), [("merge", b"a\rb\r"), ("reorder", b"b\ra\r")])
def test_lines_wait_for_each_other(action: str, got: bytes) -> None:
    lines, _ = text(f"exchange 1 on adapter: {action}")
    lines.said(b"t\r", 0.0)
    assert lines.answered(b"a\r", 0.0) == b""
    assert lines.answered(b"b\r", 0.0) == got
