"""Eight nodes fill the wire as the figures say; how it is computed is tested where the wire is."""

from __future__ import annotations

from bench.can_filled import Filled
from bench.row import met
from bench.rows import can_pipeline


def test_the_row_is_the_share_of_the_limit_in_percent() -> None:
    found = can_pipeline.share(Filled(980.0, 1000.0, 0.1, 0.1), Filled(475.0, 500.0, 0.1, 0.1))
    assert (found.number, found.value, found.unit) == ("15", 98.0, "%")
    assert "980 of 1000 reads a second; at 500 kbit/s 475 of 500, 95.0%" in found.note
    assert met(found)


def test_less_than_the_goal_is_missed() -> None:
    assert not met(can_pipeline.share(Filled(949.0, 1000.0, 0.1, 0.1), Filled(475.0, 500.0, 0.1, 0.1)))
