"""Finding the reference: agreed to, bounded, and never left running."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.core.steps import Sleep
from tests.cli.conftest import Bench, Run
from tests.cli.stepper.conftest import line_of

pytestmark = pytest.mark.usefixtures("state_folder")


def homed(
    run: Run, monkeypatch: pytest.MonkeyPatch, switch: str, *words: str
) -> tuple[int, str, list[str], object]:
    """Exit code, what was said, what was ordered, and how fast the motor turns 2 s later."""
    with motorbus.simulate("stepper", home_switch=switch) as simulation:
        line = line_of(simulation, monkeypatch)
        ran = run("home", f"{line.url}#1", *words)
        orders = line.orders()
        with motorbus.open(line.url) as bus:
            bus.run(Sleep(2.0))  # a slow stop takes its time
        return ran.code, ran.out + ran.err, orders, simulation[1].status()["frequency"]


def test_it_ends_at_its_switch(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    code, said, orders, turning = homed(run, monkeypatch, "wired", "--yes")
    assert (code, orders, turning) == (0, ["home", "stop_motor", "stop_project"], 0)
    assert "input 5 was active" in said


@pytest.mark.parametrize(("switch", "moved"), [("never", True), ("stuck", False)])
def test_a_bad_switch_ends_with_8_and_at_rest(
    switch: str, moved: bool, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    code, _, orders, turning = homed(run, monkeypatch, switch, "--deadline", "3s", "--yes")
    assert (code, "home" in orders) == (8, moved)
    assert turning == 0


def test_it_asks_first(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    code, said, orders, _ = homed(run, monkeypatch, "wired")
    assert (code, orders) == (8, [])
    assert "until its switch is met" in said


@pytest.mark.parametrize(
    "words",
    [
        "stepper:sim#2",
        "feetech:sim",
        "feetech:sim#1",
        "stepper:sim#1 --deadline never",
        "stepper:sim#1 --deadline 0",
    ],
)
def test_bad_input_ends_with_2(words: str, run: Run) -> None:
    ran = run("home", *words.split(), "--yes")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1


def test_an_axis_is_homed_by_its_name(run: Run, bench: Bench) -> None:
    assert "would send FF AA" in run("home", "lift", "--dry-run").out
    ran = run("home", "lift", "--yes", "--json")
    assert (ran.code, ran.document["schema"]) == (0, "motorbus.home.axes/1")
    assert ran.document["axes"] == [{"name": "lift", "at": 0.0}]
    assert run("move", "lift+=3mm").code == 0
    assert "0.00 mm (estimated)" in run("home", "stage", "--deadline", "20s", "--yes").out


def test_it_asks_before_an_axis_is_homed(run: Run, bench: Bench) -> None:
    ran = run("home", "lift")
    assert (ran.code, "home lift: each moves until its switch is met" in ran.err) == (8, True)


@pytest.mark.parametrize(
    "words", ["", "a1", "all", "lift a9", "lift stage#1", "lift --velocity 1deg/s", "lift --velocity 0"]
)
def test_what_cannot_home_is_refused(words: str, run: Run, bench: Bench) -> None:
    ran = run("home", *words.split(), "--yes")
    assert (ran.code, ran.out, ran.err.count("error: ")) == (2, "", 1)


def test_an_axis_homes_within_its_velocity(run: Run, bench: Bench) -> None:
    """Its device is set to 100 RPM, which are 8.3 mm/s here; what is slower than that is borrowed for."""
    text = bench.file.read_text(encoding="utf-8")
    assert 'max_velocity = "20 mm/s"' in text
    bench.file.write_text(
        text.replace('max_velocity = "20 mm/s"', 'max_velocity = "5 mm/s"'), encoding="utf-8"
    )
    assert run("home", "lift", "--velocity", "6mm/s", "--yes").code == 8
    for words in ((), ("--velocity", "4mm/s")):
        ran = run("home", "lift", *words, "--yes", "--json")
        assert (ran.code, ran.err) == (0, "")
        assert ran.document["axes"] == [{"name": "lift", "at": 0.0}]
        assert run("move", "lift+=3mm").code == 0
