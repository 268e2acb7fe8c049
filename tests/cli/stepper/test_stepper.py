"""Common commands on a stepper bus: what they find, and that nothing is sent without being told."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.cli import monitor
from motorbus.core.steps import Procedure
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line

pytestmark = pytest.mark.usefixtures("state_folder")

READ_1 = "FF AA 3E 01 00 00 00 00 00 00 E8"
WORKS = [
    "scan BUS",
    "ping BUS#1",
    "info BUS#1",
    "info BUS#1 --registers",
    "read BUS#1 total_steps step_1_speed",
    "read BUS#1",
    "write BUS#1 step_1_delay=500ms --yes",
    "write BUS#1 step_1_delay=500ms --dry-run",
    "move BUS#1+=90deg",
    "move BUS#1-=0.25turn --velocity 60rpm",
    "move BUS#1+=90deg --dry-run",
    "jog BUS#1=60rpm --seconds 0.3",
    "monitor BUS#1 --count 1",
    "recover BUS",
    "stop BUS",
    "stop BUS#1 --dry-run",
    "estop BUS#1",
]
ASKS_ONLY = [
    "scan BUS",
    "scan BUS --baud all",
    "ping BUS#1",
    "info BUS#1",
    "info BUS#1 --registers",
    "read BUS#1 total_steps",
    "stepper read-project BUS --project 4",
    "recover BUS",
]
"""Commands that look at a controller; none of them needs to know an input."""


@pytest.mark.parametrize("command", WORKS)
def test_it_works_and_says_that_it_is_simulated(command: str, run: Run) -> None:
    with motorbus.simulate("stepper") as simulation:
        words = command.replace("BUS", simulation.url).split()
        ran = run(*words)
        told = run(*words, "--json")
    assert (ran.code, told.code) == (0, 0), ran.err
    assert "simulated" in ran.out
    assert [record["simulated"] for record in told.records] == [True]


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("move BUS#1=1", "do not know where they are"),
        ("move BUS#1=90deg", "BUS#1+=90deg or BUS#1-=90deg"),
        ("torque on BUS#1", "stepper devices have no"),
        ("calibrate BUS#1 --yes", "stepper devices have no"),
        ("set-id BUS#1 4 --yes", "stepper devices have no"),
        ("move BUS#2+=1", "is not the id of a stepper controller"),
        ("move BUS#1+=1 --acceleration 5", "without --acceleration"),
        ("move BUS#1+=1 BUS#1+=1", "one device goes at a time"),
        ("move BUS#1+=far", "is not a number"),
        ("read BUS#1 colour", "colour"),
        ("write BUS#1 colour=red --yes", "colour"),
        ("write BUS#1 step_1_delay=soon --yes", "is not a number"),
    ],
)
def test_what_it_cannot_is_refused_before_a_port_is_opened(command: str, told: str, run: Run) -> None:
    ran = run(*command.replace("BUS", "stepper:/dev/not-there").split(), "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert told.replace("BUS", "stepper:/dev/not-there") in ran.err
    assert ran.err.count("error: ") == 1


def test_a_scan_tells_the_frame_it_sends(run: Run) -> None:
    with motorbus.simulate("stepper") as simulation:
        ran = run("scan", simulation.url)
    assert f"this is sent and nothing else: {READ_1} (read project 1)" in ran.err


@pytest.mark.parametrize("command", ASKS_ONLY)
def test_looking_sends_nothing_but_read_project(command: str, run: Run, line: Line) -> None:
    """A frame that begins with a motor number, or with 00, would set a register of an attitude sensor."""
    run(*command.replace("BUS", line.url).split())
    assert {data[2] for data in line.heard} == {0x3E}


@pytest.mark.parametrize(
    "command",
    [
        "stop BUS",
        "estop BUS",
        "monitor BUS --count 1",
        "info BUS",
        "ping BUS",
        "read BUS step_1_speed",
        "write BUS step_1_delay=500ms --yes",
        "move BUS+=90deg --yes",
        "move BUS-=90deg --yes",
        "jog BUS=60rpm --seconds 0.3",
    ],
)
def test_nobody_looks_for_the_only_controller_of_a_line(command: str, run: Run, line: Line) -> None:
    ran = run(*command.replace("BUS", line.url).split())
    assert (ran.code, ran.err.count(READ_1)) == (0, 0), ran.err


def test_a_stop_leaves_at_once(run: Run, line: Line) -> None:
    assert run("stop", line.url).code == 0
    assert line.commands() == ["read_project", "stop_project", "stop_motor"], (
        "the first asks whether it echoes"
    )


def test_where_it_cannot_go_is_told_without_its_number_too(run: Run, line: Line) -> None:
    ran = run("move", "stepper:COM7=90deg")
    assert (ran.code, "by an angle from where it stands" in ran.err) == (2, True)
    assert "have no broadcast ping" in run("ping", line.url, "--broadcast").err


def test_ports_are_listed_and_not_asked(run: Run, line: Line) -> None:
    assert run("ports").code == 0
    assert line.heard == []


def test_on_a_silent_line_of_one_rate_no_other_rate_is_advised(run: Run, line: Line) -> None:
    line.simulation[1].unplug()
    ran = run("scan", line.url)
    assert ran.code == 5
    assert "--baud" not in ran.err
    assert "the right port" in ran.err


def test_an_input_is_watched_at_the_rate_that_the_line_allows(run: Run) -> None:
    with motorbus.simulate("stepper") as simulation:
        simulation.pace = True
        ran = run("monitor", f"{simulation.url}#1", "--rate", "20", "--count", "5")
    assert ran.code == 0
    assert "which is all that the line and the devices allow" in ran.err


def test_its_inputs_are_its_telemetry(run: Run, line: Line) -> None:
    line.simulation[1].set_input(5, True)
    assert run("read", f"{line.url}#1", "--json").document["input_5"] is True
    (sample,) = run("monitor", f"{line.url}#1", "--count", "1", "--json").records
    assert (sample["input_4"], sample["input_5"]) == (False, True)
    head, row = run("monitor", f"{line.url}#1", "--count", "1").out.splitlines()[1:]
    assert head.split("  ")[-2:] == ["input 5", "alarm"]
    assert row.split() == ["1", "no", "no", "no", "no", "yes"]


def test_a_silent_controller_has_no_columns_that_it_never_has(run: Run, line: Line) -> None:
    line.simulation[1].unplug()
    ran = run("monitor", line.url, "--count", "1")
    assert ran.code == 5
    head, row = ran.out.splitlines()[1:]
    assert head.split() == ["id", "alarm"]
    assert row.startswith(" 1  node 1 did not answer")


def test_a_controller_that_falls_silent_keeps_its_columns(
    run: Run, line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    pause = monitor._pause

    def unplugged(seconds: float) -> Procedure[None]:
        line.simulation[1].unplug()
        return pause(seconds)

    monkeypatch.setattr(monitor, "_pause", unplugged)
    lines = run("monitor", line.url, "--count", "2").out.splitlines()
    assert [one.count("input 5") for one in lines if one.startswith("id")] == [1, 1]
    assert "did not answer" in lines[-1]


def test_a_dump_is_explained_by_the_names_it_is_read_by(run: Run) -> None:
    with motorbus.simulate("stepper") as simulation, motorbus.open(simulation.url) as bus:
        dump = motorbus.stepper.Controller(bus).dump(1)
    ran = run("decode", "--family", "stepper", dump.hex())
    assert ran.code == 0
    assert "step_1_delay" in ran.out
