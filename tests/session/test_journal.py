"""The journal on disk: each record is there before the call returns, torn lines do no harm, nothing is overwritten."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import journal, session
from motorbus.core.steps import ASKED, INTENT, OUTCOME, REACHED, JournalEntry
from motorbus.errors import LinkError, RequestError
from motorbus.journal import BusJournal
from motorbus.link.lock import journal_path, state_folder
from motorbus.session.journals import journal_of

BUS = "feetech:/dev/ttyACM7"
FACTS = {"node": 3, "new": 7, "rate": 1_000_000}


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the journal of a port lies, in a state folder of this test alone."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return journal_path("/dev/ttyACM7")


def record(state: str, **facts: Any) -> JournalEntry:
    return JournalEntry("set_id", state, facts or dict(FACTS))


def begun(path: Path | None) -> BusJournal:
    kept = BusJournal(BUS, path)
    kept(record(INTENT))
    return kept


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.mark.parametrize("on_disk", [True, False])
def test_a_change_is_unfinished_from_its_intent_to_its_outcome(path: Path, on_disk: bool) -> None:
    kept = BusJournal(BUS, path if on_disk else None)
    assert kept.unfinished() is None
    kept(record(INTENT))
    kept(record("writing 7", x=1))
    change = kept.unfinished()
    assert change is not None
    assert (change.verb, change.node, change.bus) == ("set_id", 3, BUS)
    assert change.facts == {**FACTS, REACHED: [INTENT, "writing 7"]}
    kept(record(OUTCOME, outcome="new"))
    assert kept.unfinished() is None
    assert path.exists() is on_disk
    if on_disk:
        assert (lines(path)[0]["format"], lines(path)[0]["bus"]) == (1, BUS)
        assert [one.get("state") for one in lines(path)] == [None, INTENT, "writing 7", OUTCOME]
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        kept(JournalEntry("set_baud", INTENT, {"node": 4}))
        assert [one.get("change") for one in lines(path)] == [None, "set_baud"]
        assert not list(path.parent.glob("*.new"))


@pytest.mark.parametrize("state", [ASKED, INTENT])
def test_nothing_begins_while_another_change_is_unfinished(path: Path, state: str) -> None:
    kept = begun(path)
    with pytest.raises(RequestError, match="unfinished on this bus") as caught:
        kept(JournalEntry("set_baud", state, {"node": 4}))
    assert f"motorbus recover {BUS}" in caught.value.advice
    assert len(lines(path)) == 2


def test_a_torn_last_line_is_no_record(path: Path) -> None:
    kept = begun(path)
    kept(record("writing 7", x=1))
    whole = path.read_bytes()
    for cut in range(1, 60):
        path.write_bytes(whole[:-cut])
        change = kept.unfinished()
        assert change is not None
        torn = cut > 1  # without its newline alone a record is whole
        assert change.facts[REACHED] == ([INTENT] if torn else [INTENT, "writing 7"])
        kept(record("written 7", x=1))
        after = kept.unfinished()
        assert after is not None
        assert after.facts[REACHED] == [*change.facts[REACHED], "written 7"]


def test_a_crash_while_the_file_is_made_leaves_the_old_one(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = begun(path)
    kept(record(OUTCOME, outcome="new"))
    before = path.read_bytes()

    def dies(self: Path, target: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", dies)
    with pytest.raises(KeyboardInterrupt):
        kept(record(INTENT))
    assert path.read_bytes() == before
    assert kept.unfinished() is None
    monkeypatch.undo()
    monkeypatch.setenv("XDG_STATE_HOME", str(path.parent.parent))
    kept(record(INTENT))
    assert kept.unfinished() is not None


@pytest.mark.parametrize("content", [b"{}\n", b'{"format": 2}\n', b"what?\n", b"\xff\xfe\n"])
def test_a_file_of_a_later_version_is_refused_with_what_to_do(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    kept = BusJournal(BUS, path)
    works: list[Callable[[], object]] = [
        kept.unfinished,
        lambda: kept(record(ASKED)),
        lambda: kept(record(INTENT)),
    ]
    for work in works:
        with pytest.raises(RequestError, match="does not know") as caught:
            work()
    assert "version that wrote it" in caught.value.advice
    (error,) = journal.everywhere()
    assert isinstance(error, RequestError)
    assert "does not know" in error.summary
    assert "does not know" in kept.warning()
    assert path.read_bytes() == content


def test_each_record_and_the_folder_are_synced(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    fsync = os.fsync

    def watched(descriptor: int) -> None:
        synced.append(Path(f"/proc/self/fd/{descriptor}").resolve().name)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", watched)
    kept = begun(path)
    assert synced == [f"{path.name}.new", path.parent.name]
    kept(record("writing 7", x=1))
    assert synced[2:] == [path.name]


def test_a_disk_that_takes_nothing_is_an_error_of_ours(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    kept = begun(path)
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        with pytest.raises(LinkError, match="cannot be written: no space left on device"):
            kept(record("writing 7", x=1))
    assert kept.unfinished() is not None


def test_every_unfinished_change_of_this_user_is_listed(path: Path) -> None:
    begun(path)
    other = BusJournal("feetech:COM7", journal_path("COM7"))
    other(JournalEntry("set_baud", INTENT, {"node": 4}))
    done = BusJournal("feetech:COM8", journal_path("COM8"))
    done(record(INTENT))
    done(record(OUTCOME, outcome="old"))
    journal_path("COM9").write_text('{"format": 2}')
    listed = [change.bus for change in journal.everywhere() if isinstance(change, journal.Change)]
    assert sorted(listed) == [BUS, "feetech:COM7"], "one that cannot be read hides no other"


def test_a_record_whose_facts_are_others_belongs_to_another_change(path: Path) -> None:
    """Two changes of one program: the second must not end the first, whatever has come in between."""
    kept = begun(path)
    for facts in ({"node": 4}, {"new": 8}, {"node": 3, "new": 8}):
        with pytest.raises(RequestError, match="unfinished"):
            kept(record(OUTCOME, outcome="old", **facts))
    assert kept.unfinished() is not None
    kept(record(OUTCOME, outcome="old", node=3, new=7, something="else"))
    assert kept.unfinished() is None


@pytest.mark.parametrize(
    "line",
    [b"[1]", b'"x"', b'{"state": "x", "facts": [1]}', b'{"state": "x", "facts": {"node": "3"}}', b"[" * 9999],
)
def test_a_journal_with_odd_contents_is_reported_and_forgotten(path: Path, line: bytes) -> None:
    head = b'{"format": 1, "bus": "feetech:/dev/ttyACM7"}\n'
    path.write_bytes(head + line + b"\n")
    kept = BusJournal(BUS, path)
    change = kept.unfinished()
    assert bool(kept.warning()) is (change is not None)
    if change is not None:
        assert journal.everywhere() == [change]
        with pytest.raises(RequestError, match="does not say which device") as caught:
            _ = change.node
        assert "--forget" in caught.value.advice
    kept.forget()
    assert kept.unfinished() is None
    kept(record(INTENT))


def test_a_file_is_found_by_the_name_that_the_bus_had(path: Path) -> None:
    begun(path)
    assert journal.find_files(lambda bus: bus == BUS) == [path]
    assert journal.find_files(lambda bus: bus == "feetech:COM7") == []
    other = journal_path("COM7")
    other.write_bytes(b'{"format": 2}\n')
    assert journal.find_files(lambda _: True) == [path], "what cannot be read is none, and is skipped"
    BusJournal(BUS, path)(record(OUTCOME, outcome="old"))
    assert journal.find_files(lambda _: True) == []


# -- at open ------------------------------------------------------------------------------------------------------


def test_an_unfinished_change_is_a_warning_at_open_and_refuses_only_changes() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        with motorbus.open(simulation.url) as bus:
            assert bus.warnings == ()
            assert bus.journal is not None
            bus.journal(record(INTENT))
        with motorbus.open(simulation.url) as bus:
            assert "motorbus recover" in bus.warnings[0]
            change = session.unfinished(bus)
            assert change is not None
            assert change.bus == simulation.url
            servo = motorbus.feetech.Servo(bus, 3)
            servo.enable_torque()
            servo.move(3.0)
            servo.stop()
            servo.disable_torque()
            with pytest.raises(RequestError, match="unfinished"):
                servo.set_id(7)
            with pytest.raises(RequestError, match="unfinished"):
                servo.set_baud(500_000)
        assert simulation[3].memory.wear.total() == 0


def test_nothing_of_a_simulated_bus_is_on_the_disk(path: Path) -> None:
    with motorbus.open("feetech:sim,ids=3") as bus:
        motorbus.feetech.Servo(bus, 3).set_id(7)
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        motorbus.feetech.Servo(bus, 3).set_id(7)
    assert not list(state_folder().glob("*.journal"))


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
