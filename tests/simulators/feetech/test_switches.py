"""Every doubt has a name, a default and a source, and can be said in a bus string."""

from __future__ import annotations

from dataclasses import fields
from functools import partial

import pytest

from motorbus.core.switches import options, switched
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.switches import Switches

chosen = partial(switched, Switches, "feetech")


def test_text_and_values_mean_the_same() -> None:
    text = chosen({"factory_restore": "no", "store_time": "0.05", "id_ack": "old"})
    values = chosen({"factory_restore": False, "store_time": 0.05, "id_ack": "old"})
    assert text == values == Switches(factory_restore=False, store_time=0.05, id_ack="old")


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("broadcast_pong", "collide", "no option 'broadcast_pong'"),
        ("broadcast_ping", "both", "'both' is not possible"),
        ("factory_restore", "maybe", "neither yes nor no"),
        ("store_time", "long", "'long' is not possible"),
        ("store_time", "-1", "'-1' is not possible"),
        ("store_time", "nan", "'nan' is not possible"),
    ],
)
def test_nonsense_is_refused_by_name(name: str, value: str, says: str) -> None:
    with pytest.raises(RequestError) as caught:
        chosen({name: value})
    assert says in caught.value.summary


def test_a_near_miss_is_told() -> None:
    with pytest.raises(RequestError) as caught:
        chosen({"broadcast_pong": "collide"})
    assert "broadcast_ping" in caught.value.expected


@pytest.mark.parametrize("one", fields(Switches), ids=lambda one: one.name)
def test_each_has_a_help_text_a_source_and_a_default_among_its_choices(one: object) -> None:
    metadata, default = one.metadata, one.default  # type: ignore[attr-defined]
    assert metadata["help"]
    assert metadata["source"]
    assert not metadata["choices"] or default in metadata["choices"]


def test_every_switch_is_an_option_with_its_choices_and_its_source() -> None:
    found = {option.name: option for option in options(Switches)}
    assert set(found) == {one.name for one in fields(Switches)}
    assert found["id_ack"].choices == ("old", "new")
    assert all(option.source for option in found.values())
    assert found["store_time"].kind is float
