"""The wire that does nothing but carry."""

from __future__ import annotations

import pytest

from motorbus.core.operation import CanFrame, Data
from motorbus.link.base import Delivery, Line, PerfectLine, Side


@pytest.mark.parametrize("data", [b"abc", CanFrame(1, b"abc")])
def test_a_perfect_line_carries_to_the_other_side_at_once(data: Data) -> None:
    line: Line = PerfectLine()
    assert line.carry(Side.HOST, data, 2.5) == [Delivery(2.5, Side.DEVICE, data)]
    assert line.carry(Side.DEVICE, data, 2.5) == [Delivery(2.5, Side.HOST, data)]
