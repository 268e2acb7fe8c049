"""Writing registers: in which words, what needs agreement, what is refused, and what a dry run shows."""

from __future__ import annotations

import math

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def held(run: Run, arm: Simulation, name: str) -> int:
    """The raw value that a register of servo 1 holds."""
    raw: int = run("read", f"{arm.url}#1", name, "--json").document["registers"][0]["raw"]
    return raw


def test_a_value_in_its_unit(run: Run, arm: Simulation) -> None:
    ran = run("write", f"{arm.url}#1", "torque_limit=50%", "goal_velocity=30rpm", "--json")
    assert ran.code == 0
    assert [(row["name"], row["raw"]) for row in ran.document["registers"]] == [
        ("torque_limit", 500),
        ("goal_velocity", 2048),
    ]
    assert held(run, arm, "torque_limit") == 500
    assert held(run, arm, "goal_velocity") == 2048


@pytest.mark.parametrize("words", [["acceleration=20", "--raw"], ["acceleration=20raw"]], ids=" ".join)
def test_a_raw_value(words: list[str], run: Run, arm: Simulation) -> None:
    assert run("write", f"{arm.url}#1", *words).code == 0
    assert held(run, arm, "acceleration") == 20


@pytest.mark.parametrize("words", [["goal_position=2100", "--raw"], ["goal_position=2100raw"]], ids=" ".join)
def test_a_raw_value_that_moves_needs_an_expert(words: list[str], run: Run, arm: Simulation) -> None:
    before = held(run, arm, "goal_position")
    ran = run("write", f"{arm.url}#1", *words)
    assert ran.code == 8
    assert "--expert" in ran.err
    assert held(run, arm, "goal_position") == before
    assert run("write", f"{arm.url}#1", *words, "--expert").code == 0
    assert held(run, arm, "goal_position") == 2100


@pytest.mark.parametrize("words", [["phase=0"], ["phase=0", "--yes"]], ids=" ".join)
def test_nobody_is_told_to_be_an_expert_for_what_is_never_written(
    words: list[str], run: Run, arm: Simulation
) -> None:
    ran = run("write", f"{arm.url}#1", *words)
    assert ran.code == 2
    assert "is not written by name" in ran.err
    assert "--expert" not in ran.err


@pytest.mark.parametrize("choice", ["velocity", "VELOCITY"])
def test_a_choice_by_its_name_is_no_raw_number(choice: str, run: Run, arm: Simulation) -> None:
    assert "EEPROM" in run("write", f"{arm.url}#1", f"operating_mode={choice}").err
    assert run("write", f"{arm.url}#1", f"operating_mode={choice}", "--yes").code == 0
    assert held(run, arm, "operating_mode") == 1


def test_eeprom_needs_agreement(run: Run, arm: Simulation) -> None:
    ran = run("write", f"{arm.url}#1", "max_temperature=65")
    assert ran.code == 8
    assert "--yes" in ran.err
    assert held(run, arm, "max_temperature") == 70
    assert run("write", f"{arm.url}#1", "max_temperature=65", "--yes").code == 0
    assert held(run, arm, "max_temperature") == 65
    assert held(run, arm, "lock") == 1


@pytest.mark.parametrize(
    ("assignment", "code"),
    [
        ("goal_position=nan", 2),
        ("goal_position=1e999", 2),
        ("goal_position=far", 2),
        ("goal_position=9", 8),
        ("goal_position=9999deg", 8),
        ("max_temperature=101", 2),
        ("goal_positon=1", 2),
        ("present_position=1", 2),
        ("id=254", 2),
        ("id=7", 2),
        ("operating_mode=sideways", 2),
        ("goal_position", 2),
        ("=1", 2),
    ],
)
def test_what_cannot_be_written_is_refused_and_nothing_changes(
    assignment: str, code: int, run: Run, arm: Simulation
) -> None:
    before = run("info", f"{arm.url}#1", "--registers", "--json").document
    ran = run("write", f"{arm.url}#1", assignment, "--yes")
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.startswith("error: ")
    assert run("info", f"{arm.url}#1", "--registers", "--json").document == before


def test_nothing_is_written_when_one_of_several_is_wrong(run: Run, arm: Simulation) -> None:
    assert run("write", f"{arm.url}#1", "torque_limit=50%", "max_temperature=101", "--yes").code == 2
    assert held(run, arm, "torque_limit") == 1000


def test_a_word_that_only_some_maps_know_is_a_value(run: Run, arm: Simulation) -> None:
    ran = run("write", f"{arm.url}#1", "operating_mode=step", "--dry-run")
    assert ran.code == 0, ran.err
    assert run("write", f"{arm.url}#1", "operating_mode=constant current", "--dry-run").code == 2


@pytest.mark.parametrize("words", [[], ["goal_time=1", "goal_time=2"]], ids=" ".join)
def test_what_is_no_order_ends_with_2(words: list[str], run: Run, arm: Simulation) -> None:
    assert run("write", f"{arm.url}#1", *words).code == 2


def test_a_dry_run_shows_the_frames_and_sends_none(run: Run, arm: Simulation) -> None:
    ran = run("write", f"{arm.url}#1", "max_temperature=65", "torque_limit=50%", "--dry-run", "--json")
    assert ran.code == 0
    meanings = [frame["meaning"] for frame in ran.document["withheld"]]
    assert [
        next(word for word in ("torque_enable", "lock", "max_t", "torque_l") if word in m) for m in meanings
    ] == [
        "lock",
        "torque_enable",
        "max_t",
        "lock",
        "torque_l",
    ]
    assert held(run, arm, "max_temperature") == 70
    assert held(run, arm, "torque_limit") == 1000


def test_a_dry_run_is_told_in_words(run: Run, arm: Simulation) -> None:
    ran = run("write", f"{arm.url}#1", "goal_position=90deg", "--dry-run")
    assert "would send FF FF 01 05 03 2A 00 04" in ran.out
    assert f"{math.pi / 2:.4g} rad" in ran.out


def test_a_dry_run_refuses_what_a_real_one_would(run: Run, arm: Simulation) -> None:
    assert run("write", f"{arm.url}#1", "goal_position=9", "--dry-run").code == 8


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("write BUS#1 goal_position=70000", "goal_position: 70000 rad is out of range"),
        ("write BUS#1 goal_position=1e308deg", "goal_position: 1e308deg is out of range"),
        ("write BUS#1 goal_position=500deg", "goal_position=500deg: "),
        ("write BUS#1 torque_limit=150%", "torque_limit: 150% is out of range"),
        ("write BUS#1 max_temperature=300 --yes", "max_temperature: 300 °C is out of range"),
        ("write BUS#1 led_mask=70000 --yes", "led_mask: raw value 70000 is out of range 0..255"),
        (
            "move BUS#1=500deg --yes",
            "500deg: node 1: goal position refused: 8.72682 lies outside 0 to 6.28165 rad",
        ),
        ("move BUS#1=1e308deg --yes", "1e308deg: node 1: 1.7453292519943295e+306 rad is no possible goal"),
        ("move BUS#1=0 BUS#2=1e9deg --yes", "1e9deg: node 2: "),
    ],
)
def test_a_value_out_of_range_is_named_as_it_was_typed_with_its_unit(
    words: str, said: str, arm: Simulation, run: Run
) -> None:
    ran = run(*words.replace("BUS", arm.url).split())
    assert ran.err.startswith(f"error: {said}") or f"error: node 1: {said}" in ran.err
    assert "not a finite number" not in ran.err


def test_the_torque_after_a_write_is_noted(run: Run, arm: Simulation) -> None:
    device = f"{arm.url}#1"
    assert "torque" not in run("write", device, "max_temperature=65", "--yes").err
    assert run("torque", "on", device).code == 0
    assert "has its torque back" in run("write", device, "max_temperature=66", "--yes").err
    assert held(run, arm, "torque_enable") == 1
    assert "torque" not in run("write", device, "max_temperature=67", "--dry-run").err
    run("write", device, "operating_mode=velocity", "--yes")
    assert held(run, arm, "torque_enable") == 0
