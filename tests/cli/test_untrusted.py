"""An axis whose guarded change was cut off: no command moves it or gives it torque, and each says what ends that."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.cli.exits import Exit
from motorbus.core.steps import INTENT, OUTCOME, JournalEntry
from tests.cli.conftest import Bench, Run


def noted(bench: Bench, state: str, **facts: object) -> None:
    """It stands in the journal of the bus of the arm."""
    with motorbus.open(bench.simulations["arm"].url) as bus:
        assert bus.journal is not None
        bus.journal(JournalEntry("set_id", state, {"node": 1, "new": 9, **facts}))


@pytest.mark.parametrize(
    "command",
    ["move a1=10deg", "move a1=10deg a2=10deg", "torque on a1", "hold a1", "jog a1=5deg/s --seconds 1"],
)
def test_what_moves_it_or_gives_it_torque_is_refused_and_says_what_ends_that(
    command: str, bench: Bench, run: Run
) -> None:
    noted(bench, INTENT)
    told = run(*command.split())
    assert told.code == Exit.UNSAFE
    assert "a1 is at fault: untrusted: " in told.err
    assert "of arm#1 is unfinished" in told.err
    assert "motorbus recover" in told.err
    assert "nothing was sent" in told.err
    noted(bench, OUTCOME, outcome="taken back")
    assert run(*command.split()).code == 0


@pytest.mark.parametrize("word", ["a1", "{one}"])
@pytest.mark.parametrize(
    "command", ["write {} goal_position=185deg", "torque on {}", "move {}=185deg --velocity 10deg/s"]
)
def test_a_raw_write_and_an_address_walk_around_that_no_more_than_a_move(
    command: str, word: str, bench: Bench, run: Run
) -> None:
    one = word.format(one=f"{bench.machine.buses['arm'].address}#1")
    if command.startswith("move") and word == "a1":
        command = "hold {}"
    words = command.format(one).split()
    noted(bench, INTENT)
    told = run(*words)
    assert told.code == Exit.UNSAFE, told.err
    assert "untrusted: " in told.err
    assert "motorbus recover" in told.err
    noted(bench, OUTCOME, outcome="taken back")
    assert run(*words).code == 0


def test_stop_and_torque_off_go(bench: Bench, run: Run) -> None:
    noted(bench, INTENT)
    assert run("stop", "a1").code == 0
    assert run("torque", "off", "a1").code == 0


@pytest.mark.parametrize(
    "command",
    [
        "move lift=1mm --assume lift=0mm",
        "move lift+=1mm",
        "jog lift=1mm/s --seconds 1",
        "jog lift=1mm/s --seconds 150",
        "home lift --yes",
        "home lift",
    ],
)
def test_a_borrow_that_was_cut_off_is_one_error_for_every_command(
    command: str, bench: Bench, run: Run
) -> None:
    with motorbus.open(bench.simulations["stage"].url) as bus:
        assert bus.journal is not None
        bus.journal(JournalEntry("jog", INTENT, {"node": 1, "what": "the borrow of project 1 (for jog)"}))
    told = run(*command.split())
    assert told.code == Exit.UNSAFE, told.err
    assert "error: lift is at fault: untrusted: the borrow of project 1 (for jog) is" in told.err
    assert told.err.count("what to do: end that change first; nothing was sent") == 1
