"""The fleet works as it is told to, every axis comes to its goal, and one that does not answer is found out."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from bench import fleet
from bench.fleet import IDS, Fleet, Wrong, course, measured, told
from bench.places import ROOT, surroundings

ONE = Fleet(10040, 2.0, 5.0, 4.0, 2.0, 0.5, 4500.0)


def test_goals_and_readings_come_at_their_rates_in_order() -> None:
    found = course(2.0, 4.0, 1.0)
    assert [(kind, number) for _, kind, number in found] == [
        ("goal", 0), ("read", 0), ("read", 1), ("goal", 1), ("read", 2), ("read", 3)
    ]  # fmt: skip
    assert [moment for moment, _, _ in found] == [0.0, 0.0, 0.25, 0.5, 0.5, 0.75]


def test_two_buses_work() -> None:
    found = measured(2, 2.0, 5.0, 1.0)
    assert (found.axes, found.goals, found.reads, found.simulated) == (2 * len(IDS), 2.0, 5.0, 1.0)
    assert found.processor > 0
    assert found.built > 0


def test_a_servo_that_is_silent_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "ANSWER", 9)
    with pytest.raises(Wrong, match="did not answer"):
        measured(1, 1.0, 1.0, 1.0)


def test_a_servo_that_does_not_come_to_its_goal_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "_SETTLED", 0.01)
    with pytest.raises(Wrong, match="not where it was sent"):
        measured(1, 1.0, 1.0, 1.0)


def test_it_runs_in_a_process_of_its_own() -> None:
    found = fleet.in_a_process(buses=1, seconds=0.4)
    assert (found.axes, found.simulated) == (len(IDS), 0.4)
    assert json.loads(json.dumps(found._asdict()))["reads"] == fleet.READS


def test_what_goes_wrong_there_is_told() -> None:
    with pytest.raises(Wrong, match="StopIteration|IndexError|list index"):
        fleet.in_a_process(buses=0)


def test_what_it_cost_in_words() -> None:
    assert ONE.speed == 2.0
    assert told(ONE) == (
        "10040 axes, 2 goals and 5 readings of each a second: 2.00 times real time, "
        "50 µs for each axis and second\nbuilt in 0.50 s, 4.5 kB of memory for each axis"
    )


def example(*words: str) -> subprocess.CompletedProcess[str]:
    """`examples/fleet.py`, which drives its axes by ordinary buses."""
    command = [sys.executable, str(ROOT / "examples" / "fleet.py"), *words]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=ROOT, env=dict(surroundings())
    )


def test_the_example_tells_its_speed_in_three_digits_and_what_it_does_not_count() -> None:
    done = example("2", "3")
    axes, prepared, speed = done.stdout.splitlines()
    assert axes == "6 axes within 0.000 rad of their goals, simulated"
    assert prepared.startswith("prepared in ")
    assert prepared.endswith(" s of processor time, which is not counted below")
    assert float(f"{float(speed.split()[0]):.3g}") == float(speed.split()[0]) > 0
    assert speed.split()[1:4] == ["times", "real", "time"]


@pytest.mark.parametrize("words", [("0",), ("x",), ("-1", "6"), ("1", "0"), ("1", "51"), ("1", "2", "3")])
def test_the_example_refuses_what_is_no_fleet_in_one_line(words: tuple[str, ...]) -> None:
    done = example(*words)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "expected a number of arms" in line
