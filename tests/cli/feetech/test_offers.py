"""What events say to people; all others say nothing."""

from __future__ import annotations

import motorbus
from motorbus.cli.feetech.offers import say
from motorbus.core.steps import Progress
from motorbus.families.feetech.driver import ScanWarning, Skipped
from tests.cli.conftest import Run


def test_events_in_words() -> None:
    assert say(ScanWarning(3, 1_000_000, 8, garbled=4)) == (
        "#3 at 1000000 bit/s: two servos seem to have this id (of 8 answers 4 garbled); connect them one at a time"
    )
    assert say(Skipped(76_800, "no such rate")) == "nothing was asked at 76800 bit/s: no such rate"
    assert say(Progress(1, 2)) == ""


def test_a_scan_tells_of_two_servos_with_one_id(run: Run) -> None:
    with motorbus.simulate("feetech", ids=(3, 3, 4)) as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        ran = run("scan", simulation.url, "--ids", "1-5")
        assert ran.code == 0
        assert "note: #3 at 1000000 bit/s: two servos seem to have this id" in ran.err
        document = run("scan", simulation.url, "--ids", "1-5", "--json").document
    assert [one["id"] for one in document["devices"]] == [3, 4]
    assert "two servos" in document["notes"][0]
