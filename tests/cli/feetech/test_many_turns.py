"""Over how many turns a servo counts, from the shell: read, changed with consent, shown without being sent."""

from __future__ import annotations

import math

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.families.feetech.maps import MODELS


def test_it_is_read_and_changes_nothing(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3") as servo:
        document = run("feetech", "many-turns", f"{servo.url}#3", "--json").document
        assert document["schema"] == "motorbus.feetech.many-turns/1"
        assert (document["id"], document["goals"], document["told"]) == (3, False, False)
        assert (document["position"], document["raw_phase"]) == (math.pi, 12)
        said = run("feetech", "many-turns", f"{servo.url}#3").out
        assert "position   within one turn" in said
        assert "limits     0.0000 rad" in said
        for words in (["--dry-run"], ["--low", "1", "--high", "2"], ["sideways"], ["off", "--low", "1"]):
            assert run("feetech", "many-turns", f"{servo.url}#3", *words).code == 2
        assert servo[3].memory["torque_enable"] == 0
        assert servo[3].memory.wear[18] == 0


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_a_servo_is_made_one_of_many_turns_and_one_of_one_turn_again(name: str, run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model=MODELS[name], servo_baud=1_000_000) as servo:
        bus, phase = f"{servo.url}#3", servo[3].memory["phase"]
        ran = run("feetech", "many-turns", bus, "on")
        assert ran.code == 8
        assert "let #3 go limp and count over many turns" in ran.err
        assert servo[3].memory["phase"] == phase
        document = run("feetech", "many-turns", bus, "on", "--yes", "--json").document
        assert (document["goals"], document["told"]) == (True, True)
        assert (document["before"]["goals"], document["before"]["told"]) == (False, False)
        assert "forgets its turns" in document["note"]
        assert servo[3].memory["phase"] == phase | 16
        assert run("torque", "on", bus).code == 0
        assert run("move", f"{bus}=720deg", "--yes").code == 0
        assert run("stop", bus).code == 0
        (told,) = run("read", bus, "present_position", "--json").document["registers"]
        assert told["value"] == pytest.approx(4 * math.pi, abs=0.05)
        ran = run("feetech", "many-turns", bus, "off", "--yes")
        assert ran.code == 2
        assert "expected: --low and --high, in rad; " in ran.err
        ran = run("feetech", "many-turns", bus, "off", "--low", "0", "--high", "350deg", "--yes")
        assert ran.code == 0
        assert "goals      over many turns" in ran.out
        assert "note: it is limp now" in ran.err
        assert (servo[3].memory["phase"], servo[3].memory["max_position_limit"]) == (phase, 3982)


def test_all_that_would_be_sent_is_shown(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3") as servo:
        ran = run("feetech", "many-turns", f"{servo.url}#3", "on", "--dry-run", "--json")
        assert (ran.code, ran.err) == (0, "")
        assert [one["data"][12:-3] for one in ran.document["withheld"]] == [
            *("03 37 00", "03 28 00", "03 12 1C", "03 09 00 00 00 00", "03 37 01")
        ]
        assert servo[3].memory["phase"] == 12


def test_a_servo_of_one_turn_is_refused_before_anybody_is_asked(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3", model="scs0009") as servo:
        assert run("feetech", "many-turns", f"{servo.url}#3", "on").code == 2
        assert run("feetech", "many-turns", f"{servo.url}#3").code == 2


def test_where_goals_count_more_turns_than_are_told_the_command_is_named(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3") as servo:
        servo[3].memory["max_position_limit"] = 0
        ran = run("torque", "on", f"{servo.url}#3")
        assert ran.code == 2
        assert "`motorbus feetech many-turns BUS#ID on` makes it tell its turns" in ran.err
