"""What was found out about a controller goes into a file and comes back, and a file that cannot be says which field."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program import Profile
from motorbus.families.stepper.program.profile import KNOWN, MEMORY
from motorbus.families.stepper.program.source import LONGEST
from motorbus.families.stepper.simulator import Switches, simulate

FULL = Profile(
    settled={"ramp": "time", "ramp_tick_ms": 2.5, "notice_on_stop": True, "select": "relabel"},
    evidence={"ramp": 'five moves; "quoted"\nand \\ more'},
    measured={"tick_ms": 2.5, "overhead": -0.004, "turnaround": 1e-05, "clock": 1.0},
    open={"save_cut": "only a supply that goes while it saves could tell", "busy": "\x7f ü"},
)


def test_a_profile_comes_back_from_its_file() -> None:
    assert Profile.parse(FULL.text()) == FULL
    assert FULL.text().startswith("format = 1\n")
    assert Profile.parse("format = 1\n") == Profile()
    assert Profile().text() == "format = 1\n"


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "device.toml"
    path.write_text(FULL.text(), encoding="utf-8")
    assert Profile.load(str(path)) == FULL


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="cannot be read: no such file"):
        Profile.load(str(tmp_path / "none.toml"))
    path = tmp_path / "device.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(RequestError, match="is no text"):
        Profile.load(str(path))
    path.write_text("#" * (LONGEST + 2), encoding="utf-8")
    with pytest.raises(RequestError, match="characters"):
        Profile.load(str(path))


def test_what_is_settled_is_how_projects_are_carried_out() -> None:
    how = FULL.behaviour()
    assert (how.ramp, how.ramp_tick_ms, how.notice_on_stop) == ("time", 2.5, True)
    assert how.rounding == USUAL.rounding
    assert FULL.behaviour(Behaviour(rounding="carry")).rounding == "carry"
    assert Profile().behaviour() == USUAL


def test_a_simulated_controller_can_be_made_of_it() -> None:
    simulated = simulate((1,), **FULL.options()).switches
    assert (simulated.ramp_tick_ms, simulated.notice_on_stop, simulated.select) == (2.5, True, "relabel")


def test_the_questions_are_those_of_the_simulator() -> None:
    switches = {one.name: one for one in fields(Switches)}
    assert set(KNOWN) <= set(switches)
    assert {one.name for one in fields(Behaviour)} <= set(KNOWN)
    for name, choices in MEMORY.items():
        assert switches[name].metadata["choices"] == choices


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "format: is missing"),
        ("format = 2", "format: 2 is not known"),
        ("format = true", "format: "),
        ("format = 1\nsettle = 3", "the file: there is no field 'settle'"),
        ("format = 1\nsettled = 3", "settled: 3 is no table"),
        ("format = 1\n[settled]\nrump = 'time'", "settled: there is no field 'rump'"),
        ("format = 1\n[settled]\nramp = 'tim'", "settled, ramp: 'tim' is not possible"),
        ("format = 1\n[settled]\nramp = 1", "settled, ramp: 1 is not possible"),
        ("format = 1\n[settled]\nselect = 'loud'", "settled, select: 'loud' is not possible"),
        ("format = 1\n[settled]\nnotice_on_stop = 'yes'", "settled, notice_on_stop: 'yes' is neither"),
        ("format = 1\n[settled]\nramp_tick_ms = 0", "settled, ramp_tick_ms: 0 is not possible"),
        ("format = 1\n[settled]\nramp_tick_ms = 'x'", "settled, ramp_tick_ms: 'x' is no number"),
        ("format = 1\n[settled]\nramp_tick_ms = nan", "settled, ramp_tick_ms: nan is no number"),
        ("format = 1\n[settled]\nramp_tick_ms = true", "settled, ramp_tick_ms: True is no number"),
        ("format = 1\n[measured]\nspeed = 1", "measured: there is no field 'speed'"),
        ("format = 1\n[measured]\nclock = inf", "measured, clock: inf is no number"),
        ("format = 1\n[open]\nramp = 1", "open, ramp: 1 is no text"),
        ("format = 1\n[evidence]\nramp = 'seen'", "evidence, ramp: it is not settled"),
        ("format = 1\n[settled]\nramp = 'time'\n[open]\nramp = 'why'", "open, ramp: it is settled too"),
        ("format = ", "the file is no TOML"),
        (f"format = {'9' * 5000}", "thousands of digits"),
    ],
)
def test_a_file_that_cannot_be_says_which_field(text: str, says: str) -> None:
    with pytest.raises(RequestError, match=says):
        Profile.parse(text)
