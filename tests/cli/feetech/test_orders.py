"""`motorbus feetech factory-restore`."""

from __future__ import annotations

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_back_as_shipped_needs_consent_and_says_where_it_is(run: Run, arm: Simulation) -> None:
    assert run("write", f"{arm.url}#3", "max_temperature=60", "--yes").code == 0
    assert run("feetech", "factory-restore", f"{arm.url}#3").code == 8
    assert arm[3].memory["max_temperature"] == 60
    document = run("feetech", "factory-restore", f"{arm.url}#3", "--yes", "--json").document
    assert (document["id"], document["found"], document["baud"]) == (3, 3, 1_000_000)
    assert arm[3].memory["max_temperature"] == 70
    assert arm[1].memory["max_temperature"] == 70
