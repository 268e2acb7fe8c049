"""What the package offers is there by the names that are documented."""

from __future__ import annotations

from motorbus.simulation import faults


def test_every_name_that_is_offered_is_there() -> None:
    assert all(hasattr(faults, name) for name in faults.__all__)
    assert {"Fault", "Script", "FaultyLine", "World", "parse", "shrink", "strike"} <= set(faults.__all__)
