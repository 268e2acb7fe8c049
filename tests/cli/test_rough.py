"""A machine file with a mistake in it does not take the stop away: what can be seen in it is stopped."""

from __future__ import annotations

import pytest

from motorbus.cli.rough import rough
from tests.cli.conftest import Bench, Run

HALF = """
format =
[bus.arm]
address = "feetech:COM7"  # left
[bus.lift
address = "stepper:COM8"
[axis.a1]
device = "arm#1"
low = "90 dog"
[axis.a2]
device = "arm#2
[axis.a3]
exit = "hold
device = 'arm#3'
[axis.lift]
device = "lift#1"
[group.both]
axes = ["a1", "a2", "a3"]
"""


def test_a_line_that_is_broken_costs_no_other() -> None:
    found = rough(HALF)
    assert {name: bus.address for name, bus in found.buses.items()} == {"arm": "feetech:COM7"}
    assert {name: axis.device for name, axis in found.axes.items()} == {"a1": "arm#1", "a3": "arm#3"}
    assert found.axes_of("both") == ("a1", "a3")


def test_a_whole_file_is_seen_as_it_is_read(bench: Bench) -> None:
    found = rough(bench.file.read_text(encoding="utf-8"))
    assert found.buses == bench.machine.buses
    assert found.groups == bench.machine.groups
    assert {name: one.device for name, one in found.axes.items()} == {
        name: one.device for name, one in bench.machine.axes.items()
    }


@pytest.mark.parametrize("words", ["stop", "stop a1 lift", "stop arm", "estop", "estop arm"])
def test_whoever_is_seen_is_stopped_and_that_somebody_may_be_missing_is_told(
    words: str, bench: Bench, run: Run
) -> None:
    text = bench.file.read_text(encoding="utf-8").replace('device = "arm#2"', 'device = "arm#2')
    bench.file.write_text(text, encoding="utf-8")
    assert run("torque", "on", f"{bench.simulations['arm'].url}#1").code == 0
    ran = run(*words.split(), "--json")
    assert ran.code == 6, ran.err
    assert "who can be seen in a file with an error" in ran.err
    if words.startswith("stop"):
        assert ran.document["devices"][0]["axis"] == "a1"
        assert all(one["done"] for one in ran.document["devices"])
    else:
        assert bench.simulations["arm"][1].memory["torque_enable"] == 0


@pytest.mark.parametrize("command", ["stop", "estop"])
def test_where_nothing_is_seen_it_says_what_needs_no_file(command: str, bench: Bench, run: Run) -> None:
    bench.file.write_text("this is no machine", encoding="utf-8")
    ran = run(command, "a1")
    assert (ran.code, ran.out) == (2, "")
    assert "`motorbus stop FAMILY:PORT` and `motorbus estop FAMILY:PORT` need no file" in ran.err


def test_an_address_asks_no_file(bench: Bench, run: Run) -> None:
    bench.file.write_text("this is no machine", encoding="utf-8")
    assert run("stop", f"{bench.simulations['arm'].url}#1").code == 0


def test_nothing_moves_by_such_a_file(bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8").replace('device = "arm#2"', 'device = "arm#2')
    bench.file.write_text(text, encoding="utf-8")
    assert run("move", "a1=10deg").code == 2
    assert run("torque", "off", "a1").code == 2
