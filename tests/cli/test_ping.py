"""Are they there: all, some, none, and everyone at once."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run
from tests.support.lines import ByteFault, ByteFaultLine


def test_all_answer(run: Run, arm: Simulation) -> None:
    ran = run("ping", f"{arm.url}#1-3", "--json")
    assert ran.code == 0
    assert [(one["id"], one["answers"]) for one in ran.document["devices"]] == [
        (1, True),
        (2, True),
        (3, True),
    ]
    assert all(one["milliseconds"] >= 0 for one in ran.document["devices"])


def test_some_answer(run: Run, arm: Simulation) -> None:
    arm[2].unplug()
    ran = run("ping", f"{arm.url}#1", f"{arm.url}#2+3")
    assert ran.code == 6
    assert "#2" in ran.err
    assert "NO" in ran.out


def test_none_answers(run: Run, arm: Simulation) -> None:
    assert run("ping", f"{arm.url}#9").code == 5


@pytest.mark.parametrize("words", [[], ["feetech:sim"], ["feetech:sim#1", "--broadcast"]], ids=" ".join)
def test_what_is_no_question_ends_with_2(words: list[str], run: Run) -> None:
    assert run("ping", *words).code == 2


def test_everyone_at_once_where_the_answers_do_not_collide(run: Run) -> None:
    with motorbus.simulate("feetech", ids="1+4", broadcast_ping="in_turn") as arm:
        found = run("ping", arm.url, "--broadcast", "--json").document["devices"]
    assert [one["id"] for one in found] == [1, 4]


def test_answers_that_collide_are_told_from_silence(run: Run, arm: Simulation) -> None:
    ran = run("ping", arm.url, "--broadcast")
    assert (ran.code, ran.out) == (5, "")
    assert "something answers, and not one answer came whole" in ran.err
    assert "several devices answered at once" in ran.err
    assert f"`motorbus scan {arm.url}`" in ran.err
    assert "no power" not in ran.err
    for servo in (1, 2, 3):
        arm[servo].unplug()
    ran = run("ping", arm.url, "--broadcast")
    assert (ran.code, ran.out) == (5, "")
    assert "no device answers" in ran.err
    assert "several" not in ran.err


def test_some_of_the_answers_to_a_broadcast_are_garbled(run: Run) -> None:
    with motorbus.simulate("feetech", ids="1+4", broadcast_ping="in_turn") as arm:
        arm.line = ByteFaultLine(ByteFault(2, 11, "corrupt", value=1))  # the last byte of the second answer
        ran = run("ping", arm.url, "--broadcast", "--json")
    assert ran.code == 6
    assert [one["id"] for one in ran.records[0]["devices"]] == [1]
    assert "part of what came was garbled" in ran.err + ran.out
    assert "`motorbus scan" in ran.err + ran.out
