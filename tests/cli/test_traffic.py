"""Listening: what others say is printed as it comes, and nothing at all is sent."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


@pytest.fixture
def reporting() -> Iterator[Simulation]:
    """One servo with newer firmware that reports its position every 20 ms."""
    with motorbus.simulate("kst", ids="0x25", profile="kst-ext") as simulation:
        with motorbus.open(simulation.url) as bus:
            bus.family.devices.blocking(bus, 0x25).set_reports(True)
        yield simulation


def test_reports_are_printed_one_by_one(reporting: Simulation, run: Run) -> None:
    ran = run("monitor", reporting.url, "--listen", "--count", "3", "--json", "-vv")
    assert ran.code == 0
    assert " tx " not in ran.err
    assert [one["schema"] for one in ran.records] == ["motorbus.monitor.heard/1"] * 3
    assert {one["frame"].partition("#")[0] for one in ran.records} == {"5A5"}
    times = [one["time"] for one in ran.records]
    assert times == sorted(times)
    assert times[2] - times[1] == pytest.approx(0.02, abs=0.005)
    assert all(one["simulated"] and not one["fault"] and one["parts"] for one in ran.records)


def test_eyes_see_a_line_each_until_the_time_is_over(reporting: Simulation, run: Run) -> None:
    ran = run("monitor", reporting.url, "--listen", "--duration", "0.2")
    lines = ran.out.splitlines()
    assert (ran.code, lines[0]) == (0, "simulated")
    assert 8 <= len(lines) <= 14
    assert all("5A5#" in line and line.count("0° (raw 0") == 1 for line in lines[1:])


def test_a_silent_bus_is_told(run: Run) -> None:
    with motorbus.simulate("kst", ids="1") as simulation:
        ran = run("monitor", simulation.url, "--listen", "--duration", "0.2")
    assert (ran.code, ran.out) == (5, "")
    assert "nothing was heard" in ran.err


@pytest.mark.parametrize("words", ["kst:sim#1", "kst:sim kst:sim,ids=2", "feetech:sim", ""])
def test_it_is_one_whole_bus_that_can_be_listened_to(words: str, run: Run) -> None:
    ran = run("monitor", *words.split(), "--listen", "--count", "1")
    assert (ran.code, ran.out) == (2, "")
    assert "--listen" in ran.err
