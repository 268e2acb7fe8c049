"""The power stage: on without a jump, off for everyone whatever happens."""

from __future__ import annotations

import pytest

from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def limp(run: Run, arm: Simulation, node: int) -> bool:
    return bool(
        run("read", f"{arm.url}#{node}", "torque_enable", "--json").document["registers"][0]["raw"] == 0
    )


def test_on_and_off(run: Run, arm: Simulation) -> None:
    assert run("torque", "on", f"{arm.url}#1+2").code == 0
    assert [limp(run, arm, node) for node in (1, 2, 3)] == [False, False, True]
    assert run("torque", "off", f"{arm.url}#1").code == 0
    assert [limp(run, arm, node) for node in (1, 2, 3)] == [True, False, True]


def test_on_does_not_jump_to_the_old_goal(run: Run, arm: Simulation) -> None:
    assert run("read", f"{arm.url}#1", "goal_position", "--json").document["registers"][0]["raw"] == 0
    assert run("torque", "on", f"{arm.url}#1").code == 0
    assert run("read", f"{arm.url}#1", "goal_position", "--json").document["registers"][0]["raw"] == 2048


def test_a_bus_without_ids_means_everyone(run: Run, arm: Simulation) -> None:
    assert run("torque", "on", f"{arm.url}#1-3").code == 0
    ran = run("torque", "off", arm.url, "--json")
    assert [(one["id"], one["done"]) for one in ran.document["devices"]] == [(1, True), (2, True), (3, True)]
    assert all(limp(run, arm, node) for node in (1, 2, 3))


def test_one_that_is_gone_does_not_keep_the_others_stiff(run: Run, arm: Simulation) -> None:
    assert run("torque", "on", f"{arm.url}#1-3").code == 0
    arm[2].unplug()
    ran = run("torque", "off", f"{arm.url}#1-3")
    assert ran.code == 6
    assert limp(run, arm, 1)
    assert limp(run, arm, 3)


@pytest.mark.parametrize("words", [["on"], ["up", "feetech:sim#1"], []], ids=" ".join)
def test_what_is_no_order_ends_with_2(words: list[str], run: Run) -> None:
    assert run("torque", *words).code == 2
