"""What the journal says of a change, which files it makes and how, and what it lets pass while a change is open."""

from __future__ import annotations

import os
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from motorbus import journal
from motorbus.core.operation import ASKED, INTENT, OUTCOME, REACHED, READABLE, Journal
from motorbus.errors import LinkError, RequestError
from motorbus.journal import BusJournal, Change
from motorbus.link.lock import journal_path

BUS = "feetech:/dev/ttyACM7"


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the journal of a port lies, in a state folder of this test alone."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return journal_path("/dev/ttyACM7")


def begun(path: Path | None = None, **facts: Any) -> BusJournal:
    kept = BusJournal(BUS, path)
    kept(Journal("set_id", INTENT, {"node": 3, **facts}))
    return kept


def change(**facts: Any) -> Change:
    found = begun(**facts).unfinished()
    assert found is not None
    return found


# --- words --------------------------------------------------------------------------------------------------------


def test_a_change_has_the_words_of_its_facts() -> None:
    told = change(what="the borrow of project 1", cause="the lid is open", advice="close {bus}, then {bus}")
    assert told.what == "the borrow of project 1"
    assert told.cause == "the lid is open"
    assert told.advice == f"close {BUS}, then {BUS}"


@pytest.mark.parametrize("facts", [{}, {"what": 7, "cause": ["x"], "advice": None}])
def test_a_change_without_words_has_empty_ones(facts: dict[str, Any]) -> None:
    told = change(**facts)
    assert (told.what, told.cause, told.advice) == ("", "", "")


@pytest.mark.parametrize("node", [True, "3", None, 3.0])
def test_an_id_that_is_no_number_is_none(node: object) -> None:
    with pytest.raises(RequestError, match="does not say which device"):
        _ = change(node=node).node


def test_whoever_is_refused_reads_what_is_open_why_and_what_ends_it() -> None:
    kept = begun()
    with pytest.raises(RequestError) as caught:
        kept(Journal("set_id", INTENT, {"node": 4}))
    error = caught.value
    assert error.summary.startswith("set_id() of #3, begun 20")
    assert "lost its supply" in error.cause
    assert error.advice == f"`motorbus recover {BUS}` finishes it or takes it back; nothing was sent"


def test_a_loan_is_given_back_and_its_own_cause_is_told() -> None:
    kept = begun(what="the borrow of project 1", cause="the lid is open")
    with pytest.raises(RequestError) as caught:
        kept(Journal("set_id", INTENT, {"node": 4}))
    assert caught.value.cause == "the lid is open"
    assert caught.value.advice == f"`motorbus recover {BUS}` gives it back; nothing was sent"


def test_its_own_advice_stands_in_place_of_recovery() -> None:
    kept = begun(advice="close the lid of {bus}")
    with pytest.raises(RequestError) as caught:
        kept(Journal("set_id", INTENT, {"node": 4}))
    assert caught.value.advice == f"close the lid of {BUS}; nothing was sent"
    assert kept.warning().endswith(f"is unfinished; close the lid of {BUS}")


def test_there_is_nothing_to_warn_of_when_nothing_is_unfinished() -> None:
    assert BusJournal(BUS).warning() == ""


def test_a_change_tells_when_it_began_in_utc_and_whole_seconds() -> None:
    before = datetime.now(UTC).replace(microsecond=0)
    at = datetime.fromisoformat(change().begun)
    assert at.utcoffset() == timedelta(0)
    assert at.microsecond == 0
    assert before <= at <= datetime.now(UTC)


# --- what may pass ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("asks", "open_", "passes"), [(1, 1, True), (1, 0, False), (0, 1, False), (0, 0, False)]
)
def test_asking_passes_only_where_both_leave_the_device_readable(asks: int, open_: int, passes: bool) -> None:
    facts: dict[str, Any] = {READABLE: bool(open_)}
    kept = begun(**facts)
    event = Journal("other", ASKED, {"node": 4, READABLE: bool(asks)})
    before = kept._content()
    if passes:
        kept(event)
    else:
        with pytest.raises(RequestError, match="unfinished"):
            kept(event)
    assert kept._content() == before


def test_a_step_of_the_open_change_passes_with_its_facts_or_without() -> None:
    kept = begun(new=7)
    kept(Journal("set_id", "writing", {}))
    kept(Journal("set_id", "written", {"node": 3, "new": 7}))
    found = kept.unfinished()
    assert found is not None
    assert found.facts[REACHED] == [INTENT, "writing", "written"]


def test_a_change_that_has_begun_does_not_begin_again() -> None:
    kept = begun(new=7)
    with pytest.raises(RequestError, match="unfinished"):
        kept(Journal("set_id", INTENT, {"node": 3, "new": 7}))


def test_who_goes_on_with_a_change_that_is_gone_is_told_what_he_wanted() -> None:
    with pytest.raises(RequestError) as caught:
        BusJournal(BUS)(Journal("set_id", "writing 7", {}))
    assert "set_id() has reached 'writing 7'" in caught.value.summary


# --- files --------------------------------------------------------------------------------------------------------


def test_a_write_that_takes_a_byte_at_a_time_is_whole_in_the_end(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:1]))
    kept = begun(path)
    kept(Journal("set_id", "writing 7", {}))
    found = BusJournal(BUS, path).unfinished()
    assert found is not None
    assert found.facts[REACHED] == [INTENT, "writing 7"]


def test_no_file_stays_open(path: Path) -> None:
    def opened() -> int:
        return len(os.listdir("/proc/self/fd"))

    before = opened()
    kept = begun(path)
    kept(Journal("set_id", "writing 7", {}))
    kept.forget()
    assert opened() == before


def test_what_is_forgotten_leaves_an_empty_file(path: Path) -> None:
    begun(path).forget()
    assert path.read_bytes() == b""


def test_the_head_says_what_the_file_is(path: Path) -> None:
    begun(path)
    head = path.read_text().splitlines()[0]
    assert head == f'{{"format": 1, "what": "changes of devices on this bus", "bus": "{BUS}"}}'


def test_a_file_that_cannot_be_read_or_written_is_told_with_its_name_and_why(path: Path) -> None:
    path.mkdir()
    works: dict[str, Callable[[], object]] = {
        "read": BusJournal(BUS, path).unfinished,
        "written": BusJournal(BUS, path).forget,
    }
    for what, work in works.items():
        with pytest.raises(LinkError, match=f"cannot be {what}: is a directory") as caught:
            work()
        assert str(path) in caught.value.summary
        assert "XDG_STATE_HOME" in caught.value.advice


def test_an_error_without_words_of_the_system_is_told_by_its_own(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(self: Path) -> bytes:
        raise OSError("The disk sulks")

    monkeypatch.setattr(Path, "read_bytes", fails)
    with pytest.raises(LinkError, match="cannot be read: the disk sulks"):
        BusJournal(BUS, path).unfinished()


def test_a_folder_that_cannot_be_synced_is_borne(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows opens no folders."""
    open_ = os.open

    def refuses(file: Any, flags: int, *more: Any) -> int:
        if Path(file).is_dir():
            raise PermissionError(13, "Permission denied")
        return open_(file, flags, *more)

    monkeypatch.setattr(os, "open", refuses)
    assert begun(path).unfinished() is not None


def test_an_appended_record_goes_to_the_end_of_the_file_that_is_there(path: Path) -> None:
    kept = begun(path)
    before = path.read_bytes()
    kept(Journal("set_id", "writing 7", {}))
    after = path.read_bytes()
    assert after.startswith(before)
    assert after.count(b"\n") == 3
    assert after.endswith(b"\n")


def test_without_a_file_a_torn_record_gets_a_line_of_its_own_too() -> None:
    kept = begun()
    kept._memory = kept._memory[:-1]
    kept(Journal("set_id", "writing 7", {}))
    found = kept.unfinished()
    assert found is not None
    assert found.facts[REACHED] == [INTENT, "writing 7"]


@pytest.mark.parametrize(
    ("head", "said"), [(b"what?", "no format"), (b'{"format": "9"}', "format '9'"), (b"{}", "format None")]
)
def test_a_file_of_something_else_is_told_with_its_format(path: Path, head: bytes, said: str) -> None:
    path.write_bytes(head + b"\n")
    with pytest.raises(RequestError) as caught:
        BusJournal(BUS, path).unfinished()
    assert caught.value.summary.startswith(f"{path}: a journal with {said},")
    assert caught.value.expected == "format 1"
    assert BusJournal(BUS, path).warning() == f"{caught.value.summary}; {caught.value.advice}"


def test_only_what_is_unfinished_is_listed_and_what_cannot_be_read_is_told(path: Path) -> None:
    begun(path)(Journal("set_id", OUTCOME, {"outcome": "new"}))
    assert journal.everywhere() == []
    journal_path("COM9").mkdir()
    (told,) = journal.everywhere()
    assert isinstance(told, LinkError)
    assert journal.told_by(lambda _: True) == []
