"""The contract has eighteen members and no more, and its small values behave."""

from __future__ import annotations

from motorbus.core.family import Family, Identity, Quality, State


def members() -> set[str]:
    return {name for name in vars(Family) if not name.startswith("_")}


def test_the_contract_has_at_most_eighteen_members() -> None:
    assert len(members()) <= 18


def test_every_member_says_what_it_means_or_has_a_type_that_does() -> None:
    documented = {name for name in members() if vars(Family)[name].__doc__}
    assert members() - documented <= {"link", "devices", "identify", "receiver"}


def test_a_state_knows_what_it_does_not_know() -> None:
    state = State(at=1.0)
    assert state.position is None
    assert state.quality is Quality.FRESH
    assert state.alarm == ()


def test_an_identity_without_table_is_read_only() -> None:
    assert Identity(3, "unknown", "9.9", "").table == ""
