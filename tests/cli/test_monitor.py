"""Watching: so often, so long, as a table or as JSON Lines, and what a silent device does to it."""

from __future__ import annotations

import pytest

from motorbus.cli import monitor
from motorbus.core.steps import Sleep
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run


def test_json_lines_one_per_device_and_sample(run: Run, arm: Simulation) -> None:
    ran = run("monitor", f"{arm.url}#1+2", "--count", "3", "--rate", "10", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert [one["id"] for one in ran.records] == [1, 2, 1, 2, 1, 2]
    assert {one["schema"] for one in ran.records} == {"motorbus.monitor/1"}
    assert {one["simulated"] for one in ran.records} == {True}
    first, _, second, *_ = ran.records
    assert second["at"] - first["at"] == pytest.approx(0.1, abs=0.01), "in virtual time"


def test_a_duration_ends_it(run: Run, arm: Simulation) -> None:
    assert len(run("monitor", f"{arm.url}#1", "--duration", "1", "--rate", "4", "--json").records) == 4


def test_a_bus_means_everyone_on_it(run: Run, arm: Simulation) -> None:
    ran = run("monitor", arm.url, "--count", "1")
    assert ran.code == 0
    assert ran.out.count("3.1416") == 3


def test_a_silent_device_keeps_its_row(run: Run, arm: Simulation) -> None:
    ran = run("monitor", f"{arm.url}#1+9", "--count", "2", "--json")
    assert ran.code == 6
    assert ["error" in one for one in ran.records] == [False, True, False, True]
    assert run("monitor", f"{arm.url}#9", "--count", "1").code == 5


def test_interrupting_it_is_the_usual_end(run: Run, arm: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(monitor, "_pause", interrupt)
    assert run("monitor", f"{arm.url}#1", "--json").code == 0


@pytest.mark.parametrize(
    "words",
    [[], ["feetech:sim", "--rate", "0"], ["feetech:sim", "--count", "-1"], ["feetech:sim", "--rate", "nan"]],
)
def test_what_is_no_order_ends_with_2(words: list[str], run: Run) -> None:
    assert run("monitor", *words).code == 2


def test_an_axis_has_its_own_position_in_its_own_unit(run: Run, bench: Bench) -> None:
    assert run("move", "a1=30deg").code == 0
    head, row = run("monitor", "a1", "--count", "1").out.splitlines()[1:3]
    assert head.split()[:6] == ["axis", "axis", "at", "id", "position", "(rad)"]
    assert row.split()[:4] == ["a1", "30.0", "deg", "1"] or row.split()[:4] == ["a1", "29.9", "deg", "1"]
    (told,) = run("monitor", "a1", "--count", "1", "--json").records
    assert told["axis"] == "a1"
    assert told["axis_position"] == pytest.approx(0.5236, abs=0.01)
    assert told["position"] == pytest.approx(0.5236 + 3.1416, abs=0.01)
    reckoned = run("monitor", "arm#1", "lift", "--count", "1", "--json").records
    assert [(one.get("axis"), one.get("axis_position")) for one in reckoned] == [(None, None), ("lift", None)]


def test_l12_it_goes_on_when_a_port_that_was_gone_is_there_again(
    run: Run, arm: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    pauses: list[float] = []

    async def pulled(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 2:
            arm.unplug(seconds=1.0)
        await Sleep(seconds)

    monkeypatch.setattr(monitor, "_pause", pulled)
    ran = run("monitor", f"{arm.url}#1", "--rate", "4", "--count", "12", "--json")
    assert ran.code == 0, ran.err
    failed = ["error" in one for one in ran.records]
    assert failed[:2] == [False, False]
    assert 3 <= sum(failed) <= 6, "as long as it was away"
    assert not any(failed[-3:])
    first, second = ran.err.splitlines()
    assert "is looked for until it is there again" in first
    assert second == f"note: {arm.url} is there again"


def test_a_bus_of_the_file_is_its_axes_without_a_scan_and_a_silent_one_has_its_row(
    run: Run, bench: Bench
) -> None:
    bench.simulations["arm"][2].unplug()
    ran = run("monitor", "arm", "--count", "1", "--json", "-vv")
    rows = ran.records
    assert [(row["axis"], "error" in row) for row in rows] == [("a1", False), ("a2", True), ("a3", False)]
    assert ran.code == 6
    asked = {line.split()[line.split().index("tx") + 3] for line in ran.err.splitlines() if " tx " in line}
    assert asked == {"01", "02", "03"}
