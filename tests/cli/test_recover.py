"""Killed in the middle, in earnest: the next command says so, and `recover` ends it; else there is nothing to do."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import motorbus
from motorbus import session
from motorbus.core.steps import INTENT, JournalEntry
from motorbus.journal import BusJournal
from motorbus.link.lock import journal_path
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run
from tests.support.processes import Simulated

KILLED_AT = """
import os, signal, sys
from motorbus.cli import main
from motorbus.journal import BusJournal

record, state = BusJournal.__call__, sys.argv[1]

def last(self, event):
    record(self, event)
    if event.state == state:
        os.kill(os.getpid(), signal.SIGKILL)

BusJournal.__call__ = last
main(sys.argv[2:])
"""


def killed(state: str, *words: str) -> None:
    """This command in a process of its own, killed by kill -9 as soon as the journal has that state."""
    command = [sys.executable, "-c", KILLED_AT, state, *words]
    ended = subprocess.run(command, capture_output=True, timeout=60, check=False)
    assert ended.returncode == -signal.SIGKILL, ended.stderr


@pytest.mark.parametrize(("state", "end"), [("intent", "old"), ("writing 7", "old"), ("written 7", "new")])
def test_kill_9_in_the_middle_of_an_id(state: str, end: str, run: Run, served: Simulated) -> None:
    killed(state, "set-id", f"{served.bus}#3", "7", "--yes", "--among", "1-9")
    (listed,) = run("recover", "--json").document["changes"]
    assert (listed["bus"], listed["change"], listed["id"], listed["new"]) == (served.bus, "set_id", 3, 7)
    told = run("ping", f"{served.bus}#1")
    assert told.code == 0
    assert f"motorbus recover {served.bus}" in told.err
    refused = run("set-id", f"{served.bus}#1", "8", "--yes")
    assert refused.code == 2
    assert f"motorbus recover {served.bus}" in refused.err
    ran = run("recover", served.bus, "--yes", "--json")
    assert ran.code == 0, ran.err
    assert ran.document["outcome"] == end
    there = 7 if end == "new" else 3
    rows = run("read", f"{served.bus}#{there}", "id", "lock", "--json").document["registers"]
    assert [row["raw"] for row in rows] == [there, 1]
    assert run("recover").out == "nothing is unfinished\n"


def test_kill_9_in_the_middle_of_a_rate(run: Run, served: Simulated) -> None:
    killed("written 1", "set-baud", f"{served.bus}#3", "500000", "--yes", "--among", "1-9")
    assert "motorbus recover" in run("recover").out
    ran = run("recover", served.bus, "--yes")
    assert ran.code == 0, ran.err
    assert ran.out == f"finished: the change of #3 to 500000 bit/s; it is {served.bus},baud=500000#3 now\n"
    assert run("ping", f"{served.bus},baud=500000#3").code == 0


def test_kill_9_in_the_middle_of_the_recovery(run: Run, served: Simulated) -> None:
    killed("writing 7", "set-id", f"{served.bus}#3", "7", "--yes", "--among", "1-9")
    killed("recovering", "recover", served.bus, "--yes")
    ran = run("recover", served.bus, "--yes")
    assert ran.code == 0, ran.err
    assert ran.out == "taken back: the change of #3 to #7\n"


@pytest.fixture
def half(arm: Simulation) -> Simulation:
    """A bus on which the id of servo 3 is half changed."""
    with motorbus.open(arm.url) as bus:
        assert bus.journal is not None
        image = bytes(arm[3].memory.read(0, 40)).hex()
        facts = {
            "node": 3,
            "new": 7,
            "rate": 1_000_000,
            "new_rate": 1_000_000,
            "registers": image,
            "others": [1],
        }
        bus.journal(JournalEntry("set_id", INTENT, facts))
    return arm


def test_it_is_asked_before(run: Run, half: Simulation) -> None:
    ran = run("recover", half.url)
    assert ran.code == 8
    assert "finish the change of #3 to #7, or take it back" in ran.err
    with motorbus.open(half.url) as bus:
        assert session.unfinished(bus) is not None


def test_a_dry_run_shows_what_it_would_send(run: Run, half: Simulation) -> None:
    ran = run("recover", half.url, "--dry-run")
    assert ran.code == 0
    assert "lock 1 (closed" in ran.out
    assert "motorbus recover" in ran.err


def test_a_change_is_given_up(run: Run, half: Simulation) -> None:
    half[3].unplug()
    ran = run("recover", half.url, "--yes")
    assert ran.code == 5
    assert f"`motorbus recover {half.url} --alone`" in ran.err
    assert run("recover", half.url, "--forget").code == 8
    ran = run("recover", half.url, "--forget", "--yes", "-vv")
    assert (ran.code, ran.out) == (0, "simulated\nforgotten: the change of #3 to #7\n")
    assert " 03 " not in ran.err
    assert run("set-id", f"{half.url}#2", "8", "--yes", "--among", "1-9").code == 0


def test_alone_is_not_believed_when_others_answer(run: Run, half: Simulation) -> None:
    half[3].unplug()
    ran = run("recover", half.url, "--alone", "--yes")
    assert ran.code == 2
    assert "the servo is not alone: " in ran.err


def test_a_port_that_has_another_name_since(run: Run, served: Simulated, tmp_path: Path) -> None:
    """The journal is that of the name; the adapter came back under another one."""
    killed("written 7", "set-id", f"{served.bus}#3", "7", "--yes", "--among", "1-9")
    (path,) = (tmp_path / "state" / "motorbus").glob("*.journal")
    gone = "feetech:/dev/ttyACM42"
    path.write_text(path.read_text().replace(served.bus, gone))
    path.rename(journal_path("/dev/ttyACM42"))
    assert run("recover", served.bus).out == f"nothing is unfinished on {served.bus}\n"
    ran = run("recover", served.bus, "--of", gone, "--yes")
    assert (ran.code, ran.out) == (0, f"finished: the change of #3 to #7; it is {served.bus}#7 now\n"), (
        ran.err
    )
    assert run("recover").out == "nothing is unfinished\n"


def test_a_change_on_a_port_that_is_gone_is_given_up_without_it(run: Run, state_folder: Path) -> None:
    kept = BusJournal("feetech:/dev/ttyACM42", journal_path("/dev/ttyACM42"))
    kept(JournalEntry("set_id", INTENT, {"node": 3, "new": 7}))
    assert run("recover", "feetech:/dev/ttyACM42", "--yes").code == 3
    assert run("recover", "feetech:/dev/ttyACM42", "--forget").code == 8
    ran = run("recover", "feetech:/dev/ttyACM42", "--forget", "--yes")
    assert (ran.code, ran.out) == (0, "forgotten: the change of #3 to #7\n")
    assert kept.unfinished() is None


@pytest.fixture
def link(served: Simulated, tmp_path: Path) -> Path:
    """The port by a name of its user's, a link; the id of servo 3 was half changed by that name."""
    link = tmp_path / "arm"
    link.symlink_to(served.bus.partition(":")[2])
    killed("written 7", "set-id", f"feetech:{link}#3", "7", "--yes", "--among", "1-9")
    return link


def test_a_link_that_is_gone_names_its_journal_all_the_same(run: Run, link: Path) -> None:
    link.unlink()
    assert f"motorbus recover feetech:{link}" in run("recover").out
    ran = run("recover", f"feetech:{link}", "--yes")
    assert ran.code == 3, "without a port nothing can be done, and nobody says that nothing is to be done"
    ran = run("recover", f"feetech:{link}", "--forget", "--yes")
    assert (ran.code, ran.out) == (0, "forgotten: the change of #3 to #7\n"), ran.err
    assert run("recover").out == "nothing is unfinished\n"


def test_a_link_that_leads_elsewhere_since_names_its_journal_all_the_same(
    run: Run, served: Simulated, link: Path, tmp_path: Path
) -> None:
    """The adapter was plugged in again, and the system has given it another number."""
    (path,) = (tmp_path / "state" / "motorbus").glob("*.journal")
    path.rename(journal_path("/dev/ttyACM42"))
    told = run("ping", f"feetech:{link}#1")
    assert (told.code, f"motorbus recover feetech:{link}" in told.err) == (0, True)
    assert run("set-id", f"feetech:{link}#1", "8", "--yes").code == 2
    ran = run("recover", f"feetech:{link}", "--yes")
    assert (ran.code, ran.out) == (0, f"finished: the change of #3 to #7; it is feetech:{link}#7 now\n"), (
        ran.err
    )
    assert run("recover").out == "nothing is unfinished\n"


def test_giving_up_opens_no_port(
    run: Run, served: Simulated, link: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody_may(*_: object, **__: object) -> None:
        raise AssertionError("the port was opened")

    monkeypatch.setattr(session, "open", nobody_may)
    ran = run("recover", f"feetech:{link}", "--forget", "--yes")
    assert (ran.code, ran.out) == (0, "forgotten: the change of #3 to #7\n"), ran.err


def test_a_family_that_keeps_no_journal_says_what_to_do_instead(run: Run) -> None:
    with motorbus.simulate("kst", ids="37") as simulation:
        for more in ([], ["--forget", "--yes"], ["--dry-run"]):
            ran = run("recover", simulation.url, *more)
            assert ran.code == 2
            assert "kst buses keep no journal" in ran.err
            assert "repeat `motorbus set-id`" in ran.err
    assert run("recover", "kst:can://slcan/dev/ttyACM42").code == 2, "before a port is opened"


def test_programs_are_told_how_it_is_addressed_now(run: Run, half: Simulation) -> None:
    document = run("recover", half.url, "--yes", "--json").document
    assert (document["outcome"], "address" in document) == ("old", False)


@pytest.fixture
def lent() -> Iterator[Simulation]:
    """A stepper controller whose project 1 was borrowed when its host was cut off."""
    with motorbus.simulate("stepper") as simulation, motorbus.open(simulation.url) as bus:
        image = simulation[1].store.image(1)
        facts = {
            "node": 1,
            "what": "the borrow of project 1 (for jog)",
            "image": image.hex(),
            "order": "little",
            "motor": 3,
            "wanted": {"step_1_speed": 60},
        }
        assert bus.journal is not None
        bus.journal(JournalEntry("jog", INTENT, facts))
        bus.close()
        yield simulation


def test_a_borrowed_project_is_called_by_its_name(run: Run, lent: Simulation) -> None:
    asked = run("recover", lent.url)
    assert asked.code == 8
    assert "end the borrow of project 1 (for jog): stop the device, and give back what was there" in asked.err
    ran = run("recover", lent.url, "--yes", "--json")
    assert ran.code == 0, ran.err
    assert ran.document == {
        "schema": "motorbus.recover/1",
        "bus": lent.url,
        "change": "jog",
        "id": 1,
        "what": "the borrow of project 1 (for jog)",
        "begun": ran.document["begun"],
        "outcome": "old",
        "simulated": True,
    }
    assert run("recover", lent.url).out == f"simulated\nnothing is unfinished on {lent.url}\n"


def test_what_was_borrowed_is_given_back_and_not_finished(run: Run, lent: Simulation) -> None:
    ran = run("recover", lent.url, "--yes")
    assert ran.out.splitlines() == ["simulated", "given back: the borrow of project 1 (for jog)"]
    assert f"`motorbus recover {lent.url}` gives it back" in ran.err


def test_a_dry_run_of_giving_back_shows_the_stop_first(run: Run, lent: Simulation) -> None:
    ran = run("recover", lent.url, "--dry-run")
    assert ran.code == 0, ran.err
    assert ran.out.index("FF AA 03 0D") < ran.out.index("FF AA 5E") < ran.out.index("FF AA 03 05")
    assert run("recover", lent.url, "--forget", "--yes").out.endswith(
        "forgotten: the borrow of project 1 (for jog)\n"
    )


def test_a_borrow_is_listed(run: Run, state_folder: Path) -> None:
    kept = BusJournal("stepper:/dev/ttyUSB7", journal_path("/dev/ttyUSB7"))
    kept(JournalEntry("move_by", INTENT, {"node": 1, "what": "the borrow of project 1 (for move_by)"}))
    ran = run("recover")
    assert "the borrow of project 1 (for move_by)" in ran.out
    assert "motorbus recover stepper:/dev/ttyUSB7" in ran.out


def test_nothing_to_do(run: Run, arm: Simulation, state_folder: Path) -> None:
    assert run("recover", arm.url).out == f"simulated\nnothing is unfinished on {arm.url}\n"
    assert run("recover", arm.url, "--json").document["outcome"] is None
    assert run("recover", "--json").document == {"schema": "motorbus.recover.list/1", "changes": []}


@pytest.mark.parametrize("words", ["--alone", "--forget", "--dry-run", "--baud 1M", "--of feetech:COM1"])
def test_without_a_bus_there_is_nothing_to_do_it_to(words: str, run: Run, state_folder: Path) -> None:
    assert run("recover", *words.split()).code == 2


def test_a_journal_of_a_later_version_is_told_and_touched_by_nobody(run: Run, served: Simulated) -> None:
    path = journal_path(served.bus.partition(":")[2])
    path.write_text(json.dumps({"format": 2}) + "\n")
    told = run("ping", f"{served.bus}#1")
    assert told.code == 0
    assert "does not know" in told.err
    assert f"`motorbus recover {served.bus} --forget`" in told.err
    for words in (["recover"], ["recover", served.bus], ["set-id", f"{served.bus}#1", "9", "--yes"]):
        ran = run(*words)
        assert ran.code == 2
        assert "version that wrote it" in ran.err
    assert path.read_text() == '{"format": 2}\n'


def test_what_is_told_of_a_changed_id_has_the_rate_it_answers_at(
    run: Run, tmp_path: Path, state_folder: Path
) -> None:
    """The change was made at another rate than the one at which the bus is opened now."""
    with Simulated("feetech", ids="1-3", link=tmp_path / "bus", servo_baud="500000") as slower:
        bus, _, rate = slower.bus.partition(",")
        assert rate == "baud=500000"
        killed("written 7", "set-id", f"{slower.bus}#3", "7", "--yes", "--among", "1-9")
        ran = run("recover", bus, "--yes", "--json")
        assert ran.code == 0, ran.err
        assert ran.document["address"] == f"{bus},baud=500000#7"
        assert run("ping", ran.document["address"]).code == 0


HEADS = ('{"format": 1, "bus": "feetech:/dev/ttyACM42"}', '{"format": 2}', "[]")
LINES = ('{"state": "x"}', '{"state": "x", "facts": [1]}', "{", "")


@pytest.mark.parametrize(("head", "line"), [*zip(HEADS, LINES, strict=False), (HEADS[0], LINES[3])])
def test_a_damaged_journal_hinders_no_stop_and_can_be_forgotten(
    head: str, line: str, run: Run, served: Simulated
) -> None:
    path = journal_path(served.bus.partition(":")[2])
    path.write_text(f"{head}\n{line}\n")
    assert run("stop", f"{served.bus}#1").code == 0
    assert run("recover").code in (0, 2)
    assert run("recover", served.bus, "--yes").code in (0, 2)
    assert run("recover", served.bus, "--forget", "--yes").code == 0
    assert run("recover").out == "nothing is unfinished\n"
    assert run("set-id", f"{served.bus}#3", "7", "--yes", "--among", "1-9").code == 0


def test_a_journal_that_cannot_be_read_hides_no_other(run: Run, served: Simulated) -> None:
    killed("written 7", "set-id", f"{served.bus}#3", "7", "--yes", "--among", "1-9")
    journal_path("/dev/ttyACM42").write_text('{"format": 2}\n')
    ran = run("recover")
    assert ran.code == 2
    assert served.bus in ran.out
    assert "version that wrote it" in ran.err


def test_a_recovery_elsewhere_that_finds_nobody_can_be_said_again_and_given_up(
    run: Run, served: Simulated
) -> None:
    """The journal of another port; what is begun on this one is kept whole, and not without its facts."""
    killed("writing 7", "set-id", f"{served.bus}#3", "7", "--yes", "--among", "1-9")
    here, gone = journal_path(served.bus.partition(":")[2]), journal_path("/dev/ttyACM42")
    text = here.read_text().replace(served.bus, "feetech:/dev/ttyACM42")
    gone.write_text(text.replace('"node": 3, "new": 7', '"node": 200, "new": 201'))
    assert '"node": 200' in gone.read_text()
    here.unlink()
    assert run("recover", served.bus, "--of", "feetech:/dev/ttyACM42", "--yes").code == 5
    listed = run("recover", "--json").document["changes"]
    assert [(one["id"], one["new"]) for one in listed] == [(200, 201), (200, 201)]
    assert run("recover", served.bus, "--yes").code == 5
    for bus in (served.bus, "feetech:/dev/ttyACM42"):
        assert run("recover", bus, "--forget", "--yes").code == 0
    assert run("recover").out == "nothing is unfinished\n"
