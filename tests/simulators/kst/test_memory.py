"""Live and stored values: what a save keeps, how long it takes, and what a restart brings back."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.families.kst.simulator.memory import KEPT, Memory


def memory() -> Memory:
    return Memory({"node_id": 37, "bit_rate_code": 5, "goal_position": 0, "function_enable": 0})


def test_a_write_is_live_and_not_stored() -> None:
    values = memory()
    values["node_id"] = 38
    assert (values["node_id"], values.stored("node_id", 0.0)) == (38, 37)
    assert not values.saved(0.0)
    values.restart(1.0, cut="old")
    assert values["node_id"] == 37
    assert values.saved(1.0)


def test_a_save_is_done_after_its_time_and_not_before() -> None:
    values = memory()
    values["node_id"] = 38
    values.save(1.0, 0.15)
    assert (values.saving(1.149), values.stored("node_id", 1.149)) == (True, 37)
    assert (values.saving(1.15), values.stored("node_id", 1.15)) == (False, 38)


def test_a_save_keeps_what_was_there_when_it_began() -> None:
    values = memory()
    values.save(1.0, 0.15)
    values["node_id"] = 38
    values.restart(2.0, cut="old")
    assert values["node_id"] == 37


@pytest.mark.parametrize(("cut", "node"), [("old", 37), ("new", 38)])
def test_a_restart_in_the_middle_of_a_save(cut: str, node: int) -> None:
    values = memory()
    values["node_id"] = 38
    values.save(1.0, 0.15)
    values.restart(1.1, cut=cut)
    assert values["node_id"] == node
    assert not values.saving(1.1)


@pytest.mark.parametrize(("cut", "node"), [("old", 37), ("new", 38)])
def test_what_the_supply_leaves_in_the_middle_of_a_save_stays_so(cut: str, node: int) -> None:
    values = memory()
    values["node_id"] = 38
    values.save(1.0, 0.15)
    values.lose_supply(1.1, cut=cut)
    assert values.stored("node_id", 9.0) == node
    values.restart(9.0, cut="old")
    assert values["node_id"] == node


def test_a_save_without_time_is_done_at_once() -> None:
    values = memory()
    values["node_id"] = 38
    values.save(1.0, 0.0)
    assert not values.saving(1.0)
    assert values.saved(1.0)


def test_the_target_is_never_kept() -> None:
    values = memory()
    values["goal_position"] = 900
    values.save(0.0, 0.0)
    values.restart(1.0, cut="old")
    assert values["goal_position"] == 0
    assert "goal_position" not in KEPT


def test_a_save_may_leave_out_the_reverse_bit() -> None:
    values = memory()
    values["function_enable"] = 0x21
    values.save(0.0, 0.0, without_reverse=True)
    assert values.stored("function_enable", 0.0) == 0x01


def test_what_is_not_there_has_a_substitute() -> None:
    assert "zero" not in memory()
    assert "node_id" in memory()
    assert (memory().get("zero", 7), memory().get("node_id", 7)) == (7, 37)


def test_the_middle_of_a_save() -> None:
    values = memory()
    assert values.midway(0.0) == inf
    values.save(1.0, 0.3)
    assert values.midway(1.1) == pytest.approx(1.15)
    assert values.midway(1.4) == inf
