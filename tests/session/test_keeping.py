"""Which journal belongs to a bus, and what it tells when it is opened again."""

from __future__ import annotations

from pathlib import Path

import pytest

import motorbus
from motorbus.core.operation import INTENT, Journal
from motorbus.journal import BusJournal
from motorbus.session.keeping import journal_of, unfinished


def test_a_real_port_has_a_journal_whether_it_is_open_or_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    kept = journal_of("feetech:/dev/ttyACM0,baud=500000")
    assert kept is not None
    assert kept.unfinished() is None


@pytest.mark.parametrize("address", ["feetech:sim,ids=1", "feetech:sim:arm", "kst:can://virtual/anything"])
def test_what_is_no_port_of_its_own_has_none(address: str) -> None:
    assert journal_of(address) is None


def test_an_address_that_is_none_has_no_journal_either() -> None:
    with pytest.raises(motorbus.RequestError):
        journal_of("nobody:/dev/x")


def test_a_simulated_bus_keeps_its_journal_while_it_lives() -> None:
    with motorbus.simulate("feetech") as sim:
        with motorbus.open(sim.url) as bus:
            assert unfinished(bus) is None
            assert isinstance(bus.journal, BusJournal)
            bus.journal(Journal("set_id", INTENT, {"node": 1, "to": 5}))
        with motorbus.open(sim.url) as bus:
            change = unfinished(bus)
            assert change is not None
            assert change.verb == "set_id"
            assert any("set_id" in warning or "set-id" in warning for warning in bus.warnings)
