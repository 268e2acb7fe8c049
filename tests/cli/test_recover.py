"""Killed in the middle, in earnest: the next command says so, and `recover` ends it; else there is nothing to do."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
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


def test_kill_9_in_the_middle_of_an_id(run: Run, served: Simulated) -> None:
    killed("intent", "set-id", f"{served.bus}#3", "7", "--yes")
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
    assert ran.document["outcome"] == "old"
    rows = run("read", f"{served.bus}#3", "id", "lock", "--json").document["registers"]
    assert [row["raw"] for row in rows] == [3, 1]
    assert run("recover").out == "nothing is unfinished\n"


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
            "taken": [[1, 1_000_000]],
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
    assert "lock 0 (open" in ran.out
    assert "by the STS map" not in ran.out
    assert "motorbus recover" in ran.err


def test_a_change_is_given_up(run: Run, half: Simulation) -> None:
    half[3].unplug()
    ran = run("recover", half.url, "--yes")
    assert ran.code == 5
    assert run("recover", half.url, "--forget").code == 8
    ran = run("recover", half.url, "--forget", "--yes", "-vv")
    assert (ran.code, ran.out) == (0, "simulated\nforgotten: the change of #3 to #7\n")
    assert " 03 " not in ran.err
    assert run("set-id", f"{half.url}#2", "8", "--yes").code == 0


def test_a_change_on_a_port_that_is_gone_is_given_up_without_it(run: Run, state_folder: Path) -> None:
    kept = BusJournal("feetech:/dev/ttyACM42", journal_path("/dev/ttyACM42"))
    kept(JournalEntry("set_id", INTENT, {"node": 3, "new": 7}))
    assert run("recover", "feetech:/dev/ttyACM42", "--yes").code == 3
    assert run("recover", "feetech:/dev/ttyACM42", "--forget").code == 8
    ran = run("recover", "feetech:/dev/ttyACM42", "--forget", "--yes")
    assert (ran.code, ran.out) == (0, "forgotten: the change of #3 to #7\n")
    assert kept.unfinished() is None


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


def test_nothing_to_do(run: Run, arm: Simulation, state_folder: Path) -> None:
    assert run("recover", arm.url).out == f"simulated\nnothing is unfinished on {arm.url}\n"
    assert run("recover", arm.url, "--json").document["outcome"] is None
    assert run("recover", "--json").document == {"schema": "motorbus.recover.list/1", "changes": []}


@pytest.mark.parametrize("words", ["--forget", "--dry-run", "--baud 1M", "--of feetech:COM1"])
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
