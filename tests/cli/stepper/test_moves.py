"""What the manual lets the motor do by hand: each asks for far ways, ends, and is stopped."""

from __future__ import annotations

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line, line_of

pytestmark = pytest.mark.usefixtures("state_folder")

STOPPED = ["stop_motor", "stop_project"]


@pytest.mark.parametrize(("name", "sign"), [("jog_forward", 1), ("jog_reverse", -1)])
def test_a_jog_is_bounded_by_its_time(name: str, sign: int, run: Run, line: Line) -> None:
    words = ("stepper", name.replace("_", "-"), line.url, "--seconds", "200ms", "--json")
    told = run(*words).document["result"]
    assert line.orders() == [name, *STOPPED]
    assert told["angle"] * sign > 0.5
    turned = line.simulation[1].status()["position"] / 1600 * 6.2832
    assert turned == pytest.approx(told["angle"], rel=0.2)


@pytest.mark.parametrize("name", ["jog-forward", "jog-reverse"])
def test_a_long_jog_asks(name: str, run: Run, line: Line) -> None:
    assert run("stepper", name, line.url, "--seconds", "3").code == 8
    assert line.orders() == []
    assert run("stepper", name, line.url, "--seconds", "3", "--yes").code == 0


def test_one_move_goes_as_far_as_step_1_says(run: Run, line: Line) -> None:
    assert run("stepper", "run-once", line.url).code == 8
    ran = run("stepper", "run-once", line.url, "--yes")
    assert ran.code == 0
    assert "estimated" in ran.out
    assert line.orders() == ["run_once", *STOPPED]
    assert line.simulation[1].status()["position"] == -1600


def test_homing_by_its_name_in_the_manual(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("stepper", home_switch="wired") as simulation:
        line = line_of(simulation, monkeypatch)
        ran = run("stepper", "home", line.url, "--deadline", "20s", "--yes")
        assert (ran.code, line.orders()) == (0, ["home", *STOPPED])


def test_a_dry_run_shows_the_stop_too(run: Run, line: Line) -> None:
    ran = run("stepper", "jog-forward", line.url, "--seconds", "9", "--dry-run", "--json")
    assert [one["data"][6:11] for one in ran.document["withheld"]] == ["03 0A", "03 0D", "5E 00"]
    assert line.orders() == []


@pytest.mark.parametrize(
    "words",
    [
        "jog-forward BUS",
        "jog-forward BUS --seconds 0",
        "jog-forward BUS --seconds -1",
        "jog-forward BUS --seconds 3600",
        "jog-reverse BUS --seconds 1m",
        "home BUS --deadline 0 --yes",
        "home BUS --velocity 0.2rpm --yes",
        "home BUS --velocity fast --yes",
        "run-once kst:sim --yes",
    ],
)
def test_bad_input_moves_nothing(words: str, run: Run, line: Line) -> None:
    ran = run("stepper", *words.replace("BUS", line.url).split())
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.count("error: ") == 1
    assert line.orders() == []
