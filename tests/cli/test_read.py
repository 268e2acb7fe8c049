"""Registers and telemetry, in API units and raw."""

from __future__ import annotations

import math

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run


def test_telemetry_when_no_register_is_named(run: Run, arm: Simulation) -> None:
    document = run("read", f"{arm.url}#1", "--json").document
    assert document["schema"] == "motorbus.telemetry/1"
    assert document["position"] == pytest.approx(math.pi)
    assert (document["voltage"], document["moving"], document["alarm"]) == (pytest.approx(7.4), False, [])


def test_registers_in_the_order_they_were_named(run: Run, arm: Simulation) -> None:
    document = run(
        "read", f"{arm.url}#1", "present_voltage", "present_position", "operating_mode", "--json"
    ).document
    assert [(row["name"], row["raw"], row["unit"], row["meaning"]) for row in document["registers"]] == [
        ("present_voltage", 74, "V", ""),
        ("present_position", 2048, "rad", ""),
        ("operating_mode", 0, "", "position"),
    ]
    assert document["registers"][1]["value"] == pytest.approx(math.pi)


def test_a_table_for_eyes(run: Run, arm: Simulation) -> None:
    ran = run("read", f"{arm.url}#1", "present_position")
    assert (ran.code, ran.err) == (0, "")
    assert "3.1416 rad (180.0°)" in ran.out
    assert "(simulated)" in ran.out


@pytest.mark.parametrize(
    ("target", "name", "code"),
    [
        ("#1", "present_positon", 2),
        ("#254", "present_position", 2),
        ("#9", "present_position", 5),
        ("", "id", 2),
    ],
)
def test_what_cannot_be_read(target: str, name: str, code: int, run: Run, arm: Simulation) -> None:
    ran = run("read", f"{arm.url}{target}", name)
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.startswith("error: ")


def test_an_unknown_register_gets_a_suggestion(run: Run, arm: Simulation) -> None:
    assert "perhaps present_position" in run("read", f"{arm.url}#1", "present_positon").err


def test_an_option_may_be_a_flag(run: Run) -> None:
    assert run("read", "feetech:sim#3", "id", "--ids", "3", "--json").document["registers"][0]["value"] == 3


def test_an_option_that_does_not_exist_is_named(run: Run) -> None:
    ran = run("read", "feetech:sim#1", "--colour", "red")
    assert ran.code == 2
    assert "colour" in ran.err


def test_of_an_axis_its_own_position_stands_beside_what_the_device_tells(run: Run, bench: Bench) -> None:
    assert run("move", "a1=-20deg").code == 0
    told = run("read", "a1", "--json").document
    assert (told["axis"], told["id"]) == ("a1", 1)
    assert told["axis_position"] == pytest.approx(-0.349, abs=0.01)
    assert told["position"] == pytest.approx(-0.349 + math.pi, abs=0.01)
    out = run("read", "a1").out
    assert out.startswith("#1, the device of a1 (simulated)\n")
    assert "a1 at" in out
    assert run("read", "a1", "present_position").out.startswith("#1, the device of a1")
    assert run("read", "lift", "--json").document["axis_position"] is None
